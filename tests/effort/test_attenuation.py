"""Noise of a reading shrinks the inertia of a regression. The band keeps that far within the intervals."""

from dataclasses import replace

import numpy as np
import pytest
from driven_rigs.laboratory import draw_laboratory
from driven_rigs.swing_up import draw_swing_up

import fes_pin as fp
from fes_pin.effort.fits import EffortSets
from fes_pin.effort.motion import Record, noise_of_bend
from fes_pin.effort.problem import Rows
from fes_pin.effort.search import attenuation, searched
from fes_pin.models.nominal import nominal_model

DRAWN = [
    (draw_laboratory, "effort_offset"),
    (draw_laboratory, "quadratic_damping"),
    (draw_swing_up, "coulomb_friction"),
]
SHARE, DRAWS = 0.02, 8
"""Noise that is added, as a share of the variance of the acceleration, seven times what a band admits."""


@pytest.mark.parametrize(("draw", "hidden"), DRAWN)
def test_instruments_would_return_less_than_a_third_of_an_interval(draw, hidden, tmp_path):
    study = fp.read_study(draw((hidden,), 20400100, tmp_path).study)
    found = searched(nominal_model(study).rig, study.trials)
    best = found.final(found.state.found.best)
    taken = attenuation(best, found.models.rows)
    assert abs(taken[best.place("inertia_scale")]) < 0.005 * best.values["inertia_scale"]
    inner = [n for n in best.free if n not in best.at_bound]
    assert all(abs(taken[best.place(n)]) < best.reach(n) / 3.0 for n in inner)


def test_noise_takes_as_much_of_the_inertia_as_is_predicted(tmp_path):
    study = fp.read_study(draw_laboratory((), 20400106, tmp_path).study)
    found = searched(nominal_model(study).rig, study.trials)
    sets, rng, moved = found.models, np.random.default_rng(0), []
    band, quiet = sets.rows.band, sets.final(sets.fits[()]).values["inertia_scale"]
    bend = np.mean(np.concatenate([t.moved(2) for t in sets.rows.tracks]) ** 2)
    power = SHARE * bend / noise_of_bend(replace(band, noise=1.0))
    for _ in range(DRAWS):
        tracks = [Record.of(t) for t in study.trials]
        added = [np.sqrt(0.5 * power / r.dt) * rng.standard_normal(len(r.time)) for r in tracks]
        noisy = [replace(r, reading=r.reading + n) for r, n in zip(tracks, added, strict=True)]
        again = EffortSets(Rows(noisy, replace(band, noise=power), sets.rows.links), sets.values, [*sets.base])
        fitted = again.final(again.fit((), {}, {}))
        taken = attenuation(fitted, again.rows)[fitted.place("inertia_scale")]
        moved.append((quiet - fitted.values["inertia_scale"], taken))
    fell, predicted = np.mean(moved, axis=0)
    assert predicted > 0.01 and fell == pytest.approx(predicted, rel=0.25)
