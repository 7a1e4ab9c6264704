"""What residuals without a cause show: the law of the best gain, and how wide values scatter."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Nulls:
    """What simulated residuals without a cause show.

    Attributes
    ----------
    gains
        (draws,) of the best form, price paid.
    spread
        By form, (p,) root mean square of value over standard deviation: 1 where the likelihood's intervals are right.
    """

    gains: np.ndarray = field(repr=False)
    spread: tuple[np.ndarray, ...] = field(repr=False)

    @property
    def _gumbel(self) -> tuple[float, float]:
        """Place and scale of the maxima's Gumbel distribution, by moments."""
        scale = max(float(np.std(self.gains)) * np.sqrt(6.0) / np.pi, 1e-6)
        return float(np.mean(self.gains)) - float(np.euler_gamma) * scale, scale

    def critical(self, level: float) -> float:
        """A gain that is exceeded with this chance; no less than 0."""
        place, scale = self._gumbel
        return max(place - scale * float(np.log(-np.log1p(-level))), 0.0)

    def p_value(self, gain: float) -> float:
        """Chance of at least this gain."""
        place, scale = self._gumbel
        return float(max(-np.expm1(-np.exp(-(gain - place) / scale)), 1e-300))
