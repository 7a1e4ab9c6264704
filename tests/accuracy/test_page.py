"""docs/accuracy.md has the tables of the counts that are stored beside it."""

import json

from harness import page
from harness.generators import GENERATORS
from harness.row import Row


def test_the_page_is_as_its_data():
    text, data = page.PAGE.read_text(encoding="utf-8"), page.read()
    assert page.with_tables(text, data) == text
    assert all(f"`{name}`" in text for name in GENERATORS)


def test_a_run_is_written_into_data_and_page(tmp_path, monkeypatch):
    monkeypatch.setattr(page, "DATA", tmp_path / "accuracy.json")
    monkeypatch.setattr(page, "PAGE", tmp_path / "accuracy.md")
    page.DATA.write_text("{}")
    page.PAGE.write_text(f"before\n{page.BEGIN}\nold\n{page.END}\nafter\n")
    rows = [Row("a", ("fatigue",), "", False, "f" * 64, sets=(("fatigue",),), cpu_s=2.0)]
    page.write("imposed", "scripts/accuracy imposed", rows)
    page.write("free", "scripts/accuracy free", rows)
    page.write("imposed", "scripts/accuracy imposed --count 2", [*rows, *rows])
    text = page.PAGE.read_text()
    assert text.startswith("before\n") and text.endswith(f"{page.END}\nafter\n") and "\nold\n" not in text
    assert text.index("`free`") < text.index("`imposed`") and "--count 2" in text and "2 of 2" in text
    assert list(json.loads(page.DATA.read_text())) == ["free", "imposed"]
    assert json.loads(page.DATA.read_text())["free"]["code"] == "f" * 12
