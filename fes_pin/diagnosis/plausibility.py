"""Checks of a study against its nominal model, before a fit."""

from fes_pin.data.plausibility import ToPredict
from fes_pin.data.study import Study
from fes_pin.models.model import Model
from fes_pin.models.plausibility import odd_numbers
from fes_pin.models.simulate import simulated_trial


def check_study(study: Study | ToPredict, model: Model) -> list[str]:
    """Return warnings about a study, or about trials to predict: see `models.plausibility.odd_numbers`."""
    return odd_numbers(study, model, simulated_trial)
