"""The constants that decide about claims: levels, penalties, shares and orders, each with its source.

The kinds of all other constants of inference are in docs/data/numbers.toml: most of them control an algorithm, guard
arithmetic, or describe a sensor or a person.
"""

from fes_pin.infer.distributions import chi2_quantile, normal_quantile

# Levels of tests

UNUSUAL_LEVEL = 0.05
"""Level of a single test: of a coefficient, an interval, a further round of fits. By convention (Fisher 1925)."""
CLAIM_LEVEL = 0.01
"""Family-wise error of each round of claims: over all causes, all trials that may be misread, all changes, all forms
of a set, all tests of lack of fit. Theory: five rounds keep a diagnosis below `UNUSUAL_LEVEL` (Bonferroni)."""
DRIVEN_LEVEL = 1e-3
"""Family-wise error where process noise acts: its spectrum is estimated, and the real one has another form.
Simulation: `scripts/accuracy driven --hidden 0` prints the p-values of rigs in which nothing is hidden; the least of 54
was 0.002."""
CERTAIN_LEVEL = 1e-6
"""Level at which an effect is certain, even if its cause is not. Theory: a test that is repeated 10 000 times, in each
study of a cohort, still alarms in less than `CLAIM_LEVEL` of all."""
WALK_LEVEL = 1e-4
"""Family-wise error of a cause of a walk against the simulated null. Simulation: `scripts/accuracy walking --hidden 0`
counts alarms where soft tissue follows other laws than in the null; these are more."""
CONFIDENCE_95 = normal_quantile(1.0 - 0.5 * UNUSUAL_LEVEL)
"""Half a 95 % interval of a normal variable, in standard deviations. Theory."""
SURE = normal_quantile(1.0 - UNUSUAL_LEVEL)
"""95 % quantile of a normal variable, in standard deviations. Theory."""
SEEN_POWER = 1.0 - UNUSUAL_LEVEL
"""Power of a test at the size above which a change is excluded. Theory: the error of the second kind equals that of the
first."""

# Penalties and differences of twice the log-likelihood

PARAMETER_PENALTY = float(chi2_quantile(1.0 - UNUSUAL_LEVEL, 1))
"""Penalty for a parameter, or a coefficient of the noise. Theory: a single test at `UNUSUAL_LEVEL` (Wilks 1938)."""
SEPARABLE = SURE**2
"""Difference at which a rival is distinguished at 95 %. Theory: the square of `SURE`."""
CERTAIN_GAIN = float(chi2_quantile(1.0 - CERTAIN_LEVEL, 1))
"""Gain of one parameter at `CERTAIN_LEVEL`. Theory (Wilks 1938)."""
STRONG_EVIDENCE = 6.0
"""Difference at which one set is preferred to another where sizes have priors: odds of 20 to 1. Literature: R. E.
Kass and A. E. Raftery, Bayes factors, J. Am. Stat. Assoc. 90:773, 1995."""
MISREAD_SCORE = 10.0
"""Score at which a trial is tested for a misread condition. Theory: three standard deviations, squared, rounded up."""

# Shares

SMALL_SHARE = 0.1
"""Small share of a whole, in amplitude. Theory: it adds half a percent to a root mean square."""
FORM_SHARE = 0.25**2
"""Share of the squared error of all causes that an error of form may leave. Theory: an error of a quarter in a cause's
form leaves a quarter, squared, of what the cause explains to another, similar cause."""
FORM_GAIN = FORM_SHARE
"""Share of the gain of all causes in log-likelihood that it may leave. Theory: the same, as the log-likelihood of small
errors is proportional to their squares."""
IDENTIFIABLE_SHARE = 0.04
"""Share of its norm that a sensitivity must keep, once fitted parameters are projected off, to be testable. Theory:
a share s inflates a standard deviation by 1 / s, here 25 times (variance inflation: Belsley, Kuh and Welsch
1980)."""
UNFELT = 1e-4
"""Share of the largest of several squares, or eigenvalues, below which one is neglected. Theory: a hundredth in
amplitude, a tenth of `SMALL_SHARE`."""
SMALL_PERCENT = 100.0 * SMALL_SHARE**2
"""Error E that is small, in percent. Literature: a tenth of what Dombre, Fournier and Coiffet call a good fit."""
FAR_PERCENT = 100.0 * SMALL_SHARE
"""Error E of a model that is far from the data, in percent. Theory: what it leaves is no small share of the squares."""
NOTHING_PERCENT = SMALL_SHARE * SMALL_PERCENT
"""Gain that is negligible, in percent. Theory: a small share of a small error."""
MOST_PERCENT = 50.0
"""Share of an error that is most of it, in percent. Theory: what remains is smaller than what went."""
RUNAWAY = 10.0
"""Limit of a prediction, in multiples of the largest reading: beyond it a simulation diverges. Theory: the inverse of
`SMALL_SHARE`; the size of a divergent simulation has no meaning."""
REVERSED_LEAVES = 0.3
"""Largest share of the squared error with the sign of an effort changed, for a warning about that sign. Theory: a model
that leaves more than half of the amplitude says nothing about a sign."""
ALIKE_COSINE = 0.99
"""Cosine of two sensitivities above which causes look alike. Theory: to distinguish them at 95 % either must be
significant by 23 standard deviations, 1.645 sqrt(2 / (1 - cosine))."""
EXPLAINED_AS_WELL = 2.0
"""Ratio of mean squares above which a restated trial is explained worse than the others. Theory: the upper 5 % of
Fisher's F of 20 and 20 degrees is 2.1."""
EFFORT_NOISE_SHARE = 1e-3
"""Share of the process noise's spectrum above which white noise of the recorded effort counts. Theory: a smaller share
changes no standard deviation by a thousandth."""

# Numbers of trials, causes and samples

FEWEST_STATED = 4
"""Least number of trials that state a condition, for a test whether one is misread. Theory: Student's t needs the
scatter of three others."""
MOST_CAUSES = 3
"""Most causes of a set. Theory: each further one multiplies the sets that are searched by the size of the library."""
MOST_ITEMS = 5
"""Most common causes and changes of a set. Theory: as `MOST_CAUSES`, with two changes."""
SHORT_NOISE = 2
"""Order of the noise in tests of bursts, repeats and heteroscedastic noise. Theory: these tests hold for any spectrum,
and a longer autoregression learns slow deviations as noise."""
FULL_NOISE = 24
"""Order of the noise in tests of slips, play and short waves over the angle. Simulation:
`scripts/benchmarks/adequate.py`; it whitens a random torque down to the lowest frequencies, and at 4 ms a sample its
memory is 0.1 s, too short to learn a permanent jump."""
WHITE_SHARE = 0.003
"""Share of the residual's variance that is white noise in addition to the autoregression. Theory: it bounds the depth
of a notch, so that no filter becomes a resonator that removes a misfit."""
SEEN_DEVIATIONS = 3.0
"""Standard deviations by which a cause of plausible size must be significant to be testable in a walk. Theory: power
0.85 at a two-sided level of 5 %."""
POSSIBLE_SIZES = 3.0
"""Multiple of a plausible size above which the size of a cause of a walk is impossible. Theory: three standard
deviations of its prior."""

# Times and lateness

HORIZON_S = 0.3
"""Default horizon of predictions, s. Literature: six time constants from stimulus to force of Dombre, Fournier and
Coiffet's ankle."""
AVERAGED_S = 0.05
"""Time over which process noise is averaged before its size is judged, s. Literature: the time constant from stimulus
to force of Dombre, Fournier and Coiffet's ankle; faster noise moves no limb."""
LEAST_SHIFT_S = 0.1
"""Shift of a trial's readings that is no lag of the rig, s. Literature: muscles answer within 0.1 s (Cavanagh and
Komi, Eur. J. Appl. Physiol. 42, 1979)."""
LEAST_LATE_ROWS = 0.25
"""Least delay of an effort, in rows of a log. Theory: a log of every second sample of a controller records an effort
that holds for half a row a quarter of a row late in the mean."""
MOST_LATE_ROWS = 2.0
"""Largest delay of an effort, in rows. Theory: it is held for one row when it is recorded, and for one until the
next."""
MOST_EARLY_ROWS = 0.5
"""Largest time by which an effort acts after it was recorded, in rows. Theory: a held effort acts half a row late in
the mean; what is later is a lag."""

# What a controller, or a filter, did to a record

ANSWERED = 1.0 / 6.0
"""Share of a stimulus, beyond what its past predicts, that readings predict in closed loop.
Simulation: `tests/identify/test_feedback.py` (written by a script: 0.10 at most) and
`tests/driven/test_stimulated.py` (a controller: 0.23 at least)."""
SMOOTH = 0.3
"""Noise from sample to sample, as a share of the residual, above which a record was not low-passed. Theory: averages of
ten samples have 1 / sqrt(10) = 0.32 of that of white noise; `tests/diagnosis/test_low_passed.py` holds both sides."""
