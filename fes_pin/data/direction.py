"""Which way a recorded effort acts: it drives the joint, or it is what an imposed motion takes.

Inverse dynamics are the same for both. What differs is the noise of the effort, above the band of the motion.

**Read.** An effort that drives a joint of inertia I moves it there too: its acceleration is the net effort over I, and
noise of the reading adds to it. The noise of an effort that was read moves nothing. With both passed by an octave,

    ratio = median |net effort| / (I median |acceleration|)

is at most 1 for an effort that drives, whatever its controller does, at samples at which the joint moves: one that
sticks does not follow, and about reversals friction is uncertain. The net effort is the recorded one without all that
follows from position and velocity: gravity, springs, damping and friction, fitted with the inertia in the band of the
motion. Octaves count where the reading is above no low pass, so that its spectrum is that of white noise.

**Commanded.** A controller answers the noise of the reading. Readings of the samples around then predict the fourth
differences of its effort, in which hardly any motion is. The noise of a reading is broad, and so is the answer. Hum and
a servo's switching come into all channels of an instrument too, at few frequencies: the median over frequencies counts.
An effort with noise of its own that answers nothing was read.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fes_pin.data.schema import IMPOSED, RigSchema
from fes_pin.data.spectra import ABOVE_NOISE, OF_POWER, QUIET, SEGMENT_S, SLOWEST_HZ, TIMES, pooled, spectrum
from fes_pin.data.trial import Trial, derived_trial

MORE, MANY = 1.5, 3.5
"""Ratios from which an effort cannot have driven the joint, and from which a stated kind is contradicted. Driven rigs
have at most 1, and 0.35 is the largest of 71. Where their reading was low-passed at 4 Hz and then rounded, 2.8 is."""
ORDER, LAGS = 4, 4
"""Of differences of an effort and of a reading, and samples to either side over which a controller answers."""
OF_BAND = 0.25
"""Share of the Nyquist frequency above which an answer is looked for."""
NOISE_ORDER = 8
"""Of differences in which the noise of an effort is measured: of a sine of 5 Hz at 50 Hz they leave 0.02 %."""
COMMANDED, SURELY_COMMANDED = 0.1, 0.9
"""Share of the differences of an effort from which a controller commands it, and from which a stated kind is doubtful.
Of 64 draws of the four generators of driven rigs in `tests/effort/test_direction.py` 0.27 is the least.
Of 40 efforts that were read 0.02 is the largest."""
NOISY = 1e-3
"""Noise, as a share of an effort, from which it is noise of its own: rounding and 12 bits leave less."""
EXPLAINED = 0.95
"""Least share of the effort's variance that the motion explains: else its upper octaves hold causes, not noise."""
SURELY = 3.0
"""Standard deviations by which the inertia may be larger than its estimate."""
SLOWEST_ROWS = 0.25
"""Longest step, in periods of the slowest band: the octave above it ends at the Nyquist frequency."""
OF_RATE = 0.4
"""Largest cut-off frequency, as a share of the sample rate."""
OCTAVES = 6
"""Octaves above the band that are looked at, at most."""
FEWEST = 100
"""Samples of a trial that is looked at, and of joints in motion, at least."""
MOVING = 0.3
"""Speed, as a share of the usual one, from which a joint counts as moving."""
FARTHEST = 1e6
"""Position in rad or m that nothing reaches."""
ALIKE = 1e-6
"""Singular value, as a share of the largest, below which columns are alike."""


LEFT_OUT = "kind is left out"
"""How a remark begins about a kind that the data decided."""


@dataclass(frozen=True)
class Direction:
    """Which way efforts act.

    Attributes
    ----------
    kind
        "imposed" where the efforts were read, else "motion".
    reason
        Why, in words.
    ratio
        Acceleration that the net effort would cause, over what was read, in the octave where it is largest; NaN where
        the trials do not show it.
    answering
        Share of the power of the fourth differences of the efforts that the readings predict, the median over
        frequencies.
    """

    kind: str
    reason: str
    ratio: float = math.nan
    answering: float = 0.0


UNKNOWN = Direction(
    "motion", 'the trials do not show whether the effort drives; where a lever moves the joint say kind = "imposed"'
)
"""Of trials that do not show it."""


def with_kinds(trials: Sequence[Trial], schema: RigSchema) -> tuple[Trial, ...]:
    """Return trials with the kind that their data show where it was left out, and a remark about it.

    Parameters
    ----------
    schema
        Of the rig. Kinds of rigs whose effort can only be one of the two are the default.
    """
    if all(t.kind for t in trials):
        return tuple(trials)
    open_ones = [t for t in trials if not t.kind and schema.is_driven_or_read(t.columns)]
    found = direction_of(open_ones)
    remark = f'{LEFT_OUT} and "{found.kind}" is taken, of two that were tried: {found.reason}'
    made = {id(t): derived_trial(t, kind=found.kind, remarks=(*t.remarks, remark)) for t in open_ones}
    return tuple(made.get(id(t), t if t.kind else derived_trial(t, kind=schema.default_kind)) for t in trials)


def contradicted(trials: Sequence[Trial], schema: RigSchema) -> tuple[tuple[Trial, ...], list[str]]:
    """Return trials, as imposed where their efforts certainly did not drive the joint, and warnings about their kind.

    Where that is uncertain the stated kind is kept.
    """
    out, warnings = list(trials), []
    for kind in (schema.default_kind, IMPOSED):
        stated = [t for t in trials if t.kind == kind and schema.is_driven_or_read(t.columns)]
        found = direction_of(stated)
        if kind == IMPOSED and found.kind != IMPOSED and found.answering > SURELY_COMMANDED:
            warnings.append(f'kind = "{kind}" is doubtful: {found.reason}')
        elif kind != IMPOSED and MORE < found.ratio < MANY:
            warnings.append(f'kind = "{kind}" is doubtful, or the reading was low-passed: {found.reason}')
        elif kind != IMPOSED and found.ratio >= MANY:
            warnings.append(f'kind = "{kind}" is contradicted and "{IMPOSED}" is taken: {found.reason}')
            names = {t.name for t in stated}
            out = [derived_trial(t, kind=IMPOSED) if t.name in names else t for t in trials]
    return tuple(out), warnings


def direction_of(trials: Sequence[Trial]) -> Direction:
    """Return which way the efforts of trials act, by all trials together.

    Parameters
    ----------
    trials
        Each with the columns "position" and "effort".
    """
    usable = [t for t in trials if len(t) >= FEWEST and 0.0 < np.ptp(t["position"]) < FARTHEST]
    largest = max((float(np.abs(t["effort"]).max()) for t in usable), default=0.0)
    if largest <= 0.0:
        return UNKNOWN
    usable = [t.with_columns(effort=t["effort"] / largest) for t in usable if np.ptp(t["effort"]) > 1e-9 * largest]
    if not usable:
        return UNKNOWN
    ratio, octave, is_explained = _largest_ratio(usable)
    answering, noise = _answering(usable)
    if ratio > MORE:
        said = f"the effort would accelerate the joint {ratio:.2g} times as much as was read {octave}"
        return Direction(IMPOSED, said, ratio, answering)
    if answering > COMMANDED:
        said = "the effort answers the noise of the reading, as the command of a controller does"
        return Direction("motion", said, ratio, answering)
    if noise > NOISY and is_explained:
        said = f"the effort has noise of its own, {100.0 * noise:.2g} % of it, which does not answer the reading"
        return Direction(IMPOSED, said, ratio, answering)
    return UNKNOWN


def _largest_ratio(trials: Sequence[Trial]) -> tuple[float, str, bool]:
    """Return the largest ratio of an octave, and that octave in words; NaN where none shows it.

    The last value is whether the motion explains the effort.
    """
    band = band_hz(trials)
    if math.isnan(band):
        return math.nan, "", False
    frequency, position, noise = _spectrum_of_positions(trials)
    net, inertia, explained = _net_efforts(trials, band)
    if explained < EXPLAINED:
        return math.nan, "", False
    ratios = {}
    for low in (band * 2.0**k for k in range(OCTAVES) if band * 2.0 ** (k + 1) <= frequency[-1]):
        is_white = position[(frequency >= low) & (frequency < 2.0 * low)].mean() < ABOVE_NOISE * noise
        if is_white and math.isfinite(ratio := _ratio(trials, net, band, low)):
            ratios[low] = ratio / inertia
    if not ratios:
        return math.nan, "", True
    low = max(ratios, key=lambda f: ratios[f])
    return ratios[low], f"from {low:.2g} to {2.0 * low:.2g} Hz", True


def _answering(trials: Sequence[Trial]) -> tuple[float, float]:
    """Return the share of the fourth differences of efforts that readings predict, and their noise over the efforts.

    The share is that of the power at a frequency, the median over frequencies.
    """
    from fes_pin.data.answered import without_jumps  # noqa: PLC0415 - half a second of SciPy, for efforts alone

    usual = math.sqrt(float(np.mean(np.concatenate([t["effort"] for t in trials]) ** 2)))
    high = np.concatenate([np.diff(t["effort"], NOISE_ORDER) for t in trials])
    is_held = not np.median(np.abs(np.concatenate([np.diff(t["effort"]) for t in trials])))
    size = 0.0 if is_held else 1.4826 * float(np.median(np.abs(high)))
    noise = size / math.sqrt(math.comb(2 * NOISE_ORDER, NOISE_ORDER))
    shares = [np.zeros(0)]
    for trial in trials:
        effort, reading = (without_jumps(np.diff(trial[n], ORDER)) for n in ("effort", "position"))
        if not effort.any() or not reading.any():
            continue
        around = np.lib.stride_tricks.sliding_window_view(reading, 2 * LAGS + 1) / reading.std()
        target = effort[LAGS:-LAGS] / effort.std()
        left = target - around @ np.linalg.lstsq(around, target, rcond=1e-10)[0]
        frequency, every = spectrum(target, trial.dt)
        missed = spectrum(left, trial.dt)[1]
        is_upper = (frequency > OF_BAND * frequency[-1]) & (every > 0.0)
        shares.append(1.0 - missed[is_upper] / every[is_upper])
    each = np.concatenate(shares)
    return float(np.median(each)) if len(each) else 0.0, noise / usual


def _spectrum_of_positions(trials: Sequence[Trial]) -> tuple[np.ndarray, np.ndarray, float]:
    """Return frequencies, the mean spectrum of the positions, and that of their noise."""
    dt = max(t.dt for t in trials)
    frequency = np.fft.rfftfreq(min(round(SEGMENT_S / dt), max(map(len, trials))), dt)
    position = pooled([(t["position"], t.dt) for t in trials], frequency)
    return frequency, position, float(np.median(position[frequency > QUIET * frequency[-1]]))


def band_hz(trials: Sequence[Trial]) -> float:
    """Return the frequency above which there is hardly motion, Hz; NaN where trials are too short or too coarse."""
    if not trials or max(t.dt for t in trials) * SLOWEST_HZ > SLOWEST_ROWS:
        return math.nan
    frequency, position, noise = _spectrum_of_positions(trials)
    power = np.cumsum(np.maximum(position - ABOVE_NOISE * noise, 0.0) * frequency**2)
    band = max(TIMES * float(frequency[np.searchsorted(power, OF_POWER * power[-1])]), SLOWEST_HZ)
    is_short = 2.0 * band > frequency[-1] or any(len(t) * t.dt * band <= 2.0 for t in trials)
    return math.nan if is_short else band


def _net_efforts(trials: Sequence[Trial], band: float) -> tuple[list[np.ndarray], float, float]:
    """Return the effort of each trial without what position and velocity explain, the largest inertia, and R^2."""
    motions = [moved(t, band) for t in trials]
    every = np.concatenate(motions, axis=1)
    low, high, usual = every[0].min(), every[0].max(), float(np.sqrt(np.mean(every[1] ** 2))) + 1e-300
    columns = [columns_of_motion(q, v, 0.5 * (low + high), 0.5 * (high - low), usual) for q, v, _, _ in motions]
    each = zip(trials, motions, columns, strict=True)
    rows = [smoothed_rows(t, np.stack([m[2], *known, m[3]]), band) for t, m, known in each]
    every_row = np.concatenate(rows).T
    a, known, effort = every_row[0], every_row[1:-1], every_row[-1]
    sizes = np.sqrt(np.mean(np.square(known), axis=1))
    basis, values, turned = np.linalg.svd(known.T / sizes, full_matrices=False)
    kept = values > ALIKE * values[0]
    basis, turned, values = basis[:, kept], turned[kept], values[kept]
    free, left = (x - basis @ (basis.T @ x) for x in (a, effort))
    power = max(float(free @ free), 1e-300)
    inertia = float(free @ left) / power
    missed = left - inertia * free
    deviation = math.sqrt(float(missed @ missed) / max(len(a) - len(values) - 1, 1) / power)
    weights = (turned.T @ (basis.T @ (effort - inertia * a) / values)) / sizes
    net = [t["effort"] - weights @ one for t, one in zip(trials, columns, strict=True)]
    return net, abs(inertia) + SURELY * deviation, 1.0 - float(np.var(missed) / np.var(effort))


def _ratio(trials: Sequence[Trial], net: Sequence[np.ndarray], band: float, low: float) -> float:
    """Return the net effort over the acceleration in an octave, medians of the moving joint; NaN where it hardly moves.

    A held effort u gives a position q of second differences (u_k + u_(k-1)) dt^2 / (2 I), without friction.
    """
    from fes_pin.data.smooth import low_pass  # noqa: PLC0415

    speeds = [np.abs(moved(t, band)[1]) for t in trials]
    usual = math.sqrt(float(np.mean(np.concatenate(speeds) ** 2)))
    pairs = []
    for trial, effort, speed in zip(trials, net, speeds, strict=True):
        both = np.column_stack([0.5 * (effort[1:-1] + effort[:-2]), np.diff(trial["position"], 2) / trial.dt**2])
        octave = low_pass(both, trial.dt, 2.0 * low) - low_pass(both, trial.dt, low)
        around = 2 * math.ceil(0.5 / (low * trial.dt)) + 1
        still = np.convolve(speed[1:-1] < MOVING * usual, np.ones(around), "same") > 0.5
        still[:around] = still[-around:] = True
        pairs.append(np.abs(octave[~still]))
    every = np.concatenate(pairs)
    if len(every) < FEWEST:
        return math.nan
    effort, bend = np.median(every, axis=0)
    return float(effort / bend) if bend > 0.0 else math.nan


def smoothed_rows(trial: Trial, columns: np.ndarray, band: float) -> np.ndarray:
    """Return columns, shape (columns, n), low-passed at the rows of a regression, shape (rows, columns)."""
    from fes_pin.data.smooth import low_pass  # noqa: PLC0415

    cutoff, edge = min(band, OF_RATE / trial.dt), math.ceil(1.0 / (band * trial.dt))
    smooth = low_pass(columns.T, trial.dt, cutoff)
    return smooth[edge : len(smooth) - edge : max(1, int(0.25 / (band * trial.dt)))]


def moved(trial: Trial, band: float) -> np.ndarray:
    """Return position, velocity, acceleration and effort in the band, shape (4, n).

    An effort is held until the next sample: about a sample the mean of its two values acts.
    """
    from fes_pin.data.smooth import low_pass  # noqa: PLC0415

    acting = 0.5 * (trial["effort"] + np.concatenate([trial["effort"][:1], trial["effort"][:-1]]))
    both = np.column_stack([trial["position"], acting])
    position, effort = low_pass(both, trial.dt, min(band, OF_RATE / trial.dt)).T
    velocity = np.gradient(position, trial.dt)
    return np.stack([position, velocity, np.gradient(velocity, trial.dt), effort])


def columns_of_motion(q: np.ndarray, v: np.ndarray, middle: float, half: float, usual: float) -> np.ndarray:
    """Return torques of position and velocity, shape (columns, n): gravity, springs, damping, dry friction."""
    x = (q - middle) / half
    friction = (np.tanh(v / (share * usual)) for share in (0.05, 0.3))
    return np.stack([np.ones_like(x), x, x**2, x**3, np.sin(q), np.cos(q), v, v * np.abs(v), *friction])
