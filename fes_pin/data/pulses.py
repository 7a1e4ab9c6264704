"""A proposed trial as a list of pulses that a stimulator can be given, within the limits that somebody states."""

import math
from dataclasses import dataclass

import numpy as np

from fes_pin.data.checks import LONGEST_PULSE_US
from fes_pin.data.errors import InputError
from fes_pin.data.numbers import as_number, number, shortened
from fes_pin.data.trial import Trial

MOST = {"width_us": LONGEST_PULSE_US, "rate_hz": 1e4, "charge_uc": 1e4}
"""What no stimulator of nerves or muscles comes near: a limit beyond it is a slip of units."""
RANGES = {
    "pulse_width_us": (10.0, 5000.0, "us"),
    "rate_us_per_s": (20.0, 20_000.0, "us/s"),
    "charge_uc_per_s": (5.0, 5000.0, "uC/s"),
    "current_ma": (0.2, 200.0, "mA"),
}
"""Limits that a stimulator of nerves can have. No range spans more than a factor of 1000, so that a limit in A, C, s or
ms in place of mA, uC and us lies outside of it. At the skin FES uses 1 to 150 mA and up to 500 us (Valtin and others,
Eur. J. Transl. Myol. 26:6076, 2016); a stimulator for research gives 10 us and more (Hasomed RehaMove3 Science),
section II of Dombre, Fournier and Coiffet uses 1000 us. Electrodes at the nerve need a hundredth of that current. The
charge is the product of both, 45 times a second; a width that changes by 20 000 us/s crosses the paper's muscle in two
pulses."""


def in_range(value: object, kind: str, name: str) -> float:
    """A limit of a stimulator, within `RANGES`.

    Raises
    ------
    InputError
        Anything else.
    """
    low, high, unit = RANGES[kind]
    found = as_number(value)
    if found is None or math.isnan(found) or not low <= found <= high:
        number(value, name, infinite=True)
        raise InputError(f"expected {low:g} to {high:g} {unit}, found {shortened(value)}", column=name)
    return found


@dataclass(frozen=True)
class PulseLimits:
    """What no pulse of a list may exceed; all of it must be said.

    Parameters
    ----------
    width_us
        The widest pulse, us.
    rate_hz
        The highest rate: no two pulses come closer than one over it.
    charge_uc
        Charge of one pulse, uC: width times current.
    current_ma
        Amplitude of the pulses, mA.

    Raises
    ------
    InputError
        For a number that no stimulator has: too small a current, in A, would let any width pass the limit of charge.
    """

    width_us: float
    rate_hz: float
    charge_uc: float
    current_ma: float

    def __post_init__(self) -> None:
        for name, most in MOST.items():
            if not 0.0 < getattr(self, name) <= most:
                words = f"expected a number above 0 and at most {most:g}, found {getattr(self, name):g}"
                raise InputError(words, column=f"limits.{name}")
        in_range(self.current_ma, "current_ma", "limits.current_ma")


def pulse_list(
    trial: Trial, limits: PulseLimits, rate_hz: float | None = None, width_us: float | None = None
) -> dict[str, np.ndarray]:
    """The pulses of a trial.

    A trial beyond a limit is an error and is not clipped: a clipped trial is another experiment, and separates less.

    Parameters
    ----------
    trial
        With `pulse_width_us`, of which pulses of `rate_hz` take the width at their time; or with `stim`, whose pulses
        all have `width_us`.

    Returns
    -------
    dict of ndarray, shape (pulses,)
        `time_s` from the trial's first sample, `pulse_width_us`, `current_ma`, `charge_uc`.

    Raises
    ------
    InputError
        No such column; a rate or width that is not said, or that the trial says; a pulse beyond a limit, with its time.
    """
    if odd := [n for n in ("amplitude_ma", "charge_uc", "frequency_hz", "emg", "emg_envelope") if n in trial]:
        words = (
            "expected a trial of pulse widths or of single pulses: pulses of other amplitudes and rates are not listed"
        )
        raise InputError(words, column=odd[0])
    if "pulse_width_us" in trial:
        if rate_hz is None or not 0.0 < rate_hz <= MOST["rate_hz"]:
            words = f"expected the rate of the pulses, whose widths the trial says, at most {MOST['rate_hz']:g} Hz"
            raise InputError(words, column="rate_hz")
        if width_us is not None:
            raise InputError("goes only with a trial of single pulses; this one says their widths", column="width_us")
        count = int(np.floor((trial.duration + trial.dt) * rate_hz * (1 - 1e-9))) + 1
        time = np.arange(count) / rate_hz
        samples = np.minimum((time / trial.dt + 1e-6).astype(int), len(trial) - 1)
        width = trial["pulse_width_us"][samples]
        time, width = time[width > 0.0], width[width > 0.0]
    elif "stim" in trial:
        if width_us is None or not 0.0 < width_us < np.inf:
            raise InputError("expected the width of the pulses, whose times the trial says", column="width_us")
        if rate_hz is not None:
            raise InputError("goes only with a trial of pulse widths; this one says when pulses come", column="rate_hz")
        time = trial.time[trial["stim"] > 0.5] - trial.time[0]
        width = np.full(len(time), width_us)
    else:
        raise InputError("expected a column pulse_width_us or stim", column=trial.name)
    charge = 1e-3 * width * limits.current_ma
    _refuse(time, width > limits.width_us, f"a pulse is wider than {limits.width_us:g} us")
    _refuse(time, charge > limits.charge_uc * (1 + 1e-12), f"a pulse has more than {limits.charge_uc:g} uC")
    close = np.r_[False, np.diff(time) < (1 - 1e-6) / limits.rate_hz]
    _refuse(time, close, f"two pulses come closer than at {limits.rate_hz:g} Hz")
    current = np.full(len(time), limits.current_ma)
    return {"time_s": time, "pulse_width_us": width, "current_ma": current, "charge_uc": charge}


def _refuse(time: np.ndarray, where: np.ndarray, what: str) -> None:
    if where.any():
        first = float(time[np.argmax(where)])
        raise InputError(f"{what} at {first:.4g} s, and {np.count_nonzero(where) - 1} more; nothing is written")
