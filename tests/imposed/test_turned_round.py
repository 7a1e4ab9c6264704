"""A torque sensor that was turned round: no small step leads there from the sign that is believed."""

from dataclasses import replace

import numpy as np
import pytest
from driven_rigs.draw import draw
from imposed_rigs import joint

from fes_pin.data.study import read_study
from fes_pin.diagnosis.diagnosis import diagnose_joint


def turned(study):
    return replace(study, trials=tuple(t.with_columns(effort=-t["effort"]) for t in study.trials))


@pytest.mark.long
def test_on_an_imposed_motion(tmp_path):
    found = diagnose_joint(turned(joint.study((), 0.0, np.random.default_rng(21), tmp_path)))
    (cause,) = found.causes
    assert (cause.name, cause.equivalents) == ("effort_gain", ())
    assert cause.parameters["error"].value == pytest.approx(-2.0, abs=0.02)


@pytest.mark.long
def test_on_a_rig_that_a_controller_drives(tmp_path):
    drawn = draw((), 0.3, 22, tmp_path)
    found = diagnose_joint(turned(read_study(drawn.study)))
    assert "effort_gain" in (found.causes[0].name, *found.causes[0].equivalents)
    values = found.extended.values  # of a rig without gravity only the gain over the inertia shows
    gain = (1.0 + values["effort_gain.error"]) / values["inertia_scale"]
    assert gain == pytest.approx(-1.0 / drawn.truth["inertia_scale"], rel=0.02)
