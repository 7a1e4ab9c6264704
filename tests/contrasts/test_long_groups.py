"""Groups of trials that are longer than a search can hold, or smoothed before they were stored."""

from dataclasses import replace

import pytest
from contrast_pairs.driven import driven_pair

import fes_pin as fp
from fes_pin.data.smooth import low_pass
from fes_pin.prepare import long_records


@pytest.mark.parametrize("changes", [(), ("coulomb_friction",)], ids=["nothing", "friction"])
def test_long_groups_are_thinned_alike(changes, monkeypatch, tmp_path):
    monkeypatch.setattr(long_records, "MOST_DRIVEN", 1000)
    found = fp.contrast(driven_pair(changes, 0.4, 5, tmp_path))
    assert [c.name for c in found.changes] == list(changes), str(found)
    assert sum("thinned to" in said for said in found.warnings) == 2


@pytest.mark.parametrize("changes", [(), ("inertia_scale",)], ids=["nothing", "inertia"])
def test_readings_that_were_smoothed_change_nothing(changes, tmp_path):
    """Followed as motion, the noise that is left takes what moves the rig."""
    study = driven_pair(changes, 0.4, 6, tmp_path)
    smooth = {t.name: {n: low_pass(t[n], t.dt, 20.0) for n in ("effort", "position")} for t in study.trials}
    found = fp.contrast(replace(study, trials=tuple(t.with_columns(**smooth[t.name]) for t in study.trials)))
    assert [c.name for c in found.changes] == list(changes), str(found)
    assert any("smoothed or interpolated" in said for said in found.warnings)
