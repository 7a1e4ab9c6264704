"""Trials of small rigs with known parameters, and least squares by scipy on the whole system of unknowns."""

from dataclasses import fields

import numpy as np
from models.cases import RIGS, trial
from scipy.optimize import least_squares

from fes_pin.identify.fit import Fit
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.infer.noise import Noise
from fes_pin.models.model import Model
from fes_pin.models.predictor import StateSpaceNoise
from fes_pin.models.simulate import simulated_trial

SIZE = {"angle_rad": 2e-3, "force_n": 0.2, "position": 2e-3, "velocity": 2e-2}
WHITE = {name: Noise(size, (), size) for name, size in SIZE.items()}


def measured(model, bare, rng, noise=True, velocity=False):
    """A bare trial with the model's answer and white noise on it."""
    simulated = simulated_trial(model, bare)
    names = [n for n in model.rig.outputs(bare.kind) if velocity or n != "velocity"]
    return bare.with_columns(
        **{n: simulated[n] + (SIZE[n] * rng.standard_normal(len(bare)) if noise else 0.0) for n in names}
    )


def trials_of(rig, rng, count=3, n=400, velocity=False, **values):
    """The rig's model with some true values, and trials of it."""
    model = Model(RIGS[rig]).with_parameters(values)
    kinds = {"ankle": ("motion", "motion", "isometric"), "joint": ("motion",), "muscle": ("isometric",)}[rig]
    bare = [trial(rig, kinds[k % len(kinds)], rng, n) for k in range(count)]
    return model, [measured(model, b, rng, velocity=velocity) for b in bare]


def off(model, factor=1.2):
    """The same model with wrong values of what is fitted."""
    return model.with_parameters({n: factor * model.parameters()[n] for n in model.fitted_parameters()})


def by_scipy(problem, start):
    """Every parameter and every trial's unknowns at once: values, covariance of the parameters, sum of squares."""
    names, size = problem.free, len(problem.free)
    unknown = problem.unknown_names
    first = problem.start_unknowns()
    values = {**start}

    def residual(x):
        here = values | dict(zip(names, x[:size], strict=True))
        own = x[size:].reshape(len(problem.trials), len(unknown))
        unknowns = [dict(zip(unknown, row, strict=True)) for row in own]
        return np.concatenate([p.residual for p in problem.linearize(here, unknowns)])

    x0 = np.array([start[n] for n in names] + [u[n] for u in first for n in unknown])
    limits = [problem.limits[n] for n in names] + [(-np.inf, np.inf)] * (len(x0) - size)
    lower, upper = np.array(limits).T
    found = least_squares(residual, x0, "3-point", (lower, upper), x_scale="jac", xtol=1e-13, ftol=1e-13, gtol=1e-13)
    inside = found.active_mask == 0
    covariance = np.zeros((len(x0), len(x0)))
    jacobian = found.jac[:, inside]
    covariance[np.ix_(inside, inside)] = np.linalg.inv(jacobian.T @ jacobian)
    return found.x[:size], covariance[:size, :size], 2.0 * found.cost


def as_likely(fitted, noise=None):
    """A fit as if the likelihood had judged it, with such noise; by default with the white noise that it has."""
    noise = noise or StateSpaceNoise({n: one.std for n, one in fitted.noise.items()})
    return LikelihoodFit(**{f.name: getattr(fitted, f.name) for f in fields(Fit)} | {"noise": noise})
