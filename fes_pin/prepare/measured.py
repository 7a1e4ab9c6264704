"""Studies without spikes and without stuck sensors, what is odd about them, and trials that are fitted or held out."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

from fes_pin.data.derived import without_derived
from fes_pin.data.direction import contradicted
from fes_pin.data.errors import InputError
from fes_pin.data.schema import RigSchema
from fes_pin.data.spikes import without_spikes
from fes_pin.data.stuck import without_stuck
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.infer.held_out import FOLDS, deal
from fes_pin.models.clipped import with_limited_efforts
from fes_pin.models.conventions import with_meant_columns
from fes_pin.models.goals import with_efforts_of_goals
from fes_pin.models.nominal import nominal_model
from fes_pin.models.plausibility import odd_numbers
from fes_pin.models.simulate import simulated_trial
from fes_pin.prepare.long_records import thinned

check_study = partial(odd_numbers, simulated=simulated_trial)
"""Returns warnings about a study, or about trials to predict: see `models.plausibility.odd_numbers`."""


@dataclass(frozen=True)
class Measured:
    """A study without spikes and without stretches of stuck sensors.

    Attributes
    ----------
    study
        The study, with spikes replaced and stretches of stuck sensors cut out.
    left_out
        Samples that were spikes, by trial and column.
    warnings
        The stretches that were cut out, goal positions, limits of an actuator, and a kind that the data contradict, a
        line each.
    """

    study: Study
    left_out: dict[str, dict[str, tuple[int, ...]]]
    warnings: list[str]

    def odd(self) -> list[str]:
        """Return all warnings about the study that need no fit, a line each; see `check_study`."""
        return [*self.warnings, *check_study(self.study, nominal_model(self.study))]


def measured_study(study: Study) -> Measured:
    """Return a study without spikes of its measured columns and without stretches in which a sensor was stuck.

    Trials of a joint whose efforts cannot have driven it are of the kind "imposed" in it; see `data.direction`. Goal
    positions are replaced by the efforts of their controller, and commands beyond the limit of an actuator by that
    limit; see `models.goals` and `models.clipped`.

    A sample that its neighbours replace carries no information of its own. Intervals are therefore too narrow by half
    the share of such samples: half a percent where one in a hundred is a spike.

    Raises
    ------
    InputError
        If no trial has a reading that is not stuck.
    """
    rig, trials, found = nominal_model(study).rig, [], {}
    efforts, warnings = with_efforts_of_goals(study.trials, rig)  # goals would show an inertia over their stiffness
    driven, said = with_meant_columns(efforts, rig)
    warnings += said
    directed, said = contradicted(driven, study.schema)
    warnings += said
    directed, said = with_limited_efforts(directed, rig)
    warnings += said
    for trial in directed:
        pieces, said = without_stuck(trial, rig.outputs(trial.kind), bool(rig.unknowns(trial.kind)))
        warnings += said
        for piece in pieces:
            clean, spikes = without_spikes(piece, rig.outputs(piece.kind))
            trials.append(clean)
            if spikes:
                found[piece.name] = spikes
    if not trials:
        raise InputError(f"no trial has a reading that is not stuck: {warnings[0]}", file=study.folder)
    for rate, position in rig.rate_of.items():
        trials, said = without_derived(trials, position, rate)
        warnings += said
    return Measured(replace(study, trials=tuple(trials)) if found or warnings else study, found, warnings)


def split(study: Study) -> tuple[list[Trial], list[Trial]]:
    """Return the trials to fit and the trials that the study holds out.

    Free motion is fitted at the rate that its noise is modelled at, since no input is faster.
    """
    return at_noise_rate(study.to_fit(), study.schema), [t for t in study.trials if t.role == "held_out"]


def at_noise_rate(trials: Sequence[Trial], schema: RigSchema) -> list[Trial]:
    """Return trials, those of free motion at the rate that their noise is modelled at."""
    return [t if set(schema.inputs) & set(t.columns) else thinned(t, schema) for t in trials]


def folds_of(trials: Sequence[Trial], groups: Sequence[str] | None = None, count: int = FOLDS) -> list[list[int]]:
    """Return the trials of each fold, in which every kind and load is spread evenly; none where there is one trial."""
    order = sorted(range(len(trials)), key=lambda i: (trials[i].kind, sorted(trials[i].conditions.items()), i))
    return deal(order, groups, count)
