"""Muscles that are integrated by scipy, in forms of their own: what they measured under trains of several rates."""

from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

from fes_pin.data.study import Study
from fes_pin.data.trial import Trial

DT = 2e-3
PERIODS_S = (0.1, 0.06, 0.04, 0.026)


def pulses(rng, period, duration=1.0):
    """Times of a train, with a doublet at its beginning in every other one."""
    start = 0.05 + DT * rng.integers(10)
    times = np.arange(start, start + 0.6 * duration, period)
    if rng.random() < 0.5:
        times = np.concatenate([[times[0]], times + 0.012])
    return np.round(times / DT) * DT


def ding_force(times, time, km=0.3, scale=1500.0, tau1=0.04, tau2=0.08, tau_c=0.02):
    """Ding et al. 2003, the sums over pulses written out."""
    intervals = np.diff(times, prepend=-np.inf)
    weights = 1.0 + (km + 0.04) * np.exp(-intervals / tau_c)

    def rates(t, y):
        since = t - times
        driven = np.sum(np.where(since >= 0, weights * np.exp(-np.maximum(since, 0.0) / tau_c), 0.0))
        x = y[0] / (km + y[0])
        return [(driven - y[0]) / tau_c, scale * x - y[1] / (tau1 + tau2 * x)]

    return solve_ivp(rates, (time[0], time[-1]), [0.0, 0.0], t_eval=time, max_step=1e-3, rtol=1e-8).y[1]


def lag_force(times, time, period, gain=40.0, tau=0.07):
    """A first-order lag of impulses, in closed form."""
    since = time[:, None] - times
    held = np.where(since >= 0, np.exp(-np.maximum(since, 0.0) / tau), 0.0)
    return gain * period / tau * held.sum(axis=1)


def study(kind, seed, count=12, noise=0.4, scatter=0.02):
    """A muscle study of isometric trains; strength scatters from trial to trial, noise is autoregressive."""
    rng = np.random.default_rng([seed, 91])
    time, trials = np.arange(0.0, 1.0, DT), []
    rates = [PERIODS_S[k % len(PERIODS_S)] for k in range(count)]
    for k, period in enumerate(rates):
        times = pulses(rng, period)
        force = ding_force(times, time) if kind == "ding" else lag_force(times, time, 0.04)
        stim = np.zeros(len(time))
        stim[np.round(times / DT).astype(int)] = 1.0
        left = lfilter([np.sqrt(1.0 - 0.6**2)], [1.0, -0.6], rng.standard_normal(len(time)))
        force = force * (1.0 + scatter * rng.standard_normal()) + noise * left
        trials.append(Trial(f"{k:02d}", "isometric", {"stim": stim, "force_n": force}, time))
    start = {"gain": 30.0, "time_constant_s": 0.05}
    return Study(f"{kind}-{seed}", "muscle", {}, start, tuple(trials), Path())
