"""The numbers that decide what is claimed: levels, penalties, shares and orders, each with its source.

All other numbers of inference say how something is sought, guard arithmetic, or describe a sensor or a person; their
kinds stand in docs/data/numbers.toml.
"""

from __future__ import annotations

from fes_pin.infer.distributions import chi2_quantile, normal_quantile

# Levels of tests

UNUSUAL_LEVEL = 0.05
"""Level of a single test: of a coefficient, an interval, a further round of fits. By convention (Fisher 1925)."""
CLAIM_LEVEL = 0.01
"""Family-wise error of each round of claims: over all causes, all trials that may be misread, all changes, all forms
of a set, all tests of lack of fit. Theory: five rounds keep a diagnosis below `UNUSUAL_LEVEL` (Bonferroni)."""
DRIVEN_LEVEL = 1e-3
"""Family-wise error where process noise acts: its spectrum is estimated, and the real one has another form.
Simulation: `scripts/accuracy driven --nulls` prints the p-values of rigs in which nothing is hidden; the least of 54
was 0.002."""
CERTAIN_LEVEL = 1e-6
"""Level at which something acts whatever its name. Theory: a test that is repeated 10 000 times, in each of a
cohort's studies, still alarms in less than `CLAIM_LEVEL` of all."""
WALK_LEVEL = 1e-4
"""Family-wise error of a cause of a walk against the simulated null. Simulation: `scripts/accuracy walking --nulls`
counts alarms in soft tissue of other laws than the null's, which are more."""
CONFIDENCE_95 = normal_quantile(1.0 - 0.5 * UNUSUAL_LEVEL)
"""Half a 95 % interval of a normal variable, in standard deviations. Theory."""
SURE = normal_quantile(1.0 - UNUSUAL_LEVEL)
"""Standard deviations that 95 of 100 normal variables stay below. Theory."""
SEEN_POWER = 1.0 - UNUSUAL_LEVEL
"""Power of a test at the size from which on a change is excluded. Theory: the error of the second kind is that of
the first."""

# Penalties and differences of twice the log-likelihood

PARAMETER_PENALTY = float(chi2_quantile(1.0 - UNUSUAL_LEVEL, 1))
"""Penalty for a parameter, or a coefficient of the noise. Theory: a single test at `UNUSUAL_LEVEL` (Wilks 1938)."""
SEPARABLE = SURE**2
"""Difference at which a rival is told apart at 95 %. Theory: the square of `SURE`."""
CERTAIN_GAIN = float(chi2_quantile(1.0 - CERTAIN_LEVEL, 1))
"""Gain of one parameter at `CERTAIN_LEVEL`. Theory (Wilks 1938)."""
STRONG_EVIDENCE = 6.0
"""Difference at which one set is preferred to another where sizes have priors: odds of 20 to 1. Literature: R. E.
Kass and A. E. Raftery, Bayes factors, J. Am. Stat. Assoc. 90:773, 1995."""
MISREAD_SCORE = 10.0
"""Score of a trial that is looked at as misread. Theory: three standard deviations, rounded up."""

# Shares

SMALL_SHARE = 0.1
"""Share of a whole, in amplitude, that is small. Theory: it adds half a percent to a root mean square."""
FORM_SHARE = 0.0625
"""Share of the gain of all causes that an error of form leaves. Theory: an error of a quarter in a cause's form
leaves a quarter, squared, of its likelihood to whatever other cause comes near."""
IDENTIFIABLE_SHARE = 0.04
"""Share of its norm that a sensitivity must keep, once fitted parameters are projected off, to be testable. Theory:
a share s inflates a standard deviation by 1 / s, here 25 times (variance inflation: Belsley, Kuh and Welsch
1980)."""
UNFELT = 1e-4
"""Share of the largest of several squares, or eigenvalues, below which one says nothing. Theory: a hundredth in
amplitude, a tenth of `SMALL_SHARE`."""
SMALL_PERCENT = 100.0 * SMALL_SHARE**2
"""Error E that is small, in percent. Literature: a tenth of what Dombre, Fournier and Coiffet call a good fit."""
NOTHING_PERCENT = SMALL_SHARE * SMALL_PERCENT
"""Gain that is nothing, in percent. Theory: a small share of a small error."""
RUNAWAY = 10.0
"""Times the largest reading beyond which a prediction is lost. Theory: the inverse of `SMALL_SHARE`; how far a
divergent simulation goes says nothing."""
REVERSED_LEAVES = 0.3
"""Share of the squared error that is left at most where an effort counts the other way. Theory: a model that leaves
more than half of the amplitude says nothing of a sign."""
ALIKE_COSINE = 0.99
"""Cosine of two sensitivities from which on causes look alike. Theory: to tell them apart at 95 % either must stand
out by 23 standard deviations, 1.645 sqrt(2 / (1 - cosine))."""
EXPLAINED_AS_WELL = 2.0
"""Ratio of mean squares from which on a restated trial is not explained as the others are. Theory: the upper 5 % of
Fisher's F of 20 and 20 degrees is 2.1."""
EFFORT_NOISE_SHARE = 1e-3
"""Share of the process noise's spectrum from which on white noise of the recorded effort counts. Theory: less
changes no deviation by a thousandth."""

# Numbers of trials, causes and samples

FEWEST_STATED = 4
"""Trials that state a condition, at least, to ask whether one is misread. Theory: Student's t needs the scatter of
three others."""
MOST_CAUSES = 3
"""Causes of a set, at most. Theory: each further one multiplies the sets that are searched by the library's size."""
MOST_ITEMS = 5
"""Common causes and changes of a set, at most. Theory: as `MOST_CAUSES`, with two changes."""
SHORT_NOISE = 2
"""Order of the noise where bursts, repeats and uneven noise are tested. Theory: these tests hold for any spectrum,
and a longer autoregression learns slow deviations as noise."""
FULL_NOISE = 24
"""Order of the noise where slips and play are tested. Simulation: `scripts/benchmarks/adequate.py`; it whitens a
random torque down to the lowest frequencies, and at 4 ms a sample reaches back 0.1 s, too short to learn a jump that
lasts."""
WHITE_SHARE = 0.003
"""Share of the residual's variance that is taken for white noise on top of the autoregression. Theory: it bounds the
depth of a notch, so that no filter becomes a resonator that swallows a misfit."""
SEEN_DEVIATIONS = 3.0
"""Standard deviations by which a cause of plausible size must stand out to be testable in a walk. Theory: power 0.85
at a two-sided level of 5 %."""
POSSIBLE_SIZES = 3.0
"""Times a plausible size beyond which a size of a cause of a walk is impossible. Theory: three standard deviations
of its prior."""

# Times and lateness

HORIZON_S = 0.3
"""Default horizon of predictions, s. Literature: six time constants from stimulus to force of Dombre, Fournier and
Coiffet's ankle."""
AVERAGED_S = 0.05
"""Time over which process noise is averaged before its size is judged, s. Literature: the time constant from
stimulus to force of Dombre, Fournier and Coiffet's ankle; what is faster moves no limb."""
LEAST_SHIFT_S = 0.1
"""Shift of a trial's readings that is no lag of the rig, s. Literature: muscles answer within 0.1 s (Cavanagh and
Komi, Eur. J. Appl. Physiol. 42, 1979)."""
LEAST_LATE_ROWS = 0.25
"""Rows of a log by which an effort is late, at least. Theory: a log of every second sample of a controller writes an
effort that holds for half a row a quarter of a row late in the mean."""
MOST_LATE_ROWS = 2.0
"""Rows by which an effort may be late. Theory: it is held for one row when it is written, and for one until the
next."""
MOST_EARLY_ROWS = 0.5
"""Rows by which an effort may act after it was written. Theory: an effort that is held acts half a row late in the
mean; what is more is a lag."""

# What a controller, or a filter, did to a record

ANSWERED = 1.0 / 6.0
"""Share of a stimulus, beyond what its past predicts, that readings predict where a controller answers them.
Simulation: `tests/identify/test_feedback.py` (written by a script: 0.10 at most) and
`tests/driven/test_stimulated.py` (a controller: 0.23 at least)."""
SMOOTH = 0.3
"""Noise from sample to sample, as a share of the residual, from which on a record is as it was read. Theory:
averages of ten samples have 1 / sqrt(10) = 0.32 of white noise's; `tests/diagnosis/test_low_passed.py` holds both
sides."""
