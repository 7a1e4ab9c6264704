"""Section II of the paper: its two trials as twins, k1, k2 and k3 with their domain of E, what trials determine."""
