"""The stimulus of a muscle: which quantity of its pulses varies, in which unit, and between which ends it recruits.

A stimulator varies the width of its pulses, their amplitude, both (a nerve then answers their charge, the product), or
their rate. The threshold that a study states says by its unit which of them recruits.
"""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from fes_pin.data.schema import NumberKey, not_negative, positive


@dataclass(frozen=True)
class Channel:
    """A quantity of the pulses that recruits.

    Parameters
    ----------
    column
        That holds it; its last part names the unit.
    unit
        As printed.
    words
        The quantity in words.
    per_us
        The size that is to it what 1 us is to a pulse width: bounds and steps of causes scale with it.
    """

    column: str
    unit: str
    words: str
    per_us: float = 1.0

    @property
    def suffix(self) -> str:
        """The unit in names: `us`, `ma`, `uc`."""
        return self.column.rpartition("_")[2]

    @property
    def ends(self) -> tuple[str, str]:
        """Keys of the threshold and of the saturation."""
        return f"threshold_{self.suffix}", f"saturation_{self.suffix}"


WIDTH = Channel("pulse_width_us", "us", "pulse width")
AMPLITUDE = Channel("amplitude_ma", "mA", "amplitude", 0.04)
"""The widest pulse of `RANGES` in `data.pulses`, 5000 us, is as large as its largest current, 200 mA."""
CHARGE = Channel("charge_uc", "uC", "charge", 0.04)
"""1 mA for 1000 us is 1 uC: a current of 40 mA gives 0.04 uC each us, in the middle of what electrodes at the skin get.
Recruitment by charge: a nerve's threshold charge hardly depends on the width of pulses that are short against its
chronaxie (Weiss, Arch. Ital. Biol. 35 (1901) 413; Mortimer, Handbook of Physiology, 1981, Motor prostheses)."""
CHANNELS = {c.column: c for c in (WIDTH, AMPLITUDE, CHARGE)}
"""By column."""
RATE = "frequency_hz"
"""The column of a rate of pulses that varies, alone or in addition to one of the channels."""
EMG, ENVELOPE = "emg", "emg_envelope"
"""Columns of a voluntary muscle: what electrodes read, in any unit, and its envelope, 1 at the largest effort."""
VOLUNTARY = (EMG, ENVELOPE)
"""Columns of a contraction that nobody stimulates."""
EMG_KEYS = ("emg_cutoff_hz", "emg_mvc")
"""Constants of a study with EMG: the cut-off of its envelope, and what that is in a maximal voluntary contraction."""
STIMULI = (*CHANNELS, "stim", RATE, *VOLUNTARY)
"""Columns without which a muscle does not contract."""


def until_next(values: np.ndarray) -> np.ndarray:
    """Return the mean between each sample and the next, shape (n,), of what changes evenly in between."""
    return np.r_[0.5 * (values[1:] + values[:-1]), values[-1:]]


def channel_of(constants: Collection[str]) -> Channel | None:
    """The channel whose threshold or saturation is among the names of constants; None if no threshold is."""
    return next((c for c in CHANNELS.values() if any(end in constants for end in c.ends)), None)


def recruitment_keys() -> dict[str, NumberKey]:
    """What a study of a muscle may state of its recruitment, by key: the ends of one channel, or those of an EMG."""
    pairs = [(c.ends, c.unit) for c in CHANNELS.values()]
    ends = [{low: not_negative(unit, False), high: positive(unit, False)} for (low, high), unit in pairs]
    of_emg = dict(zip(EMG_KEYS, (positive("Hz", False), positive("", False)), strict=True))
    return {key: number for pair in (*ends, of_emg) for key, number in pair.items()}
