"""The measure of a model's error, E, and the predictions and data that it is computed on.

    E = 100 sum (measured - predicted)^2 / sum (measured - mean of its trial)^2        eq. (2) of the paper, percent

The sums run over all trials and output columns, each column in units of the standard deviation of its noise. 0 % is a
perfect model, 100 % no better than the mean. A prediction is

- `free`: from the inputs alone, from a trial's start on;
- over a `horizon`: each sample from the readings up to that time before it;
- `one_step`: each sample from the readings before it.

Trials are fitted (`fit`) or held out (`held_out`). In records `fit` and `held_out` are free; `one_step`, `horizon` and
`free` are on held-out trials where there are any, else on the fitted ones. For a driven rig these three are those of
its first output.
"""

E_WORDS = (
    "E is the squared error of a model, in percent of the measurement's squares about its mean (equation 2 of the "
    "paper): 0 % is a perfect model, 100 % no better than the mean."
)
FREE, ONE_STEP = "free simulations", "predictions one sample ahead"
"""Names of predictions in tables."""
MEASURES = ("fit", "held_out", "horizon")
"""Errors of both models that every record has and that tables of many studies show."""
