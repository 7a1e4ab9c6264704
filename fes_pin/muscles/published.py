"""Strength of other people relative to a healthy young man, from measured joint torques."""

import numpy as np

PEAKS_2007 = {
    ("man", "18 to 25"): (0.161, 0.113, 0.163, 0.087, 0.095, 0.033),
    ("man", "55 to 65"): (0.171, 0.107, 0.156, 0.081, 0.114, 0.028),
    ("man", "over 65"): (0.144, 0.101, 0.137, 0.069, 0.106, 0.029),
    ("woman", "18 to 25"): (0.181, 0.127, 0.159, 0.080, 0.104, 0.027),
    ("woman", "55 to 65"): (0.140, 0.091, 0.128, 0.060, 0.093, 0.024),
    ("woman", "over 65"): (0.138, 0.081, 0.124, 0.060, 0.125, 0.022),
}
"""Peak torques, per body weight times height, of hip extension and flexion, knee extension and flexion, plantarflexion
and dorsiflexion, by sex and years: D. E. Anderson, M. L. Madigan, M. A. Nussbaum, J. Biomech. 40:3105-3113, 2007, table
3 (as the muscle add-on of RBDL has it; the article was not at hand)."""


def share_of_a_young_mans(who: str, years: str) -> float:
    """Strength of a group over that of men of 18 to 25, of the same weight and height: mean of six actions."""
    young = np.array(PEAKS_2007["man", "18 to 25"])
    return float(np.mean(np.array(PEAKS_2007[who, years]) / young))
