"""Models from the literature ranked by their errors of prediction on held-out trials."""

import math
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fes_pin.comparison.held_out import Parting, left_out_errors, partings
from fes_pin.comparison.literature import NOMINAL, RIGS, Published, possible, published_model
from fes_pin.comparison.result import Apart, Compared, Comparison, apart_from
from fes_pin.data.asked import asked
from fes_pin.data.errors import InputError
from fes_pin.data.numbers import instance, number
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.identify.ahead import default_horizon
from fes_pin.identify.fit import rough_noise
from fes_pin.identify.likelihood_fit import refit
from fes_pin.infer.held_out import percent_of_spread
from fes_pin.infer.noise import NoiseModel
from fes_pin.models.catalogue import Source
from fes_pin.models.model import Model
from fes_pin.models.nominal import nominal_model
from fes_pin.models.store import load_model
from fes_pin.prepare.measured import measured_study, split
from fes_pin.search.fit import fitted_alone
from fes_pin.workers import Progress, in_parallel, one_thread_each

FEW = "too few trials to estimate how trials differ: the first seconds of a trial do not predict its others"


def compare(
    study: Study,
    models: Sequence[str] | None = None,
    *,
    extended: Mapping[str, Model | str | Path] | None = None,
    horizon_s: float | None = None,
    given_s: float | None = None,
    library: Source | Sequence[Source] | None = None,
    progress: Progress | None = None,
) -> Comparison:
    """Rank models by their errors on held-out trials.

    Models are fitted by least squares of free simulations, as by `fit` with `least_squares`: the criterion of a fit is
    the error that models are ranked by. The likelihood of `diagnose` takes slow errors of a wrong model for noise.

    Parameters
    ----------
    study
        Of a stimulated muscle or ankle. Trials with the role "held_out" are predicted; without such roles each trial is
        predicted by fits without it.
    models
        Names as in `literature.LITERATURE`; by default all that the study's trials allow.
    extended
        Models of one's own by name, as `diagnose` finds them: from memory or `model.toml`. They are refitted without
        the trials that they predict.
    horizon_s
        How far ahead, s; by default that of a diagnosis.
    given_s
        Also predict each trial after its first `given_s` seconds from those seconds.
    library
        Where causes of `extended` come from that are not written here.
    progress
        Called with a share done and a few words.

    Returns
    -------
    Comparison

    Raises
    ------
    InputError
        For another rig, one trial, a name that no model has, a model of another rig, or times that are not within a
        trial.
    """
    began = time.perf_counter()
    tell = asked(study, progress=progress)
    if study.rig not in RIGS:
        raise InputError(f"expected a study of a rig {' or '.join(RIGS)}, found {study.rig}", file=study.folder)
    measured = measured_study(study)
    joined = measured.study
    nominal = nominal_model(joined)
    fitted, held = split(joined)
    if len(fitted) + len(held) < 2:
        raise InputError("expected at least two trials: whole trials are left out", file=study.folder)
    every = [*fitted, *held]
    _check_times(every, horizon_s=horizon_s, given_s=given_s)
    horizon = horizon_s or study.horizon_s or default_horizon(every)
    chosen = _chosen(models, extended, nominal, every, library)
    noted = measured.odd()
    parts = partings(fitted, held)
    floor = rough_noise(nominal, every)
    compared = []
    with one_thread_each():
        for k, (about, model) in enumerate(chosen):
            tell(k / len(chosen), about.name)
            compared.append(_compared(about, model, parts, fitted, floor, horizon, given_s))
    tell(1.0, "done")
    ranked = sorted(compared, key=lambda m: m.percent["free"])
    return Comparison(
        study=study,
        models=tuple(_with_apart(ranked, 1 if held else len(parts))),
        held_out=tuple(t.name for p in parts for t in p.held),
        by="role" if held else "folds",
        horizon_s=horizon,
        given_s=given_s,
        warnings=(*noted, *([FEW] if given_s is not None and any("begun" not in m.percent for m in ranked) else [])),
        wall_s=time.perf_counter() - began,
    )


def _chosen(
    models: Sequence[str] | None,
    extended: Mapping[str, Model | str | Path] | None,
    nominal: Model,
    trials: Sequence[Trial],
    library: Source | Sequence[Source] | None,
) -> list[tuple[Published, Model]]:
    """The models that are compared, before they are fitted, and what is said of each."""
    out = []
    names = possible(trials) if models is None else instance(models, Iterable, "models")
    for name in dict.fromkeys(str(name) for name in ([names] if isinstance(names, str) else names)):
        one = published_model(name)
        out.append((one, one.model(nominal, trials)))
    for name, given in instance({} if extended is None else extended, Mapping, "extended").items():
        own = given if isinstance(given, Model) else load_model(given, library=library)
        if own.rig.name != nominal.rig.name:
            raise InputError(f"expected a model of the rig {nominal.rig.name}, found one of {own.rig.name}: {name}")
        if any(name == c.name for c, _ in out):
            raise InputError(f"expected one model of the name {name}, found two")
        rig = replace(own.rig, constants=nominal.rig.constants)
        unpublished = replace(published_model(NOMINAL), name=name)
        out.append((unpublished, Model(rig, own.effects)))
    if not out:
        raise InputError("expected at least one model to compare", column="models")
    return out


def _compared(
    about: Published,
    model: Model,
    parts: Sequence[Parting],
    fitted: Sequence[Trial],
    floor: NoiseModel,
    horizon_s: float,
    given_s: float | None,
) -> Compared:
    """Return a model with its errors; `floor` weighs the columns in E."""
    whole = fitted_alone(model, fitted, least_squares=True)
    fits = [whole] if len(parts) == 1 else in_parallel(lambda p: refit(whole, p.fitted), parts)
    kinds = left_out_errors(fits, parts, horizon_s, given_s)
    trials = [t for p in parts for t in p.held]
    columns = np.array([model.rig.output(t.kind) for t in trials])
    weight = np.array([np.isfinite(t[c]).sum() / floor[c].std ** 2 for t, c in zip(trials, columns, strict=True)])
    around = weight * kinds.pop("around")
    squares = {n: len(trials) * 100.0 * weight * e / around.sum() for n, e in kinds.items()}
    rows = {str(c): columns == c for c in dict.fromkeys(columns)}
    rmse = {c: {n: math.sqrt(float(e[k].mean())) for n, e in kinds.items()} for c, k in rows.items()}
    return Compared(
        name=about.name,
        words=about.words,
        source=about.source,
        parameters=len(whole.free),
        unfelt=about.unfelt(model, trials),
        rmse=rmse,
        percent={n: percent_of_spread(weight * e, around) for n, e in kinds.items()},
        squares=squares,
        apart={},
        fit=whole,
        converged=all(f.converged for f in (*fits, whole)),
    )


def _with_apart(ranked: Sequence[Compared], folds: int) -> list[Compared]:
    """The models, each held against the best by either kind of error."""
    best = {kind: min(ranked, key=lambda m: m.percent[kind]) for kind in ("free", "horizon")}

    def apart(one: Compared, kind: str) -> Apart | None:
        first = best[kind].squares[kind]
        return None if one is best[kind] else apart_from(first, one.squares[kind], len(ranked) - 1, folds)

    return [replace(m, apart={kind: apart(m, kind) for kind in best}) for m in ranked]


def _check_times(trials: Sequence[Trial], **asked: float | None) -> None:
    shortest = min(t.duration for t in trials)
    for name, value in asked.items():
        if value is not None and not 0.0 < number(value, name) < shortest:
            message = f"expected seconds between 0 and {shortest:.4g}, the shortest trial; found {value:g}"
            raise InputError(message, column=name)
