"""Every trial of a contrast with the predictions of the models of its groups, and the errors of these by group."""

from collections.abc import Sequence

from fes_pin.contrasts.grouped import Grouped
from fes_pin.data.trial import Trial, derived_trial
from fes_pin.identify.ahead import default_horizon, first_ahead
from fes_pin.identify.replay import Replay, replayed
from fes_pin.infer.held_out import percent_of_spread

EVERY = "every group"
"""Name of the model where nothing differs between the groups."""


def horizon_of(fit: Grouped) -> float | None:
    """Return the horizon of the predictions that are shown, s; None for a rig that is simulated freely."""
    return default_horizon(fit.trials) if fit.is_driven else None


def replayed_groups(fit: Grouped, trials: Sequence[Trial], groups: Sequence[str]) -> tuple[Replay, ...]:
    """Return every trial, in its order, as models predict it: that of its group, and that of another.

    The other group is the one before its own, of the first group the second. Where no change is named, the groups share
    one model, `EVERY`.
    """
    horizon_s, made = horizon_of(fit), []
    conditions = {t.name: t.conditions for t in fit.trials}  # a misread one is corrected
    for measured in trials:
        trial = derived_trial(measured, conditions=conditions.get(measured.name, measured.conditions))
        place = groups.index(str(trial.group))
        noise, known, models = fit.weights.noise[groups[place]], fit.unknowns_of(trial), {}
        for k in sorted({place, place - 1 if place else 1}):
            name = groups[k] if fit.changes else EVERY
            models[name] = replayed(fit.grouped.models[groups[k]], trial, noise, noise, horizon_s, known)
        model = fit.grouped.models[groups[place]]
        outputs = tuple(n for n in model.rig.outputs(trial.kind) if n in trial)
        made.append(Replay(trial, models, noise, outputs, first_ahead(model, trial, horizon_s)))
    return tuple(made)


def errors_by_group(replays: Sequence[Replay]) -> dict[str, dict[str, float]]:
    """Return E of all trials of each group together, percent, by group and model."""
    squares: dict[str, dict[str, list[tuple[float, float]]]] = {}
    for one in replays:
        own = squares.setdefault(str(one.measured.group), {})
        for name, pair in one.squares.items():
            own.setdefault(name, []).append(pair)
    return {
        g: {n: percent_of_spread(*zip(*pairs, strict=True)) for n, pairs in own.items()} for g, own in squares.items()
    }
