"""Levels at which something is said, and the prices and shares that go with them.

A level is the share of rigs, with nothing to say of, of which it is said all the same.
"""

from __future__ import annotations

from fes_pin.infer.distributions import chi2_quantile, normal_quantile

UNUSUAL_LEVEL = 0.05
"""At which something is unusual by itself: a parameter or a coefficient earns its price there, an interval ends, a set
is worth a round of joint fits more, and repeats are more apart than others."""
CLAIM_LEVEL = 0.01
"""Family-wise error of each round of claims: over all causes, all trials and conditions that may be misread, all
changes, all forms of a set that are tried, or all tests of what is left. A diagnosis stays below 5 %, with room for
noise that is not quite autoregressive."""
DRIVEN_LEVEL = 1e-3
"""The same where a random effort acts in what is judged by the likelihood. 54 driven rigs with nothing hidden brought
p-values of 0.002 and 0.004 (`scripts/accuracy driven --nulls`): as many as 0.01 allows, more than a person who is
told a name would accept. What acts in a rig that is recorded for a minute is far beyond either."""
CERTAIN_LEVEL = 1e-6
"""At which something is there, whatever it stands for: a cause whose name held-out trials refuse, a further score, an
effort that answers its reading or was written down late."""
ABSORBED_BELOW = 0.04
"""Share of its norm that an effect's sensitivity, or what a test looks for, must keep beside what the fit takes up to
be testable."""
SMALL_SHARE = 0.1
"""Part of a whole that is small beside it, in amplitude: a random effort beside what drives a rig, an error beside the
motion, noise from sample to sample beside all that is left, what an innovation has in common with the next. A tenth of
an error that is small anyway is nothing. A low pass must take as much of the power of what is new in a sample."""
UNFELT = 1e-4
"""Share of the largest of several squares, or eigenvalues, below which one says nothing: a hundredth in amplitude, a
tenth of what is small (`SMALL_SHARE`)."""
FORM_SHARE = 0.0625
"""Share of what all causes explain that an error of form leaves: a real cause differs from its equation, and an error
of a quarter in its form leaves a sixteenth of its likelihood to whatever else comes near."""
RUNAWAY = 10.0
"""A prediction is lost where it is so many times as far off as readings ever are, or enlarges an error of its beginning
so many times: where it goes to says nothing, and it counts as no farther off."""

SMALL_PERCENT = 100.0 * SMALL_SHARE**2
"""Error E that is small: 1 %, a tenth of what Dombre, Fournier and Coiffet take for a good one."""
NOTHING_PERCENT = SMALL_SHARE * SMALL_PERCENT
"""Gain of a cause beside others that is nothing: lags and hums that were not there made up to 0.04 % beside forms that
are not the library's (`scripts/accuracy imposed`, seeds 991015 and 992000); of the second causes of nine drawn rigs
the low end was 0.27 % and more."""
CONFIDENCE_95 = normal_quantile(1.0 - 0.5 * UNUSUAL_LEVEL)
"""Half a 95 % interval of a normal variable, in standard deviations."""
PARAMETER_PRICE = float(chi2_quantile(1.0 - UNUSUAL_LEVEL, 1))
"""Twice the log-likelihood that one more parameter must earn, or one more coefficient of a noise."""
SURE = normal_quantile(1.0 - UNUSUAL_LEVEL)
"""Deviations of a normal variable that 95 in 100 stay within, on one side."""
SEPARABLE = SURE**2
"""Twice the log-likelihood by which a rival must fall short to be told apart at 95 %: the square of `SURE`."""
CERTAIN_GAIN = float(chi2_quantile(1.0 - CERTAIN_LEVEL, 1))
"""Twice the log-likelihood that one parameter gains where it is certain that it stands for something."""
