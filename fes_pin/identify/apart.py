"""By how much one fit must be likelier than another before data tell them apart.

With Delta the difference of their whitened residuals, what the right one of two is likelier by, in twice the
log-likelihood, has the mean |Delta|^2 and scatters by 2 |Delta|, or as pieces of the data show where that is more. The
wrong one is likelier by `SEPARABLE` in no more than 5 % of cases, however far apart they are. Where one is likelier by
less than it must be if it were right, at `CLAIM_LEVEL`, neither is right, and which is nearer is told where the pieces
agree on it.

Source: Cox, Tests of separate families of hypotheses, 4th Berkeley Symposium 1, 1961; Vuong, Likelihood ratio tests for
model selection and non-nested hypotheses, Econometrica 57 (1989).
"""

from __future__ import annotations

import math

import numpy as np

from fes_pin.identify.fit import Fit
from fes_pin.identify.scatter import in_pieces
from fes_pin.infer.distributions import normal_quantile
from fes_pin.infer.levels import CLAIM_LEVEL, SEPARABLE, SURE


def least_apart(likelier: Fit, other: Fit) -> float:
    """Twice the log-likelihood by which a fit must be likelier than another of the same trials to be told from it."""
    pairs = [(a.residual, b.residual) for a, b in zip(likelier.parts, other.parts, strict=True)]
    if any(a.shape != b.shape for a, b in pairs):
        return SEPARABLE
    squares = float(sum((a - b) @ (a - b) for a, b in pairs))
    gains = np.concatenate([in_pieces(b**2 - a**2, len(pairs)) for a, b in pairs])
    scatter = math.sqrt(len(gains)) * float(np.std(gains, ddof=1))
    least = squares - normal_quantile(1.0 - CLAIM_LEVEL) * max(scatter, 2.0 * math.sqrt(squares))
    return SEPARABLE if other.sse - likelier.sse >= least else max(SEPARABLE, SURE * scatter)
