"""Checks of a study against its nominal model, before a fit."""

from functools import partial

from fes_pin.models.plausibility import odd_numbers
from fes_pin.models.simulate import simulated_trial

check_study = partial(odd_numbers, simulated=simulated_trial)
"""Returns warnings about a study, or about trials to predict: see `models.plausibility.odd_numbers`."""
