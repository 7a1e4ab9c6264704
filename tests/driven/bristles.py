"""A slide under position control whose friction is that of bristles, integrated without the engine."""

from __future__ import annotations

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.models.model import Model
from fes_pin.models.rigs import Joint

MASS, DAMPING, FRICTION, STIFFNESS, BRISTLE_DAMPING = 95.0, 200.0, 20.0, 2e6, 1.5e4
DT, SECONDS, STEP = 0.004, 15.0, 1e-4
"""A contact of about 10 um before it slips; integration steps of a fiftieth of what it rings with."""


def moved(rng: np.random.Generator, dt: float, seconds: float) -> np.ndarray:
    """Smooth moves from place to place, with rests between."""
    t = np.arange(round(seconds / dt)) * dt
    out, place, begin = np.zeros_like(t), 0.0, 0.5
    while begin < seconds - 2.0:
        share = np.clip((t - begin) / rng.uniform(0.7, 1.5), 0.0, 1.0)
        target = rng.uniform(0.0, 0.25)
        out += (target - place) * share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        place, begin = target, begin + rng.uniform(1.2, 2.5)
    return out


def trial(
    seed: int, dt: float = DT, seconds: float = SECONDS, contact: tuple[float, float] = (STIFFNESS, BRISTLE_DAMPING)
) -> Trial:
    """LuGre's friction: z' = v - |v| z / g, force stiffness z + damping z', by semi-implicit Euler steps.

    `contact` has the stiffness and the damping.

    Source: Canudas de Wit, Olsson, Astrom and Lischinsky, A new model for control of systems with friction, IEEE
    Transactions on Automatic Control 40 (1995).
    """
    rng = np.random.default_rng(seed)
    wanted, steps = moved(rng, dt, seconds), round(dt / STEP)
    n, h, newest = len(wanted), dt / steps, 1.0 - 0.5 ** (dt / 0.004)
    effort, position, g = np.empty(n), np.empty(n), FRICTION / contact[0]
    q = v = z = random = lagged = last = 0.0
    for k in range(n):
        position[k] = 2e-6 * round(q / 2e-6) + 3e-7 * rng.normal()
        lagged += newest * ((position[k] - last) / dt - lagged)
        last = position[k]
        effort[k] = 2000.0 * (15.0 * (wanted[k] - position[k]) - lagged)
        random += -random * dt / 0.05 + 1.5 * np.sqrt(2.0 * dt / 0.05) * rng.normal()  # N, of 1.5 N and 50 ms
        for _ in range(steps):
            z = (z + h * v) / (1.0 + h * abs(v) / g)
            bristles = contact[0] * z + contact[1] * (v - abs(v) * z / g)
            v += h * (effort[k] + random - DAMPING * v - bristles) / MASS
            q += h * v
    return Trial(f"{seed:02d}", "motion", {"effort": effort, "position": position}, np.arange(n) * dt)


def believed() -> Model:
    """The slide without friction, of another mass and damping."""
    return Model(
        Joint(0.8, 120.0, 0.0, constants={"inertia": MASS, "gravity_cos": 0.0, "gravity_sin": 0.0, "revolute": 0.0})
    )
