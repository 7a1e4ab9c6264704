"""Levels at which something is said: shares of rigs, with nothing to say of, of which it is said all the same."""

from __future__ import annotations

CLAIM_LEVEL = 0.01
"""Family-wise error of each round of claims, over all causes, all trials and conditions that may be misread, or all
changes; with the tests of the remainder (0.02) a diagnosis stays below 5 %, with room for noise that is not quite
autoregressive."""
DRIVEN_LEVEL = 1e-3
"""The same of rigs that are judged by the likelihood. 54 driven rigs with nothing hidden brought p-values of 0.002 and
0.004 (`scripts/driven --nulls`): as many as 0.01 allows, more than a person who is told a name would accept. What acts
in a rig that is recorded for a minute is far beyond either."""
REFINE_LEVEL = 1e-3
"""At which a refinement of an effect's form is adopted: some ten forms are tried for a set."""
EXTEND_LEVEL = 0.1
"""At which a further cause, by its score or by smooth features of what is left, is worth a round of joint fits."""
CERTAIN_LEVEL = 1e-6
"""At which something is there, whatever it stands for: a cause whose name held-out trials refuse, or an effort that
was written down late."""
FEEDBACK_LEVEL = 1e-9
"""At which an effort answers what is read: the noise of a reading comes back through a controller in thousands of
samples."""
