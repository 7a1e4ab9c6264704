"""Joint scores of two causes: those of a regression on both, and the pair that a search by single causes passes by."""

from itertools import combinations

import numpy as np
import pytest
from driven_rigs.swing_up import draw_swing_up

from fes_pin.data.study import read_study
from fes_pin.effort.pairs import joint_scores
from fes_pin.effort.search import searched
from fes_pin.models.nominal import nominal_model

OPPOSED = (67120048, 67120128)
"""Swing-ups with friction and an offset of its size, in which a spring or a periodic torque alone explains more than
either: two of `scripts/accuracy swing-up --hidden 2 --seed 67120000 --effort`."""


def test_a_joint_score_is_the_gain_of_a_regression_on_both():
    rng = np.random.default_rng(0)
    residual, blocks = rng.standard_normal(200), [rng.standard_normal((200, k)) for k in (1, 2, 1)]
    found = {(p.one, p.other): p for p in joint_scores(residual, blocks, [float(np.sum(b**2)) for b in blocks])}
    assert set(found) == set(combinations(range(3), 2))
    for (i, j), pair in found.items():
        both = np.hstack([blocks[i], blocks[j]])
        sizes, (left,), *_ = np.linalg.lstsq(both, residual)
        assert np.concatenate(pair.sizes) == pytest.approx(sizes)
        assert pair.gain == pytest.approx(residual @ residual - left)


def test_confounded_causes_have_no_joint_score():
    rng = np.random.default_rng(1)
    residual, one, other = rng.standard_normal((3, 50))
    blocks = [one[:, None], 2.0 * one[:, None], other[:, None], np.zeros((50, 1))]
    found = joint_scores(residual, blocks, [50.0] * 4)
    assert [(p.one, p.other) for p in found] == [(0, 2), (1, 2)]


def test_what_neither_explains_both_explain():
    rng = np.random.default_rng(2)
    one, wrong, small = rng.standard_normal((3, 400))
    other = -0.98 * one + 0.2 * small
    residual = one + other
    blocks = [x[:, None] for x in (one, other, 0.3 * small + wrong)]
    best = max(joint_scores(residual, blocks, [float(np.sum(b**2)) for b in blocks]), key=lambda p: p.gain)
    assert (best.one, best.other) == (0, 1)
    assert np.concatenate(best.sizes) == pytest.approx([1.0, 1.0])


@pytest.mark.parametrize("seed", OPPOSED)
def test_friction_and_an_offset_that_oppose_each_other_are_found_together(seed, tmp_path):
    drawn = draw_swing_up(("coulomb_friction", "effort_offset"), seed, tmp_path)
    study = read_study(drawn.study)
    found = searched(nominal_model(study).rig, study.trials)
    assert found.names == ("coulomb_friction", "effort_offset")
    offset = found.final(found.state.found.best).values["effort_offset.offset"]
    assert offset == pytest.approx(drawn.truth["effort_offset"], rel=0.2)
