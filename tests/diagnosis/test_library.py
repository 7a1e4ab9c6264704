"""The linear screen of pairs finds what trying every pair does."""

import itertools

import numpy as np

from fes_pin.diagnosis.search.library import Probe
from fes_pin.diagnosis.search.score import Scored, Scores, best_pairs
from fes_pin.models.effects import effects_for


def scores_of(seed):
    rng = np.random.default_rng(seed)
    probes = [Probe(e.absent(), np.zeros((0, len(e.amplitudes())))) for e in effects_for("ankle") for _ in range(2)]
    widths = [len(p.effect.amplitudes()) for p in probes]
    ends = np.cumsum([0, *widths])
    columns, residual = rng.normal(size=(200, ends[-1])), rng.normal(size=200)
    blocks = [slice(a, b) for a, b in itertools.pairwise(ends)]
    return Scores([Scored(p, 0.0, {}, 1.0) for p in probes], columns.T @ columns, columns.T @ residual, blocks)


def joint_gain(scores, i, j):
    """Of two probes inside their bounds, or nothing."""
    rows = np.r_[scores.blocks[i], scores.blocks[j]]
    x = np.linalg.solve(scores.gram[np.ix_(rows, rows)], scores.along[rows])
    effects = [scores.scored[k].probe.effect for k in (i, j)]
    info = [e.parameters()[n] for e in effects for n in e.amplitudes()]
    if any(not f.lower <= f.null + v <= f.upper for f, v in zip(info, x, strict=True)):
        return None
    return float(scores.along[rows] @ x)


def test_best_pairs_are_those_of_an_exhaustive_search():
    scores, best = scores_of(1), {}
    for i, j in itertools.combinations(range(len(scores.scored)), 2):
        names = tuple(sorted(scores.scored[k].probe.name for k in (i, j)))
        gain = joint_gain(scores, i, j)
        if names[0] != names[1] and gain is not None:
            best[names] = max(gain, best.get(names, 0.0))
    expected = sorted(best, key=lambda n: -best[n])[:6]
    found = [tuple(sorted((a.probe.name, b.probe.name))) for a, b in best_pairs(scores, 6)]
    assert found == expected
