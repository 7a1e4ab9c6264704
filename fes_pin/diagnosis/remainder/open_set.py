"""Tests of the residuals of a free simulation, for deviations that are no function of state and input.

They find bursts at irregular times, spectral lines, torque that is periodic in the angle over short distances,
deviations at the same time of every trial, deviations that grow with the stimulus, readings that slip once within a
trial, and readings that lag where the motion reverses. An autoregressive noise model takes each of them for noise.
"""

import numpy as np

from fes_pin.diagnosis.remainder.bursts import burst_p_value
from fes_pin.diagnosis.remainder.detents import detent_p_value
from fes_pin.diagnosis.remainder.heteroscedastic import heteroscedastic_p_value
from fes_pin.diagnosis.remainder.innovations import channels, driven
from fes_pin.diagnosis.remainder.lines import LONGEST_NOISE, line_p_value
from fes_pin.diagnosis.remainder.play import play_p_value
from fes_pin.diagnosis.remainder.repeated import repeated_p_value
from fes_pin.diagnosis.remainder.slips import slip_p_value
from fes_pin.identify.fit import Fit, under_own_noise
from fes_pin.infer.levels import FULL_NOISE, SHORT_NOISE
from fes_pin.infer.projection import Projection


def residual_tests(fitted: Fit, seed: int) -> list[tuple[float, str]]:
    """Return the p-value of each test of residuals, and the variable on which its deviation depends."""
    own = under_own_noise(fitted)
    full = under_own_noise(fitted, FULL_NOISE, FULL_NOISE)
    projection = Projection(full.parts)
    short = channels(under_own_noise(fitted, SHORT_NOISE))
    count = len(short)
    bursts = min(burst_p_value([e.values for e in pieces], pieces[0].noise, pieces[0].dt) for pieces in short)
    line, where = min(line_p_value(pieces) for pieces in channels(under_own_noise(fitted, LONGEST_NOISE)))
    detents = detent_p_value(own, Projection(own.parts))
    repeated = min(repeated_p_value([e.values for e in pieces], pieces[0].dt) for pieces in short)
    heteroscedastic = min(
        heteroscedastic_p_value([e.values for e in pieces], [np.abs(driven(e)) for e in pieces], pieces[0].dt)
        for pieces in short
    )
    return [
        (count * bursts, "time"),
        (count * line, where),
        (detents, "angle"),
        (count * repeated, "time"),
        (count * heteroscedastic, "stimulus"),
        (slip_p_value(full, projection, seed), "time"),
        (play_p_value(full, projection), "rate"),
    ]
