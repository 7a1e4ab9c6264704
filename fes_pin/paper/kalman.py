"""Gain and time constant of a muscle, pulse by pulse, by a Kalman filter on isometric force.

Between two samples the muscle of section II-3-1 does exactly

    F+ = alpha F + beta r,    alpha = exp(-dt / tau),  beta = (1 - alpha) K F_ref,    y = F + noise

which is linear in what is sought. `GainFilter` carries the state (F, alpha, beta): its measurement is linear, and of
its one product, alpha F, mean and covariance are propagated exactly (for a Gaussian), not linearised. So its bands mean
what they say (`analysis/ankle_kalman.py`).

Source: Dombre, Fournier and Coiffet, section II-3-1, figure 3; Bar-Shalom, Li and Kirubarajan, Estimation with
Applications to Tracking and Navigation, Wiley 2001, section 5.4 (NEES, NIS).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.numbers import between, instance, number, positive_number
from fes_pin.data.show import Tabulated
from fes_pin.data.trial import Trial
from fes_pin.muscles.recruitment import LinearRecruitment

START_TIME_CONSTANT_S = 0.1
"""Start value of tau, s: twice the paper's; its band reaches from 0 to beyond 1 s."""
START_ALPHA_STD = 0.1


@dataclass(frozen=True, eq=False)
class StraightRecruitment(LinearRecruitment):
    """Straight recruitment from threshold to saturation, and the force that belongs to gain 1.

    Raises
    ------
    InputError
        As `LinearRecruitment`, and for a force that is not above 0.
    """

    force_scale_n: Any = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        positive_number(self.force_scale_n, "force_scale_n")

    @classmethod
    def of(cls, constants: Mapping[str, float]) -> "StraightRecruitment":
        """From the `[rig]` numbers of a study.

        Raises
        ------
        InputError
            If one of the three is missing, or as the class.
        """
        names = [item.name for item in fields(cls)]
        if missing := [n for n in names if n not in constants]:
            raise InputError(f"expected the rig's {', '.join(missing)}", column="constants")
        return cls(**{n: constants[n] for n in names})

    def __call__(self, pulse_width_us: float) -> float:
        if not math.isfinite(pulse_width_us):
            raise InputError(f"expected a finite number of us, found {pulse_width_us}", column="pulse_width_us")
        return float(self.recruitment(pulse_width_us))


class GainFilter:
    """Kalman filter of (F, alpha, beta), one sample at a time.

    Parameters
    ----------
    dt
        Time between samples, s.
    recruitment
        Known curve, and F_ref.
    noise_std
        Of the measured force, N.
    greatest_gain
        A bound on what K can be: the start knows no more than that K is of this size.
    wander
        Standard deviation that the gain's size may change by in a second, as a share of it: 0 for a gain that is
        constant, more for a muscle that tires.

    Attributes
    ----------
    x, p
        Mean, shape (3,), and covariance, shape (3, 3), of (F, alpha, beta).
    nis
        Normalised innovation squared of the last sample; one degree of freedom.
    skipped
        Number of samples without a force: the filter went on without them.

    Raises
    ------
    InputError
        For a time step, a noise or a gain that is not above 0, a wander below 0, or another recruitment.
    """

    def __init__(
        self,
        dt: float,
        recruitment: StraightRecruitment,
        noise_std: float,
        greatest_gain: float = 2.0,
        wander: float = 0.0,
    ) -> None:
        for name, value in (("dt", dt), ("noise_std", noise_std), ("greatest_gain", greatest_gain)):
            positive_number(value, name)
        between(wander, 0.0, math.inf, "wander")
        self.recruitment = instance(recruitment, StraightRecruitment, "recruitment")
        self.dt, self.noise_std, self.wander = dt, noise_std, wander
        self.nis, self.skipped = math.nan, 0
        alpha = math.exp(-dt / START_TIME_CONSTANT_S)
        beta = (1.0 - alpha) * 0.5 * greatest_gain * recruitment.force_scale_n
        self.x, self.p = np.array([0.0, alpha, beta]), np.diag([noise_std**2, START_ALPHA_STD**2, beta**2])

    def step(self, force_n: float, pulse_width_us: float) -> None:
        """Take in one measured force (NaN: none), and the pulse width that is held from now on.

        Raises
        ------
        InputError
            For a pulse width that is not finite; the filter stays as it was.
        """
        recruitment = self.recruitment(pulse_width_us)
        if math.isfinite(force_n):
            self._correct(force_n)
        else:
            self.skipped += 1
        self._predict(recruitment)

    def _correct(self, force_n: float) -> None:
        innovation, noise = force_n - self.x[0], self.noise_std**2
        size = self.p[0, 0] + noise
        self.nis, gain = float(innovation**2 / size), self.p[0] / size
        left = noise / size * self.p[0]
        self.x, self.p = self.x + gain * innovation, self.p - np.outer(gain, self.p[0])
        self.p[0] = self.p[:, 0] = left  # without the difference of two numbers that are nearly the same

    def _predict(self, r: float) -> None:
        force, alpha, beta = self.x
        (ff, fa, _), (_, aa, _), _ = self.p
        row = np.array([alpha, force, r])
        carried = self.p @ row
        carried[0] = row @ carried + ff * aa + fa * fa  # with what the product of two Gaussians adds
        self.p[0] = self.p[:, 0] = carried
        self.p[2, 2] += (self.wander * beta) ** 2 * self.dt
        self.x[0] = alpha * force + fa + beta * r

    def _decay(self) -> float:
        return min(max(float(self.x[-2]), 1e-6), 1.0 - 1e-6)

    def gain_and_time_constant(self) -> tuple[float, float]:
        """K and tau in s, from the means."""
        alpha = self._decay()
        gain = self.x[-1] / ((1.0 - alpha) * self.recruitment.force_scale_n)
        return float(gain), -self.dt / math.log(alpha)

    def stds(self) -> tuple[float, float]:
        """Standard deviations of K and of tau in s, to first order."""
        alpha = self._decay()
        left = (1.0 - alpha) * self.recruitment.force_scale_n
        of_gain = [self.x[-1] / left / (1.0 - alpha), 1.0 / left]
        by_alpha_and_beta = np.array([of_gain, [self.dt / (alpha * math.log(alpha) ** 2), 0.0]])
        gain, time_constant = np.sqrt(np.diag(by_alpha_and_beta @ self.p[-2:, -2:] @ by_alpha_and_beta.T))
        return float(gain), float(time_constant)


@dataclass(frozen=True, eq=False)
class GainHistory(Tabulated):
    """The estimates over a trial: the paper's figure 3.

    Attributes
    ----------
    time
        Shape (n,), s.
    gain, gain_std
        K and its standard deviation, shape (n,).
    time_constant_s, time_constant_std_s
        tau and its standard deviation, shape (n,).
    nis
        Normalised innovations squared, shape (n,).
    """

    time: np.ndarray
    gain: np.ndarray
    gain_std: np.ndarray
    time_constant_s: np.ndarray
    time_constant_std_s: np.ndarray
    nis: np.ndarray

    along = ("time", "gain", "gain_std", "time_constant_s", "time_constant_std_s", "nis")

    def at(self, time: float) -> tuple[float, float]:
        """K and tau in s, as known at a time in s; after the last sample as known then.

        Raises
        ------
        InputError
            For a time before the first sample, or that is none.
        """
        if not number(time, "time") >= self.time[0]:
            raise InputError(f"expected {self.time[0]:g} s or later, found {time:g}", column="time")
        k = int(np.searchsorted(self.time, time, side="right")) - 1
        return float(self.gain[k]), float(self.time_constant_s[k])


def track_gain(trial: Trial, constants: Mapping[str, float], noise_std: float, wander: float = 0.0) -> GainHistory:
    """Run the filter over an isometric trial.

    Parameters
    ----------
    constants
        The `[rig]` numbers of its study.
    noise_std
        N.

    Raises
    ------
    InputError
        For a trial without measured force or pulse widths, or constants without the muscle's.
    """
    instance(trial, Trial, "trial")
    for column in ("force_n", "pulse_width_us"):
        if column not in trial:
            raise InputError(f"trial {trial.name} has no column {column}; gain and time constant need isometric trials")
    return history_of(GainFilter(trial.dt, StraightRecruitment.of(constants), noise_std, wander=wander), trial)


def history_of(tracker: GainFilter, trial: Trial) -> GainHistory:
    """Return the estimates of a filter after each sample of a trial."""
    rows = []
    for force, width in zip(trial["force_n"], trial["pulse_width_us"], strict=True):
        tracker.step(float(force), float(width))
        (gain, tau), (gain_std, tau_std) = tracker.gain_and_time_constant(), tracker.stds()
        rows.append((gain, gain_std, tau, tau_std, tracker.nis))
    return GainHistory(trial.time, *np.array(rows).T)
