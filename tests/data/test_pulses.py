"""A trial as a list of pulses within stated limits; beyond them it is refused."""

import numpy as np
import pytest

from fes_pin.data.errors import InputError
from fes_pin.data.pulses import PulseLimits, pulse_list
from fes_pin.data.trial import Trial

TIME = np.arange(1000) * 0.002
WIDTHS = Trial("a", "isometric", {"pulse_width_us": np.where(TIME < 1.0, 0.0, 200.0 + 100.0 * TIME)}, TIME)
PULSES = Trial("b", "isometric", {"stim": (np.arange(1000) % 25 == 3).astype(float)}, TIME)
LIMITS = PulseLimits(width_us=450.0, rate_hz=40.0, charge_uc=18.0, current_ma=40.0)


def test_widths_are_taken_at_the_time_of_each_pulse():
    listed = pulse_list(WIDTHS, LIMITS, rate_hz=25.0)
    assert np.allclose(listed["time_s"], np.arange(25, 50) / 25.0)
    assert np.allclose(listed["pulse_width_us"], 200.0 + 100.0 * listed["time_s"], atol=0.2)
    assert np.allclose(listed["charge_uc"], 0.04 * listed["pulse_width_us"])


def test_pulses_keep_their_times():
    listed = pulse_list(PULSES, LIMITS, width_us=300.0)
    assert np.allclose(listed["time_s"], TIME[PULSES["stim"] > 0])
    assert set(listed["pulse_width_us"]) == {300.0}


@pytest.mark.parametrize(
    ("trial", "limits", "how", "words"),
    [
        (
            WIDTHS,
            {"width_us": 350.0},
            {"rate_hz": 25.0},
            r"wider than 350 us at 1.52 s, and 11 more; nothing is written",
        ),
        (WIDTHS, {"rate_hz": 20.0}, {"rate_hz": 25.0}, "closer than at 20 Hz at 1.04 s"),
        (WIDTHS, {"charge_uc": 14.0}, {"rate_hz": 25.0}, "more than 14 uC at 1.52 s"),
        (WIDTHS, {}, {}, "expected the rate"),
        (PULSES, {}, {}, "expected the width"),
        (PULSES, {"rate_hz": 19.0}, {"width_us": 300.0}, "closer than at 19 Hz"),
        (PULSES, {"current_ma": 0.0}, {"width_us": 300.0}, "limits.current_ma: expected 0.2 to 200 mA, found 0"),
        (WIDTHS, {"current_ma": 0.04}, {"rate_hz": 25.0}, "limits.current_ma: expected 0.2 to 200 mA, found 0.04"),
        (WIDTHS, {}, {"rate_hz": 25.0, "width_us": 300.0}, "width_us: goes only with a trial of single pulses"),
        (PULSES, {}, {"rate_hz": 25.0, "width_us": 300.0}, "rate_hz: goes only with a trial of pulse widths"),
        (PULSES.without("stim"), {}, {"width_us": 300.0}, "expected a column"),
    ],
)
def test_beyond_a_limit_it_is_refused(trial, limits, how, words):
    with pytest.raises(InputError, match=words):
        pulse_list(trial, PulseLimits(**{**vars(LIMITS), **limits}), **how)
