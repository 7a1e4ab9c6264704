"""The result of an allocation: pulse widths, their torque, what is short and why, and the proof."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from fes_pin.allocation.certificate import Certificate
from fes_pin.allocation.problem import AllocationProblem, OfProblem
from fes_pin.data.named import NamedArray
from fes_pin.data.numbers import known_word
from fes_pin.data.read_only import ReadOnly
from fes_pin.data.show import DataFrame, frame, table_html

REPORTED_NM = 0.5
"""A shortfall is put in words from this size on, N m."""
NEGLIGIBLE = 1e-7
"""A multiplier smaller than this is 0 (of a cost whose largest curvature is about 1)."""
WORTH_NAMING = 0.1
"""A channel is named as a reason if it makes at least this fraction of what the most helpful limited one makes."""


class ByName(OfProblem):
    """Results by name; they hold a `problem`, pulse widths (..., n) us and torques (..., joints) N m."""

    pulse_width_us: np.ndarray
    achieved: np.ndarray

    def __getitem__(self, channel: str) -> Any:
        """Pulse width of a channel, us: a number, or (samples,)."""
        return NamedArray(self.pulse_width_us, self.names)[known_word(channel, self.names, "channel")]

    def torque(self, joint: str) -> Any:
        """Achieved torque of a joint, N m: a number, or (samples,)."""
        return NamedArray(self.achieved, self.joints)[known_word(joint, self.joints, "joint")]

    def to_frame(self) -> DataFrame:
        """Pulse widths, us, a row each sample, a column each channel, as a frame of pandas; see `data.show.frame`."""
        return frame(dict(NamedArray(self.pulse_width_us, self.names).items()))

    def _repr_html_(self) -> str:
        each = zip(self.names, self.pulse_width_us.T, strict=True)
        rows = [(name, f"{w.min():.0f} to {w.max():.0f} us") for name, w in each]
        return table_html(f"{len(self.pulse_width_us)} allocations", ("channel", "pulse widths"), rows)


@dataclass(frozen=True, eq=False)
class Allocation(ByName, ReadOnly):
    """Pulse widths for a wanted torque; `allocation["left_femoral"]` is one, `allocation.torque("left_knee_flexion")`
    what a joint gets. Arrays without names are in the order of `names` and `joints`.

    Attributes
    ----------
    recruitment, pulse_width_us
        (n,) fraction 0 to 1 and us, per channel in the order of `names`.
    wanted, achieved
        (joints,) N m.
    gradient
        (n,) slope of the cost over recruitment: negative at a limit that holds a channel down.
    lower, upper
        (n,) limits of recruitment that applied.
    previous
        (n,) recruitments that were in force before.
    certificate
        Recomputed from the moment arms; None where the choice is not convex (then `gap` speaks).
    gap
        No choice costs less than this one minus `gap` (of the cost divided by the certificate's scale).
    problem
        Names, moment arms, weights, prices.
    """

    recruitment: np.ndarray
    pulse_width_us: np.ndarray
    wanted: np.ndarray
    achieved: np.ndarray
    gradient: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    previous: np.ndarray
    certificate: Certificate
    gap: float
    problem: AllocationProblem
    note: str = ""

    @property
    def shortfall(self) -> np.ndarray:
        """Wanted minus achieved torque, (joints,) N m."""
        return self.wanted - self.achieved

    @property
    def held(self) -> tuple[str, ...]:
        """One sentence per joint whose moment arms were taken at another angle than asked (`Nerves.held`)."""
        return self.problem.held

    @property
    def achieved_band(self) -> tuple[np.ndarray, np.ndarray]:
        """Torque of these pulse widths with the weakest and the strongest muscles that are likely, (joints,) N m."""
        low, high = self.problem.band
        return low * self.achieved, high * self.achieved

    @property
    def pulse_widths_us(self) -> dict[str, float]:
        """Pulse width per channel by name, us."""
        return dict(zip(self.names, self.pulse_width_us.tolist(), strict=True))

    @property
    def multipliers(self) -> dict[str, float]:
        """Price of every limit that binds, (N m)^2 per unit of recruitment: + for an upper limit, - for a lower one."""
        price = -self.gradient * self.certificate.scale
        binds = (self.lower < self.upper) & (np.abs(self.gradient) > NEGLIGIBLE)
        return {name: float(p) for name, p, b in zip(self.names, price, binds, strict=True) if b}

    @property
    def active(self) -> dict[str, str]:
        """The limit of each channel: `off`, `saturated`, `rising`, `falling`, `least`, `dead`, `limited`."""
        return {name: word for i, name in enumerate(self.names) if (word := self.limit(i))}

    def limit(self, i: int) -> str:
        """Return the limit that holds channel i; empty if none does."""
        r, problem = self.recruitment[i], self.problem
        if problem.upper[i] == 0.0 or not problem.matrix[:, i].any():
            return "dead"
        if r >= self.upper[i]:
            return "saturated" if r >= 1.0 else "limited" if r >= problem.upper[i] else "rising"
        if r <= self.lower[i] and r > problem.lower[i]:
            return "falling"
        if r <= 0.0:
            return "off"
        return "least" if problem.least is not None and r <= problem.least[i] else ""

    @property
    def reasons(self) -> list[str]:
        """One sentence per joint whose torque misses by `REPORTED_NM` or more, the worst first."""
        weighed = np.abs(self.shortfall) * (self.problem.weights > 0.0)
        return [self.reason(int(j)) for j in np.argsort(-weighed) if weighed[j] >= REPORTED_NM]

    def reason(self, j: int) -> str:
        """Why the torque of joint j misses."""
        short, wanted = self.shortfall[j], self.wanted[j]
        word = "short" if short * wanted > 0.0 else "too much"
        joint = self.joints[j].replace("_", " ")
        return f"{joint} {abs(short):.1f} N m {word}: {self.cause(j, np.sign(short))}"

    def cause(self, j: int, direction: float) -> str:
        """Return the reasons why joint j has no more torque in a direction."""
        problem = self.problem
        help_ = problem.nominal[j] * direction
        by_name = [name.replace("_", " ") for name in self.names]
        words = [self.limit(i) for i in range(len(self.names))]
        if not help_.any():
            weak = [name for name, column in zip(by_name, problem.nominal.T, strict=True) if not column.any()]
            return "no stimulated nerve turns it" + (f" ({', '.join(weak)} without strength)" if weak else "")
        stuck = {"saturated", "limited", "rising", "dead"}
        held = [int(i) for i in np.argsort(-help_) if help_[i] > 0.0 and words[i] in stuck]
        held += [int(i) for i in np.argsort(help_) if help_[i] < 0.0 and words[i] == "falling"]
        if held:
            strongest = max(abs(help_[i]) for i in held)
            named = [i for i in held if abs(help_[i]) >= WORTH_NAMING * strongest]
            return ", ".join(f"{by_name[i]} {words[i]}" for i in named[:3])
        if not (help_ > 0.0).any():
            return "no stimulated nerve pulls that way"
        return self.conflict(j, int(np.argmax(help_)), by_name)

    def conflict(self, j: int, i: int, by_name: list[str]) -> str:
        """Return what more of channel i, which would help joint j, makes worse."""
        problem = self.problem
        if problem.least is not None and self.recruitment[i] == 0.0:
            return f"{by_name[i]} off: its least recruitment would be too much"
        costs = -problem.weights * self.shortfall * problem.matrix[:, i] / problem.scale
        k = int(np.argmax(costs))
        if k == j or costs[k] < float(problem.prices[i] * self.recruitment[i]):
            return f"more {by_name[i]} is not worth its effort"
        return f"more {by_name[i]} would spoil {self.joints[k].replace('_', ' ')}"

    def to_frame(self) -> DataFrame:
        """Pulse width, us, recruitment and what holds it at a limit, a row each channel, as a frame of pandas."""
        columns = {"channel": self.names, "pulse_width_us": self.pulse_width_us, "recruitment": self.recruitment}
        return frame({**columns, "limit": [self.limit(i) for i in range(len(self.names))]}, "channel")

    def torques(self) -> DataFrame:
        """Torque wanted, achieved, and achieved by the weakest and strongest muscles likely, N m, a row each joint."""
        least, most = np.sort(self.achieved_band, axis=0)
        columns = {"joint": self.joints, "wanted": self.wanted, "achieved": self.achieved}
        return frame({**columns, "least": least, "greatest": most}, "joint")

    def _repr_html_(self) -> str:
        held = self.active
        each = zip(self.names, self.pulse_width_us, self.recruitment, strict=True)
        rows = [(name, f"{us:.0f} us", f"{r:.3f}", held.get(name, "")) for name, us, r in each]
        return table_html("Allocation", ("channel", "pulse width", "recruitment", ""), rows, str(self).splitlines()[1:])

    def as_dict(self) -> dict[str, Any]:
        """The answer in plain types, by name: pulse widths us, recruitments, torques N m with their band, reasons.

        `strength_band` holds the factors on the strength assumed that the bands of the torques belong to.
        """
        bands = np.sort(self.achieved_band, axis=0).T.tolist()
        torques = zip(self.joints, self.wanted.tolist(), self.achieved.tolist(), bands, strict=True)
        return {
            "pulse_width_us": self.pulse_widths_us,
            "recruitment": dict(zip(self.names, self.recruitment.tolist(), strict=True)),
            "torque_nm": {n: {"wanted": w, "achieved": a, "band": band} for n, w, a, band in torques if w or a},
            "strength_band": list(self.problem.band),
            "reasons": self.reasons,
            "assumed": self.problem.assumed,
            "held": list(self.held),
            "residual": float(self.certificate.residual),
            "gap": float(self.gap),
        }

    def band_lines(self) -> list[str]:
        """Return the torques of these pulse widths if the muscles are weaker or stronger than assumed."""
        low, high = self.achieved_band
        shown = [j for j in range(len(self.joints)) if self.wanted[j] and abs(self.achieved[j]) >= REPORTED_NM]
        weak, strong = self.problem.band
        if weak == strong or not shown:
            return []
        parts = [f"{self.joints[j].replace('_', ' ')} {low[j]:.1f} to {high[j]:.1f} N m" for j in shown]
        return [f"with {weak:.2g} to {strong:.2g} of the strength assumed: {', '.join(parts)}"]

    def achieved_lines(self) -> list[str]:
        """Return the torques that were wanted, with what is achieved of them."""
        each = zip(self.joints, self.achieved, self.wanted, strict=True)
        parts = [f"{name.replace('_', ' ')} {got:.1f} of {asked:.1f} N m" for name, got, asked in each if asked]
        return [f"achieved: {', '.join(parts)}"] if parts else []

    def __str__(self) -> str:
        each = zip(self.names, self.pulse_width_us, strict=True)
        on = [f"{name.replace('_', ' ')} {width:.0f} us" for name, width in each if width > 0.0]
        lines = [", ".join(on) or "nothing stimulated", *self.achieved_lines()]
        lines += self.reasons or [f"every torque within {REPORTED_NM:g} N m"]
        assumed = [f"assumed: {self.problem.assumed}"] if self.problem.assumed else []
        lines += [*self.band_lines(), *assumed, *self.held]
        residual, is_exact = max(self.certificate.residual, 0.0), self.problem.least is None
        proof = f"optimal to {residual:.0e}" if is_exact else f"gap {self.gap:.0e}"
        return "\n".join([*lines, f"{proof}{'; ' + self.note if self.note else ''}"])


@dataclass(frozen=True, eq=False)
class AllocationSequence(ByName, ReadOnly):
    """Allocations of a torque over time, as arrays.

    Attributes
    ----------
    recruitment, pulse_width_us
        (samples, n), in the order of `names`.
    wanted, achieved
        (samples, joints), N m, in the order of `joints`.
    residual
        (samples,) recomputed greatest residual of the optimality conditions (see `Certificate`).
    problem
        Names, moment arms, weights, prices.
    """

    recruitment: np.ndarray
    pulse_width_us: np.ndarray
    wanted: np.ndarray
    achieved: np.ndarray
    residual: np.ndarray
    problem: AllocationProblem

    @property
    def shortfall(self) -> np.ndarray:
        """Wanted minus achieved torque, (samples, joints), N m."""
        return self.wanted - self.achieved
