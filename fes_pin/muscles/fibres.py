"""Force of a fully active muscle over its length and speed: fibres in series with a tendon that gives way."""

import numpy as np

ACTIVE_WIDTH = 0.45
"""Width of the Gaussian active force-length curve (Thelen 2003, J. Biomech. Eng. 125:70-77, table 1)."""
TENDON_STRAIN = 0.033
"""Strain of the tendon at the largest isometric force: the source model's own (tables/SOURCE.md), as in Zajac 1989."""
TOE_FORCE, TOE_SHAPE, TOE_STRAIN, STIFF = 0.33, 3.0, 0.609, 1.712
"""Tendon: exponential up to a third of the force at `TOE_STRAIN` of `TENDON_STRAIN`, then straight (Thelen 2003)."""
SHORTENING_LIMIT = 10.0
"""Fastest shortening, optimal fibre lengths per second (Thelen 2003)."""
HILL_SHAPE = 0.25
"""Curvature a/F0 of Hill's hyperbola (Thelen 2003); lengthening reaches 1.4 times the isometric force."""
LENGTHENING_FORCE = 1.4
HALVINGS = 36
"""Bisections of the interval of the tendon's length, which reduce it to less than 1e-11 m."""
LEAST_ALONG = 1e-4
"""Shortest extent of fibres along the tendon, m."""


def tendon_force(strain: np.ndarray) -> np.ndarray:
    """Force of a tendon by its strain, 1 at the muscle's largest isometric force, 0 where it is slack."""
    toe = TOE_STRAIN * TENDON_STRAIN
    bent = TOE_FORCE * np.expm1(TOE_SHAPE * np.clip(strain, 0.0, toe) / toe) / np.expm1(TOE_SHAPE)
    return np.where(strain < toe, bent, STIFF * (strain - toe) / TENDON_STRAIN + TOE_FORCE)


def active_force(fibre: np.ndarray) -> np.ndarray:
    """Isometric force of fully active fibres by their length, 1 at the optimal length, which has length 1."""
    return np.exp(-((fibre - 1.0) ** 2) / ACTIVE_WIDTH)


def isometric_force(length, fibre, tendon, pennation) -> np.ndarray:
    """Force along the tendon of a fully active muscle at rest, as a fraction of its largest isometric force.

    Fibres and tendon in equilibrium; fibres keep their thickness, so the pennation grows as they shorten. The tendon
    fits its muscle: one that has wasted has a weaker tendon, so the fraction does not depend on strength.

    Parameters
    ----------
    length
        Of muscle and tendon, (..., m) m.
    fibre, tendon, pennation
        Optimal fibre length and tendon slack length, m, and pennation at the optimal length, rad: (m,).
    """
    thickness = np.sin(pennation) * fibre
    low = np.broadcast_to(tendon, np.shape(length)).copy()
    high = np.maximum(low, length)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        too_short = tendon_force(middle / tendon - 1.0) < _along(length - middle, fibre, thickness)
        low, high = np.where(too_short, middle, low), np.where(too_short, high, middle)
    return _along(length - 0.5 * (low + high), fibre, thickness)


def _along(extent: np.ndarray, fibre: np.ndarray, thickness: np.ndarray) -> np.ndarray:
    """Force along the tendon of fibres that extend so far along it."""
    extent = np.maximum(extent, LEAST_ALONG)
    size = np.hypot(extent, thickness)
    return active_force(size / fibre) * extent / size


def velocity_factor(speed: np.ndarray) -> np.ndarray:
    """Force-velocity factor (Hill), 1 at rest, by the fibres' lengthening in optimal lengths per second."""
    relative = np.maximum(speed / SHORTENING_LIMIT, -1.0)
    shortening = (1.0 + relative) / (1.0 - np.minimum(relative, 0.0) / HILL_SHAPE)
    faster = np.maximum(relative, 0.0) * (1.0 + 1.0 / HILL_SHAPE) / (LENGTHENING_FORCE - 1.0)
    return np.where(relative < 0.0, shortening, (1.0 + LENGTHENING_FORCE * faster) / (1.0 + faster))
