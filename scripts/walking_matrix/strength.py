"""How clearly a hidden cause shows in a walk."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from walks.synthetic import Gait, Wrong, make

from fes_pin.data.study import Study, read_study
from fes_pin.walk.designs import Designs
from fes_pin.walk.models import WalkModels
from fes_pin.walk.recording import recordings_of
from fes_pin.walk.white_noise import white_noise


def strength(gait: Gait, wrong: Wrong, seed: int, study: Study) -> float:
    """Twice the expected log-likelihood ratio of the truth against nothing.

    What the cause changes in the mean stride is the difference of two walks of the same errors, with and without it; it
    is weighed by the noise and the nuisance of the walk without it. Of marker noise the deviance that it saves.
    """
    designs = _designs(study)
    if wrong.cause == "marker_noise":
        return float((white_noise(designs) or (0.0, 0.0, 0.0))[2])
    with tempfile.TemporaryDirectory() as folder:
        make(gait, Path(folder), replace(wrong, cause="none"), seed)
        twin = _designs(read_study(folder))
    waves = min(len(twin.strides.harmonics), len(designs.strides.harmonics))
    y = [b.as_read.y[:, :, :waves] for b in (designs, twin)]
    noise, variance = twin.noise, WalkModels(twin).nominal().fitted.variance[:, :, :waves]
    means = twin.strides.harmonics[:waves] == 0
    change = np.where(means, y[0] - y[1], np.einsum("ij,njk->nik", noise.turn, y[0] - y[1])).ravel()
    nuisance = noise.nuisance[:, :, :waves].reshape(change.size, -1)
    covariance = np.diag(variance.ravel()) + nuisance @ nuisance.T
    return float(change @ np.linalg.solve(covariance, change))


def _designs(study: Study) -> Designs:
    return Designs(recordings_of(study))
