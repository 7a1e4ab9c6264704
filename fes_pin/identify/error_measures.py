"""The measure of a model's error, E, and what it is taken over.

    E = 100 sum (measured - predicted)^2 / sum (measured - mean of its trial)^2        eq. (2) of the paper, percent

The sums run over all trials and output columns, each column in units of the standard deviation of its noise. 0 % is a
perfect model, 100 % no better than the mean. A prediction is

- `free`: from the inputs alone, from a trial's start on;
- over a `horizon`: each sample from what was measured up to so many seconds before it;
- `one_step`: each sample from what was measured up to the sample before it.

Trials are those that were fitted (`fit`), or took no part in the fit (`held_out`). In records `fit` and `held_out` are
free; `one_step`, `horizon` and `free` are on trials held out where there are such, else on the fitted ones. Of a rig
that a recorded effort drives the three are those of its first output.
"""

from __future__ import annotations

E_WORDS = (
    "E is the squared error of a model, in percent of the measurement's squares about its mean (equation 2 of the "
    "paper): 0 % is a perfect model, 100 % no better than the mean."
)
FREE, ONE_STEP = "free simulations", "predictions one sample ahead"
"""What a prediction is called in tables."""
MEASURES = ("fit", "held_out", "horizon")
"""Errors that every record has of both models, and tables of many studies show."""
