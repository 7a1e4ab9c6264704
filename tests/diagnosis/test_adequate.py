"""Where nothing is hidden nothing is named, however wrong the start values are."""

from dataclasses import replace

import pytest
from diagnosis.hidden import diagnosed, shortened, slide, study_of

from fes_pin.data.errors import InputError
from fes_pin.diagnosis.diagnosis import diagnose_joint

NULLS = [
    ("ankle", "white"),
    ("ankle", "process"),
    ("joint", "white"),
    ("joint", "process"),
    ("muscle", "white"),
]


def check_adequate(diagnosis):
    assert diagnosis.verdict == "adequate", str(diagnosis)
    assert diagnosis.causes == () and diagnosis.next_experiment is None
    assert diagnosis.model.effects == ()
    assert not diagnosis.remainder.unexplained


@pytest.mark.parametrize(("rig", "noise"), NULLS)
def test_nothing_hidden(rig, noise):
    check_adequate(diagnosed(rig, (), noise, NULLS.index((rig, noise))))


@pytest.mark.parametrize("driven", [True, False])
def test_a_slide(driven):
    diagnosis = diagnose_joint(slide(1, {}, driven))
    check_adequate(diagnosis)
    assert "sensor_offset" in diagnosis.absorbed  # gravity is the same everywhere


@pytest.mark.parametrize(("rig", "sign"), [("ankle", 1.0), ("joint", -1.0), ("muscle", 1.0)])
def test_base_parameters_forty_percent_off(rig, sign):
    study = study_of(rig, seed=20, wrong_start=False)
    wrong = {n: v * (1.0 + 0.4 * sign * (-1) ** k) for k, (n, v) in enumerate(study.start.items())}
    diagnosis = diagnose_joint(replace(study, start=wrong))
    check_adequate(diagnosis)
    for name, true in study.start.items():
        assert abs(diagnosis.nominal.values[name] - true) < 5.0 * diagnosis.nominal.std(name)


def test_a_study_that_holds_out_everything():
    study = study_of("muscle")
    with pytest.raises(InputError, match="at least one trial to fit"):
        diagnose_joint(replace(study, trials=tuple(replace(t, role="held_out") for t in study.trials)))


def test_isometric_trials_alone_do_not_test_the_joint():
    diagnosis = diagnose_joint(shortened(study_of("ankle", seed=22), {"isometric"}))
    check_adequate(diagnosis)
    assert {"coulomb_friction", "load_error", "frame_vibration", "force_length"} <= set(diagnosis.absorbed)
    assert "threshold_drift" not in diagnosis.absorbed
