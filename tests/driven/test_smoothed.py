"""Rigs that a controller drives, low-passed before they were stored: noise that lasts is neither motion nor a cause."""

import pytest
from driven_rigs.draw import draw

from fes_pin.data.study import read_study
from fes_pin.diagnosis.diagnosis import diagnose_joint


@pytest.mark.parametrize("cutoff_hz", [40.0, 15.0])
def test_nothing_hidden_is_adequate(cutoff_hz, tmp_path):
    drawn = draw((), 0.3, 11, tmp_path, recorded=True, cutoff_hz=cutoff_hz)
    found = diagnose_joint(read_study(drawn.study))
    assert found.verdict == "adequate"
    for name in ("inertia_scale", "damping"):
        assert abs(found.extended.values[name] - drawn.truth[name]) < 4.0 * found.extended.std(name)
    assert "one sample in" in " ".join(found.warnings)


def test_dry_friction_is_named_alone(tmp_path):
    drawn = draw(("coulomb_friction",), 0.3, 13, tmp_path, cutoff_hz=40.0)
    found = diagnose_joint(read_study(drawn.study))
    (cause,) = found.causes
    assert (cause.name, cause.equivalents) == ("coulomb_friction", ())
    assert cause.parameters["torque_nm"].value == pytest.approx(drawn.truth["coulomb_friction"], rel=0.15)
