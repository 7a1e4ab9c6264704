"""What is said where nothing can be fitted, where an error is no noise, and where names rest on little."""

from dataclasses import replace

import numpy as np
from diagnosis.hidden import study_of

from fes_pin.data.study import read_study
from fes_pin.diagnosis.checked import check_rig
from fes_pin.diagnosis.diagnosis import diagnose_joint, extrapolated
from fes_pin.diagnosis.likelihood_models import LikelihoodModels
from fes_pin.diagnosis.rejected import no_noise
from fes_pin.models.least_squares import least_squares
from fes_pin.models.nominal import nominal_model
from fes_pin.search.likelihood_fits import MEASUREMENT
from fes_pin.view.report import report_html


def test_a_model_that_cannot_be_simulated_stops_with_the_reason():
    study = study_of("ankle", n_motion=1, n_isometric=0, duration_s=1.0)
    diagnosis = diagnose_joint(replace(study, start={**study.start, "inertia_kgm2": 1e-9, "damping_nms": 1e2}))
    assert diagnosis.verdict == "stopped" and not diagnosis.causes
    assert "is not finite at its start values" in diagnosis.reason
    assert diagnosis.reason in str(diagnosis).splitlines()[0]
    assert diagnosis.record()["reason"] == diagnosis.reason
    assert "is not finite at its start values" in report_html(diagnosis) and diagnosis.files()


def test_a_missing_input_does_not_end_as_noise():
    """A joint whose effort was not recorded: an autoregression calls its motion noise."""
    study = study_of("joint", seed=2)
    lost = [t.with_columns(effort=np.zeros(len(t))) for t in study.trials]
    for trials, expected in ((study.trials, False), (lost, True)):
        reason = no_noise(LikelihoodModels(nominal_model(study), trials, (), False, noise=MEASUREMENT).nominal())
        assert (reason is not None and "is no measurement noise" in reason) == expected


def test_a_held_out_trial_of_another_kind_is_an_extrapolation():
    """Its error is that of a model where no trial was fitted; a motion next to fitted motions is none."""
    trials = study_of("ankle", n_motion=2, n_isometric=1, duration_s=1.0).trials
    motions, still = [t for t in trials if t.kind == "motion"], [t for t in trials if t.kind != "motion"]
    said = [f"no fitted trial is of kind isometric: errors of {still[0].name} are of an extrapolation"]
    assert (extrapolated(motions, still), extrapolated(motions[:1], motions[1:]), extrapolated(trials, [])) == (
        said,
        [],
        [],
    )


def test_a_check_says_that_a_held_out_trial_is_an_extrapolation():
    study = study_of("ankle", n_motion=2, n_isometric=1, duration_s=1.0)
    held = [replace(t, role="fit" if t.kind == "motion" else "held_out") for t in study.trials]
    limits = check_rig(replace(study, trials=tuple(held))).limits
    assert any("are of an extrapolation" in one for one in limits)


def test_the_headline_says_how_much_is_explained():
    study = study_of("joint", ("coulomb_friction",), seed=1)
    diagnosis = diagnose_joint(study)
    first, gain = str(diagnosis).splitlines()[0], diagnosis.explained
    assert first.startswith(f"{study.name}: the model lacks coulomb friction: that explains ")
    share = 100.0 * (gain.nominal - gain.extended) / (gain.nominal - min(gain.noise, gain.extended))
    assert f"{share:.0f} % of the squared error above the noise of {gain.what}" in first
    assert any("rest on 4 trials" in w for w in diagnosis.warnings)


def test_two_real_trials_end_near_the_least_error(shared):
    """The biceps' force is smooth: its noise from sample to sample is nothing, and the likelihood led elsewhere."""
    study = read_study(shared / "data/biceps_fes")
    diagnosis = diagnose_joint(replace(study, trials=study.trials[:2]))
    assert diagnosis.nominal_error[0] < 20.0
    assert diagnosis.verdict == "unexplained"


def test_least_squares_of_huge_columns():
    """Their squares leave the floating-point numbers, and the singular value decomposition would not converge."""
    rng = np.random.default_rng(0)
    columns, x = rng.standard_normal((50, 3)), np.array([1.0, -2.0, 3.0])
    for size in (1.0, 1e200, 1e-200):
        assert np.allclose(least_squares(columns * size, columns @ x) * size, x)
    columns[0, 1] = np.inf
    found = least_squares(columns, columns[:, [0, 2]] @ x[[0, 2]])
    assert np.allclose(found, [1.0, 0.0, 3.0])
    assert not least_squares(columns, np.full(50, np.nan)).any()
