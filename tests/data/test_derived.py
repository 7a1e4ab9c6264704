"""A velocity that was computed from positions is no reading of its own; a tachometer's is."""

import numpy as np
import pytest
from scipy.ndimage import uniform_filter1d
from scipy.signal import butter, lfilter

from fes_pin.data.derived import own_share, without_derived
from fes_pin.data.smooth import low_pass
from fes_pin.data.trial import Trial

DT, N = 2e-3, 3000
TIME = DT * np.arange(N)


def read(seed, count=0.0):
    """Position with noise, counted by an encoder or not, and the true velocity."""
    rng = np.random.default_rng(seed)
    position = np.sin(3.0 * TIME) + 0.3 * np.sin(11.0 * TIME) + 5e-4 * rng.normal(size=N)
    if count:
        position = count * np.round(position / count)
    return position, 3.0 * np.cos(3.0 * TIME) + 3.3 * np.cos(11.0 * TIME), rng


COMPUTED = {
    "differences": lambda q: np.gradient(q, DT),
    "backward": lambda q: np.diff(q, prepend=q[0]) / DT,
    "averaged": lambda q: uniform_filter1d(np.gradient(q, DT), 9),
    "low-passed": lambda q: low_pass(np.gradient(q, DT), DT, 20.0),
    "filtered as it came": lambda q: lfilter(*butter(1, 20.0, fs=1.0 / DT), np.gradient(q, DT)),
    "of second order": lambda q: lfilter(*butter(2, 15.0, fs=1.0 / DT), np.gradient(q, DT)),
}


@pytest.mark.parametrize("count", [0.0, 1e-3], ids=["noise", "counts"])
@pytest.mark.parametrize("made", COMPUTED.values(), ids=COMPUTED)
def test_what_positions_say_is_no_reading(made, count):
    position, _, _ = read(0, count)
    assert own_share(position, made(position)) < 0.1


@pytest.mark.parametrize("noise", [1e-3, 1e-2, 0.1])
def test_a_sensor_of_its_own_is_one(noise):
    position, velocity, rng = read(1)
    assert own_share(position, velocity + noise * rng.normal(size=N)) > 0.8


def test_it_is_left_out_and_said():
    position, velocity, rng = read(2)
    computed = Trial("a", "motion", {"position": position, "velocity": np.gradient(position, DT)}, TIME)
    read_too = Trial("a", "motion", {"position": position, "velocity": velocity + 0.01 * rng.normal(size=N)}, TIME)
    (left,), (said,) = without_derived([computed], "position", "velocity")
    assert "velocity" not in left
    assert "velocity was computed from position" in said
    assert without_derived([read_too], "position", "velocity") == ([read_too], [])


def test_a_short_trial_says_nothing():
    position, velocity, _ = read(3)
    assert own_share(position[:100], velocity[:100]) is None
