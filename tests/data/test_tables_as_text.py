"""Tables as text and by columns."""

from fes_pin.data.show import by_columns, table_text


def test_a_table_as_text_has_columns_and_cells_of_several_lines():
    rows = [("friction", "a 1\nbb 2", "80 %"), ("lag", "c", "9 %")]
    assert table_text("s: found.", ("cause", "size", "gain"), rows, ["noted"]).split("\n") == [
        "s: found.",
        " cause     size  gain",
        " friction  a 1   80 %",
        "           bb 2",
        " lag       c     9 %",
        " noted",
    ]
    assert table_text("s: nothing.", ("cause",), (), ["noted"]) == "s: nothing.\n noted"


def test_columns_of_no_rows_are_empty():
    assert by_columns(("a", "b"), [(1, 2), (3, 4)]) == {"a": [1, 3], "b": [2, 4]}
    assert by_columns(("a", "b"), []) == {"a": [], "b": []}
