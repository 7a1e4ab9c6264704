"""Groups that were logged less often than their controller works."""

from contrast_pairs.driven import driven_pair
from driven_rigs.draw import Recording

from fes_pin.contrasts.contrast import contrast


def test_a_slow_log_is_no_frame_that_swings_in_all_groups(tmp_path):
    """Nor does it leave anything in one of them, as it did before efforts were moved to where they acted."""
    found = contrast(driven_pair((), 0.4, 1300002, tmp_path, Recording(measured=True, every=5)))
    assert found.verdict == "nothing_changed", str(found)
    assert found.common == ()
    assert any("after it acted, and was moved" in words for words in found.warnings)


def test_what_changed_is_found_in_a_slow_log(tmp_path):
    found = contrast(driven_pair(("damping",), 0.4, 1300010, tmp_path, Recording(measured=True, every=5)))
    assert [c.name for c in found.changes] == ["damping"], str(found)
