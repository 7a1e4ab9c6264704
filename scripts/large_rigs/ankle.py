"""Ankles whose threshold, friction or base is far from what is believed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from confusion_matrix.rigs import LOADS_KG, draw_plant
from scipy.optimize import brentq

from fes_pin.paper.equation_1 import static_torque_nm
from large_rigs.recorded import HOLD, Drawn, Take, changes, held, log_uniform, simulated

CAUSES = (("threshold_shift",), ("threshold_shift",), ("coulomb_friction",), ("threshold_shift", "coulomb_friction"))
SHIFT = (0.15, 0.48)
"""How far the threshold is off, as a share of the range from threshold to saturation."""
DT, SECONDS = 0.005, 7.2
GRAVITY = 9.81


class Ankle(NamedTuple):
    """An ankle as it is: numbers of equation (1), what is hidden, and how sharp friction is, rad/s."""

    k: dict[str, float]
    shift_us: float
    friction_nm: float
    sharp: float

    def run(self, time: np.ndarray, width: np.ndarray, load_kg: float) -> np.ndarray:
        """Angles at the samples, rad, shape (n,): from rest."""
        k = self.k
        drive = (width - self.shift_us - k["threshold_us"]) / (k["saturation_us"] - k["threshold_us"])

        def torque(q: float, force: float) -> float:
            return float(static_torque_nm(k, q, force, load_kg, 0.0))

        def rates(t: float, x: np.ndarray, r: float) -> list[float]:
            act, q, v = x
            total = torque(q, k["gain"] * k["force_scale_n"] * act) - k["damping_nms"] * v
            total -= self.friction_nm * np.tanh(v / self.sharp)
            return [(r - act) / k["time_constant_s"], v, total / k["inertia_kgm2"]]

        rests = brentq(lambda q: torque(q, 0.0), 0.3, 3.0, xtol=1e-13)
        return simulated(rates, [0.0, rests, 0.0], time, *changes(np.clip(drive, 0.0, 1.0), time))[:, 1]


def draw(family: str, hidden: tuple[str, ...], trials: int, faster: int, rng: np.random.Generator) -> Drawn:
    """An ankle with these causes hidden."""
    plant = draw_plant(rng, "ankle", 0.0)
    k, true = dict(plant.known), dict(plant.true)
    shift = float(rng.choice([-1.0, 1.0])) * rng.uniform(*SHIFT) * (k["saturation_us"] - k["threshold_us"])
    friction = rng.uniform(0.1, 0.3) * k["com_distance_m"] * GRAVITY
    speed = 3.0
    ankle = Ankle({**k, **true}, shift, friction, speed * log_uniform(rng, 1e-4, 1e-2))
    ankle = ankle._replace(shift_us=shift if "threshold_shift" in hidden else 0.0)
    ankle = ankle._replace(friction_nm=friction if "coulomb_friction" in hidden else 0.0)
    takes = [_take(ankle, LOADS_KG[n % 2], faster, rng) for n in range(trials + 1)]
    wrong = {"damping_nms": (0.1, 10.0)}
    start = {n: float(f"{v * log_uniform(rng, *wrong.get(n, (0.5, 2.0))):.4g}") for n, v in true.items()}
    hidden_sizes = {"threshold_shift.shift_us": ankle.shift_us, "coulomb_friction.torque_nm": ankle.friction_nm}
    truth = {**true, **{n: v for n, v in hidden_sizes.items() if v}}
    size = max(float(np.ptp(t.values)) for t in takes)
    return Drawn("ankle", k, start, truth, takes[:-1], takes[-1], size)


def _take(ankle: Ankle, load_kg: float, faster: int, rng: np.random.Generator) -> Take:
    time = np.arange(round(SECONDS / DT) * faster) * (DT / faster)
    width = _widths(len(time) // (HOLD * faster), rng)
    width = held(width, HOLD * faster, len(time))
    inputs = {"pulse_width_us": width}
    return Take(DT / faster, "angle_rad", ankle.run(time, width, load_kg), inputs, conditions={"load_kg": load_kg})


def _widths(count: int, rng: np.random.Generator) -> np.ndarray:
    """Pulse widths in steps and ramps from off to saturation, us, shape (n,): off for the first 0.4 s."""
    out, at = np.zeros(count), round(0.4 / (HOLD * DT))
    while at < count:
        lasts = int(rng.integers(8, 35))
        ends = rng.uniform(200.0, 1000.0, 2)
        ramp = np.linspace(*ends, lasts) if rng.random() < 0.3 else np.full(lasts, ends[0])
        out[at : at + lasts] = np.round(ramp[: count - at])
        at += lasts + int(rng.integers(0, 20))
    return out
