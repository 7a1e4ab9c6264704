"""When within its row a reading was taken: what no log says, and intervals hold."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from driven_rigs.draw import Base, draw, urdf

from fes_pin.data.study import Study, read_study
from fes_pin.data.trial import Trial
from fes_pin.identify.effort_timing import with_timing_of_readings
from fes_pin.infer.scatter import with_honest_intervals
from fes_pin.models.nominal import nominal_model
from fes_pin.search.likelihood_fits import LikelihoodFits

MASS, DAMPING = 12.0, 30.0
DT = 0.004
AGE = 0.125
"""Of a row: how old a reading is when the effort that answers it begins to act."""


def held_slide(seed: int) -> Trial:
    """A slide that a controller moves, solved exactly; a log writes each reading down beside its answer."""
    rng = np.random.default_rng([4050000, seed])
    wanted = 0.2 * np.sin(2.0 * np.pi * np.cumsum(np.linspace(0.2, 2.0, 2500)) * DT)
    q = v = push = before = asked = 0.0
    effort, position = np.empty_like(wanted), np.empty_like(wanted)
    for k, w in enumerate(wanted):
        position[k] = q + 5e-5 * rng.standard_normal()
        effort[k] = 2000.0 * (w - position[k]) - 60.0 * (position[k] - before) / DT
        before = position[k]
        push = 0.96 * push + 0.3 * rng.standard_normal()
        for u, share in ((asked, AGE), (effort[k], 1.0 - AGE)):
            held, kept = (u + push) / DAMPING, np.exp(-DAMPING / MASS * share * DT)
            q, v = q + held * share * DT + (v - held) * (1.0 - kept) * MASS / DAMPING, held + (v - held) * kept
        asked = effort[k]
    return Trial("00", "motion", {"effort": effort, "position": position}, np.arange(len(wanted)) * DT)


def fitted_slide(seed: int, folder: Path):
    rig = folder / "rig.urdf"
    rig.write_text(urdf(Base("slide", MASS, DAMPING, 0.0, 0.25, 15.0)))
    start = {"inertia_scale": 0.8, "damping": 1.5 * DAMPING}
    study = Study("slide", "joint", {"gravity_scale": 0.0}, start, (held_slide(seed),), folder, {"urdf": rig})
    return LikelihoodFits(nominal_model(study), study.trials, []).nominal()


def test_intervals_hold_the_truth_where_an_effort_acts_after_its_row_has_begun(tmp_path):
    """An eighth of a row, which no log says, moves mass and damping by several deviations."""
    fits = [fitted_slide(seed, tmp_path) for seed in range(6)]
    truth = {"inertia_scale": 1.0, "damping": DAMPING}
    plain, timed = (
        [[(f.values[n] - truth[n]) / f.std(n) for n in truth] for f in some]
        for some in ([with_honest_intervals(f) for f in fits], [with_timing_of_readings(f, DT) for f in fits])
    )
    assert np.sqrt(np.mean(np.square(plain), axis=0)).max() > 2.5, plain
    assert np.sqrt(np.mean(np.square(timed), axis=0)).max() < 1.5, timed
    assert np.abs(timed).max() < 3.0, timed


def test_where_time_is_known_nothing_is_doubted(tmp_path):
    study = read_study(draw((), 0.3, 1151005, tmp_path).study)
    fitted = LikelihoodFits(nominal_model(study), study.trials, []).nominal()
    plain, timed, sure = (
        with_honest_intervals(fitted),
        with_timing_of_readings(fitted, study.trials[0].dt),
        with_timing_of_readings(fitted, 1e-9),
    )
    ratios = {n: timed.std(n) / plain.std(n) for n in fitted.free}
    assert min(ratios.values()) > 0.999 and max(ratios.values()) > 1.1, ratios
    assert all(sure.std(n) == pytest.approx(plain.std(n), rel=1e-3) for n in fitted.free)


def test_what_intervals_hold_beside_is_kept(tmp_path):
    """As by how much trials differ, or two estimates: it was lost, and with it what folds had told."""
    fitted = fitted_slide(0, tmp_path)
    honest = with_honest_intervals(fitted)
    wider = replace(honest, covariance=honest.covariance * np.outer(*[[4.0, 1.0]] * 2))
    plain, wide = with_timing_of_readings(honest, DT), with_timing_of_readings(wider, DT)
    first, second = (wide.std(n) ** 2 - plain.std(n) ** 2 for n in fitted.free)
    assert first == pytest.approx(15.0 * honest.std(fitted.free[0]) ** 2, rel=1e-6)
    assert second == pytest.approx(0.0, abs=1e-9 * plain.std(fitted.free[1]) ** 2)
    assert np.allclose(with_timing_of_readings(fitted, DT).covariance, plain.covariance)
    untold = replace(fitted, parts=tuple(replace(p, jacobian=p.jacobian * (1.0, 0.0)) for p in fitted.parts))
    assert np.isinf(with_honest_intervals(untold).std(fitted.free[1]))
    assert np.isfinite(with_timing_of_readings(with_honest_intervals(untold), DT).covariance).all()
