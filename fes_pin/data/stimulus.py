"""Trials of a muscle with the one quantity of their pulses that recruits."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from fes_pin.data.channels import (
    AMPLITUDE,
    CHARGE,
    EMG,
    EMG_KEYS,
    ENVELOPE,
    RATE,
    STIMULI,
    WIDTH,
    Channel,
    channel_of,
)
from fes_pin.data.trial import Trial, derived_trial

MOVES_HZ = 20.0
"""Below it is what moves cables and electrodes, Hz: De Luca and others, J. Biomech. 43 (2010) 1573."""
SAME = 0.01
"""Share by which a quantity of the pulses varies that a stimulator holds: a log rounds it, or reads it back."""


def usual_rate(trials: Sequence[Trial]) -> float | None:
    """The median rate in Hz of trials while they are stimulated; None where no rate was recorded above 0."""
    rates = np.concatenate([[], *(t[RATE][t[RATE] > 0.0] for t in trials if RATE in t)])
    return float(np.median(rates)) if len(rates) else None


def is_stimulated(trial: Trial) -> bool:
    """Whether any of a trial's pulses is not 0."""
    return any(n in trial and bool(trial[n].any()) for n in STIMULI)


def with_one_stimulus(
    trials: Sequence[Trial], constants: Mapping[str, float], inputs: Collection[str]
) -> tuple[Trial, ...]:
    """Trials with the one channel that recruits, of those that hold width and amplitude; each says what was done.

    Where a threshold in mA or us is known, the other quantity must be the same in all pulses; where one in uC is, the
    charge of a pulse is the product of both. Without any the one that varies is taken, if one alone does.

    Parameters
    ----------
    inputs
        Columns that the rig takes as inputs.

    Raises
    ------
    InputError
        Both vary, and no threshold of the charge says so.
    """
    if EMG in inputs and any(EMG in t for t in trials):
        return _with_envelopes(trials, constants)
    both = [t for t in trials if WIDTH.column in t and AMPLITUDE.column in t]
    if not both:
        return tuple(trials)
    channel = channel_of(constants) or varying(_pairs(both))
    made = {t.name: t for t in (_by_charge(both) if channel is CHARGE else _alone(both, channel))}
    return tuple(made.get(t.name, t) for t in trials)


def _with_envelopes(trials: Sequence[Trial], constants: Mapping[str, float]) -> tuple[Trial, ...]:
    """Trials with the envelope of their EMG: rectified, low-passed without delay, over its maximum or that of an MVC.

    Raises
    ------
    InputError
        No cut-off is stated, or it is not below half of the sample rate.
    """
    from fes_pin.data.smooth import low_pass  # noqa: PLC0415 - SciPy, for EMG alone

    cutoff, envelopes = constants.get(EMG_KEYS[0]), {}
    for trial in (t for t in trials if EMG in t):
        if cutoff is None or not cutoff < 0.5 / trial.dt:
            found = "none" if cutoff is None else f"{cutoff:g} Hz at {1.0 / trial.dt:.4g} Hz"
            message = (
                f"expected {EMG_KEYS[0]} in [rig], the cut-off of its envelope, below half the rate; found {found}"
            )
            raise trial.error(message, EMG)
        raw = trial[EMG] - np.mean(trial[EMG])
        if 0.5 / trial.dt > 2.0 * MOVES_HZ:
            raw = raw - low_pass(raw[:, None], trial.dt, MOVES_HZ)[:, 0]
        envelopes[trial.name] = np.maximum(low_pass(np.abs(raw)[:, None], trial.dt, cutoff)[:, 0], 0.0)
    largest = max(float(e.max()) for e in envelopes.values())
    size = constants.get(EMG_KEYS[1], largest)
    of = "that of an MVC" if EMG_KEYS[1] in constants else "its maximum in all trials"
    words = f"emg is rectified, low-passed at {cutoff:g} Hz without delay, and divided by {of}, {size:.4g}"
    made = {t.name: t for t in trials}
    for name, envelope in envelopes.items():
        made[name] = _replaced(made[name], {ENVELOPE: envelope / max(size, 1e-300)}, words)
    return tuple(made[t.name] for t in trials)


def varying(pairs: Sequence[tuple[np.ndarray, np.ndarray]]) -> Channel:
    """The channel that recruits where widths and amplitudes are known, by which of them varies between pulses."""
    width, amplitude = map(_varies, _in_pulses(pairs))
    return CHARGE if width and amplitude else AMPLITUDE if amplitude else WIDTH


def _varies(sizes: np.ndarray) -> bool:
    """Whether a quantity of pulses, shape (m,), is not one that a stimulator holds."""
    return bool(len(sizes) and np.ptp(sizes) > SAME * sizes.max())


def _pairs(trials: Sequence[Trial]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Width and amplitude of each trial, (n,)."""
    return [(t[WIDTH.column], t[AMPLITUDE.column]) for t in trials]


def _in_pulses(pairs: Sequence[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Width and amplitude of all pulses, shape (2, m): where neither is 0."""
    both = np.concatenate([np.stack(pair) for pair in pairs], axis=1)
    return both[:, (both != 0.0).all(axis=0)]


def _by_charge(trials: Sequence[Trial]) -> list[Trial]:
    """Trials with the charge of each pulse, uC, in the place of its width and amplitude."""
    words = f"the stimulus is the charge of a pulse, {WIDTH.column} x {AMPLITUDE.column}"
    return [_replaced(t, {CHARGE.column: 1e-3 * t[WIDTH.column] * t[AMPLITUDE.column]}, words) for t in trials]


def _alone(trials: Sequence[Trial], channel: Channel) -> list[Trial]:
    """Trials with the width or the amplitude alone; InputError where the other is not the same in all pulses."""
    widths, amplitudes = _in_pulses(_pairs(trials))
    other, found = (AMPLITUDE, amplitudes) if channel is WIDTH else (WIDTH, widths)
    if _varies(found):
        words = f"{found.min():.4g} to {found.max():.4g} {other.unit}: a threshold in {channel.unit} is not one"
        needed = " and ".join(CHARGE.ends)
        raise trials[0].error(f"varies in {words} of all these pulses; expected {needed} of their charge", other.column)
    size = f"{np.median(found):.4g} {other.unit}" if len(found) else "0"
    words = f"the stimulus is {channel.column}; {other.column} is {size} in every pulse and left out"
    held = [np.where(t[other.column] != 0.0, t[channel.column], 0.0) for t in trials]
    return [_replaced(t, {channel.column: v}, words) for t, v in zip(trials, held, strict=True)]


def _replaced(trial: Trial, columns: Mapping[str, np.ndarray], words: str) -> Trial:
    kept = {n: v for n, v in trial.columns.items() if n not in (WIDTH.column, AMPLITUDE.column, EMG)}
    made = derived_trial(trial, columns={**columns, **kept}, remarks=(*trial.remarks, words))
    if trial.as_read is not None and not trial.is_edited:
        made = derived_trial(made, as_read=replace(trial.as_read, digest=made.digest()))
    return made
