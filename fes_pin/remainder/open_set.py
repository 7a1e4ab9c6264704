"""Tests of the residuals of a free simulation, for deviations that are no function of state and input.

They find bursts at irregular times, spectral lines, torque that is periodic in the angle over short distances,
deviations at the same time of every trial, deviations that grow with the stimulus, readings that slip once within a
trial, and readings that lag where the motion reverses. An autoregressive noise model takes each of them for noise.
"""

import numpy as np

from fes_pin.identify.fit import Fit, under_own_noise
from fes_pin.infer.levels import FULL_NOISE, SHORT_NOISE
from fes_pin.infer.projection import Projection
from fes_pin.remainder.bursts import burst_p_value
from fes_pin.remainder.detents import detent_p_value
from fes_pin.remainder.heteroscedastic import heteroscedastic_p_value
from fes_pin.remainder.innovations import channels, driven
from fes_pin.remainder.lines import LONGEST_NOISE, line_p_value
from fes_pin.remainder.play import play_p_value
from fes_pin.remainder.repeated import repeated_p_value
from fes_pin.remainder.slips import slip_p_value


def residual_tests(fitted: Fit) -> list[tuple[float, str]]:
    """Return the p-value of each test of residuals, and the variable on which its deviation depends."""
    full, short = under_own_noise(fitted, FULL_NOISE, FULL_NOISE), channels(under_own_noise(fitted, SHORT_NOISE))
    projection, found = Projection(full.parts), []
    for pieces in short:
        values, dt = [e.values for e in pieces], pieces[0].dt
        found += [
            (burst_p_value(values, pieces[0].noise, dt), "time"),
            (repeated_p_value(values, dt), "time"),
            (heteroscedastic_p_value(values, [np.abs(driven(e)) for e in pieces], dt), "stimulus"),
        ]
    found += [line_p_value(pieces) for pieces in channels(under_own_noise(fitted, LONGEST_NOISE))]
    tests = ((detent_p_value, "angle"), (slip_p_value, "time"), (play_p_value, "rate"))
    return [*found, *((test(full, projection), where) for test, where in tests)]
