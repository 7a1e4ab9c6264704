"""What no cause in the library explains, and where it is.

Eight tests share one level: lack of fit on smooth features of the motion; bursts at times of their own; spectral lines;
torque that repeats with the angle over short distances; deviations that come again at the same time of every trial;
deviations that grow with the stimulus; readings that slip once within a trial; readings that lag where the motion
turns. All but the first see what it is blind to, and what an autoregressive noise model takes for noise.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.diagnosis.remainder.bursts import burst_p_value
from fes_pin.diagnosis.remainder.detents import detent_p_value
from fes_pin.diagnosis.remainder.heteroscedastic import heteroscedastic_p_value
from fes_pin.diagnosis.remainder.innovations import channels, driven, under_own_noise
from fes_pin.diagnosis.remainder.lines import LONGEST_NOISE, line_p_value
from fes_pin.diagnosis.remainder.play import play_p_value
from fes_pin.diagnosis.remainder.repeated import repeated_p_value
from fes_pin.diagnosis.remainder.slips import slip_p_value
from fes_pin.identify.fit import Fit
from fes_pin.infer.distributions import chi2_quantile, chi2_tail
from fes_pin.infer.levels import CERTAIN_LEVEL, CLAIM_LEVEL, FULL_NOISE, SHORT_NOISE, UNFELT
from fes_pin.infer.noise import Noise, NoiseModel, first_order_low_pass
from fes_pin.infer.projection import Projection
from fes_pin.infer.result import Remainder
from fes_pin.models.model import Model
from fes_pin.models.simulate import Simulator
from fes_pin.workers import in_parallel

KEPT = 1e-3
"""Share of its norm that a feature must keep, once what was fitted is projected off."""
FEWEST_SIGNS = 4
"""Trials whose signs are drawn, at least."""
SIGN_DRAWS = 400
"""Random signs of trials that a statistic's inflation is averaged over."""


@dataclass(frozen=True)
class MotionFeatures:
    """Smooth functions of the simulated motion, as whitened columns.

    Attributes
    ----------
    names
        Of the variable that each column is a function of.
    columns
        Shape (m, features), all trials end to end.
    """

    names: tuple[str, ...]
    columns: np.ndarray


def features(model: Model, trials: Sequence[Trial], noise: NoiseModel) -> MotionFeatures:
    """About 40 smooth functions of angle, rate, acceleration, stimulus, activation and time of the trials.

    Of the motion as it was simulated, where that stays finite. Each is also taken through a second-order low pass, as a
    torque would be by the joint.
    """
    simulated = Simulator(model, trials).run(model.parameters())
    seen = [
        (trial, model.rig.input_columns(trial), _motion(one.readings[:, k], trial[output]), output)
        for trial, one in zip(trials, simulated, strict=True)
        for k, output in enumerate(model.rig.outputs(trial.kind))
        if output in trial.columns and output in noise
    ]
    blocks = in_parallel(lambda channel: _whitened(*channel, noise[channel[3]]), seen)
    keys = list(dict.fromkeys(n for names, _ in blocks for n in names))
    rows = [np.zeros((len(columns), len(keys))) for _, columns in blocks]
    for row, (names, columns) in zip(rows, blocks, strict=True):
        row[:, [keys.index(n) for n in names]] = columns
    return MotionFeatures(tuple(n.split()[1].split(":")[0] for n in keys), np.concatenate(rows))


def _motion(simulated: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """As it was simulated; as it was measured where a simulation runs away."""
    return simulated if np.isfinite(simulated).all() else measured


def _whitened(
    trial: Trial, inputs: Sequence[str], reading: np.ndarray, output: str, noise: Noise
) -> tuple[list[str], np.ndarray]:
    """Names and whitened features of one channel of one trial."""
    made = _of_trial(trial, inputs, reading, output)
    return [f"{output} {n}" for n in made], noise.whiten(np.stack(list(made.values()), axis=1), trial.dt)


def _of_trial(trial: Trial, inputs: Sequence[str], reading: np.ndarray, output: str) -> dict[str, np.ndarray]:
    """Features of one channel of one trial by "variable: function", each scaled to about 1."""
    dt = trial.dt
    time = (trial.time - trial.time[0]) / max(trial.duration, dt)
    centred = reading - reading.mean()
    q = centred / max(float(np.abs(centred).max()), 1e-12)
    v = np.gradient(q, dt)
    v = v / max(float(np.abs(v).max()), 1e-12)
    a = np.gradient(v, dt)
    a = a / max(float(np.abs(a).max()), 1e-12)
    base = {
        "offset: 1": np.ones_like(time),
        "time: t": time,
        "time: t2": time**2,
        "time: t3": time**3,
        "angle: q2": q**2,
        "angle: q3": q**3,
        "rate: v": v,
        "rate: v|v|": v * np.abs(v),
        "rate: sign v": np.tanh(10.0 * v),
        "rate: v3": v**3,
        "acceleration: a": a,
        "angle: q v": q * v,
        "time: q t": q * time,
        "time: v t": v * time,
    }
    for cycles in (1, 2, 3, 5, 8):
        base[f"time: sin {cycles}"] = np.sin(2 * np.pi * cycles * time)
        base[f"time: cos {cycles}"] = np.cos(2 * np.pi * cycles * time)
    driven = {}
    for name in inputs[:1]:
        u = trial[name] / max(float(np.abs(trial[name]).max()), 1e-12)
        act, slow = _low_pass(u, 0.05, dt), _low_pass(u, 0.5, dt)
        used = np.cumsum(act) * dt / max(trial.duration, dt)
        driven = {
            "stimulus: u": u,
            "activation: act": act,
            "activation: act2": act**2,
            "activation: act3": act**3,
            "activation: act q": act * q,
            "activation: act v": act * v,
            "activation: slow": slow,
            "history: used": used,
            "history: act used": act * used,
            "history: act t": act * time,
            "history: act slow": act * slow,
        }
    plain = {**base, **driven}
    lagged = _low_pass(_low_pass(np.stack(list(plain.values()), axis=1), 0.05, dt), 0.05, dt)
    through = dict(zip((f"{n} filtered" for n in plain), lagged.T, strict=True))
    kind = "angle" if output != "force_n" else "force"
    return {n.replace("angle:", f"{kind}:"): x for n, x in {**plain, **through}.items()}


def _low_pass(x: np.ndarray, time_constant: float, dt: float) -> np.ndarray:
    return first_order_low_pass(x, float(np.exp(-dt / time_constant)))


def unexplained_remainder(fitted: Fit, seed: int = 0) -> Remainder:
    """Test whether a fit leaves anything but noise.

    The p-value is that of the most significant of the tests, times their number.
    """
    smooth = smooth_remainder(fitted, seed)
    found = [(smooth.p_value, smooth.where), *beside_smooth(fitted, seed)]
    p_value, where = min(found, key=lambda f: f[0])
    p_value = min(1.0, len(found) * p_value)
    unexplained = p_value < CLAIM_LEVEL
    return Remainder(unexplained, p_value, where if unexplained else None, smooth.excess)


def beside_smooth(fitted: Fit, seed: int) -> list[tuple[float, str]]:
    """p-values of all tests but that of smooth features, and what each deviation depends on."""
    own = under_own_noise(fitted)
    full = under_own_noise(fitted, FULL_NOISE, FULL_NOISE)
    beside = Projection(full.parts)
    short = channels(under_own_noise(fitted, SHORT_NOISE))
    count = len(short)
    bursts = min(burst_p_value([e.values for e in pieces], noise, pieces[0].dt) for noise, pieces in short)
    line, where = min(line_p_value(pieces) for _, pieces in channels(under_own_noise(fitted, LONGEST_NOISE)))
    detents = detent_p_value(own, Projection(own.parts))
    repeated = min(repeated_p_value([e.values for e in pieces], pieces[0].dt) for _, pieces in short)
    heteroscedastic = min(
        heteroscedastic_p_value([e.values for e in pieces], [np.abs(driven(e)) for e in pieces], pieces[0].dt)
        for _, pieces in short
    )
    return [
        (count * bursts, "time"),
        (count * line, where),
        (detents, "angle"),
        (count * repeated, "time"),
        (count * heteroscedastic, "stimulus"),
        (slip_p_value(full, beside, seed), "time"),
        (play_p_value(full, beside), "rate"),
    ]


def smooth_remainder(fitted: Fit, seed: int = 0) -> Remainder:
    """Test whether smooth features explain anything that a fit leaves.

    The chi-square of the features is divided by the inflation that it shows when each trial's features change sign at
    random: then only what is not coherent between trials is left, which noise that is not quite whitened has as well.
    """
    projection = Projection(fitted.parts)
    made = features(fitted.model, fitted.trials, fitted.noise)
    columns = projection(made.columns)
    gram = columns.T @ columns
    before, after = np.einsum("mi,mi->i", made.columns, made.columns) ** 0.5, np.diag(gram) ** 0.5
    good = after > KEPT * np.where(before > 0, before, 1.0)
    names, scale = [n for n, g in zip(made.names, good, strict=True) if g], 1.0 / after[good]
    values, vectors = np.linalg.eigh(gram[np.ix_(good, good)] * np.outer(scale, scale))
    kept = values > UNFELT * values.max(initial=1e-300)
    by_trial = trial_shares(columns, projection.residual, fitted)[:, good] * scale
    shares = by_trial @ vectors[:, kept] / np.sqrt(values[kept])
    rank, statistic = int(kept.sum()), float(np.sum(shares.sum(axis=0) ** 2))
    plain = float(chi2_tail(statistic, rank))
    p_value = float(chi2_tail(statistic / inflation_by_signs(shares, rank, seed), rank))
    strong = plain < CERTAIN_LEVEL <= p_value  # it differs from trial to trial: a spasm, not noise
    p_value = plain if strong else p_value
    unexplained = p_value < CLAIM_LEVEL
    scores: dict[str, float] = {}
    for name, z in zip(names, by_trial.sum(axis=0), strict=True):
        scores[name] = max(scores.get(name, 0.0), float(z**2))
    where = max(scores, key=lambda n: scores[n]) if unexplained else None
    inflation = inflation_by_signs(shares, rank, seed)
    excess = max(0.0, statistic / inflation - float(chi2_quantile(0.975, rank)))
    return Remainder(unexplained, p_value, where, excess)


def trial_shares(columns: np.ndarray, residual: np.ndarray, fitted: Fit) -> np.ndarray:
    """Each trial's part of the inner products of columns and residual, shape (trials, columns)."""
    ends = np.cumsum([0, *(len(p.residual) for p in fitted.parts)])
    return np.array([columns[a:b].T @ residual[a:b] for a, b in itertools.pairwise(ends)])


def inflation_by_signs(shares: np.ndarray, rank: int, seed: int) -> float:
    """How much larger than its rank the statistic is with random signs of the trials; 1 with fewer than 4 trials."""
    if len(shares) < FEWEST_SIGNS or not rank:
        return 1.0
    signs = np.random.default_rng(seed).choice((-1.0, 1.0), size=(SIGN_DRAWS, len(shares)))
    return max(1.0, float(np.mean(np.sum((signs @ shares) ** 2, axis=1))) / rank)
