"""The verdict on a study of walking: which causes are named, how sure, with what gain, and what stays open."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np

from fes_pin.data.asked import asked
from fes_pin.data.errors import InputError
from fes_pin.data.smooth import CUTOFF_HZ
from fes_pin.data.study import Study
from fes_pin.infer.levels import CERTAIN_LEVEL
from fes_pin.infer.result import FITTED, STOPPED, Cause, Evidence, Gain, ParameterEstimate, Remainder
from fes_pin.walk.banks import Banks
from fes_pin.walk.effect import STAGE
from fes_pin.walk.experiment import NextWalk, next_walk
from fes_pin.walk.fits import Set
from fes_pin.walk.judge import (
    floor_percent,
    other_leg,
    unseen,
    walk_error_percent,
    walk_evidence,
    walk_gain,
    walk_remainder,
)
from fes_pin.walk.likelihood import white_level
from fes_pin.walk.nulls import LEVEL, Nulls, simulated_nulls
from fes_pin.walk.recording import recordings_of
from fes_pin.walk.result import WalkDiagnosis
from fes_pin.walk.search import WalkSearch
from fes_pin.workers import Progress, one_thread_each, time_limit

SEPARABLE = 6.0
"""Twice the log-likelihood by which a rival must fall short: odds of 20 to 1."""
LEFT_LEVEL = 0.01
"""Level at which what is left counts as something."""
ORDINARY_MM = 2.0
"""Marker noise up to this is no cause: cameras' and fixations' own (L. Chiari et al., Gait Posture 21:197, 2005)."""
SURE = 3.0
"""Standard deviations by which marker noise must exceed that."""


def diagnose_walk(
    study: Study,
    *,
    seed: int = 0,
    cutoff_hz: float = CUTOFF_HZ,
    limit: float | None = None,
    progress: Progress | None = None,
) -> WalkDiagnosis:
    """Find out what the believed body and its measurements get wrong in measured walking.

    Parameters
    ----------
    study
        Of rig `body`; trials with the role "held_out" take no part.
    seed
        Of what is simulated: soft tissue, critical values, bootstrap intervals.
    cutoff_hz
        Of the zero-phase low pass that motion (where its rates are not in the file) and plates go through.
    limit
        Seconds that the search may take; then it stops at the best set so far, and says so. Inverse dynamics, and what
        is done with that set, come on top.
    progress
        Called with a share done and a few words.

    Raises
    ------
    InputError
        The study is of another rig, or a file of it cannot be used.
    """
    began = time.perf_counter()
    tell = asked(study, seed, limit, progress)
    trials = tuple(t for t in study.trials if t.role != "held_out")
    if not trials:
        raise InputError("expected at least one trial to fit; all have role = held_out", file=study.folder)
    with one_thread_each():
        tell(0.02, "inverse dynamics")
        _, recordings = recordings_of(replace(study, trials=trials), cutoff_hz=cutoff_hz)
        search = WalkSearch(Banks(recordings, cutoff_hz, seed))
        tell(0.3, "sets of causes")
        with time_limit(math.inf if limit is None else limit - (time.perf_counter() - began)):
            sizes = search.run()
        tell(0.7, "critical values")
        nulls = simulated_nulls(search.banks, sizes[-1].fitted.variance, seed)
        best = _chosen(sizes, nulls.critical(LEVEL))
        tell(0.85, "strides held out")
        out = _judged(study, search, best, nulls, seed)
    tell(1.0, "done")
    out = replace(out, cutoff_hz=cutoff_hz, wall_s=time.perf_counter() - began)
    if not search.was_stopped:
        return out
    said = f"the search was stopped at its limit of {limit:g} s: best set so far"
    return replace(out, verdict=STOPPED, warnings=(said,))


def _chosen(sizes: list[Set], critical: float) -> Set:
    """The last set whose every step beyond the smaller one gains more than chance does."""
    best = sizes[0]
    for larger in sizes[1:]:
        if best.price - larger.price <= critical:
            break
        best = larger
    return best


def _judged(study: Study, search: WalkSearch, best: Set, nulls: Nulls, seed: int) -> WalkDiagnosis:
    banks, fits = search.banks, search.fits
    many = banks.strides.count > 1
    refused = False
    causes = _causes(search, best, nulls, seed)
    while weak := [c for c in causes if not is_supported(c[1])]:
        refused = True
        gone = max(weak, key=lambda c: c[1].p_value)[0]
        best = fits.fit(tuple(i for i in best.forms if i != gone))
        causes = _causes(search, best, nulls, seed)
    named = [c for _, c in causes]
    if (noise := _marker_noise(banks)) is not None and all(c.name != noise.name for c in named):
        named.append(noise)
    p_value, where = walk_remainder(banks, best)
    left = refused or p_value < LEFT_LEVEL
    order = sorted(named, key=lambda c: -c.gain_held_out.percent)
    none = fits.fit(())
    in_a_set = {n for c in named for n in (c.name, *c.equivalents)}  # these may be what is there
    return WalkDiagnosis(
        study=study,
        verdict="causes_found" if named else ("unexplained" if left else "adequate"),
        causes=tuple(order),
        remainder=Remainder(left, p_value, where if left else None),
        absorbed=tuple(n for n in unseen(banks, best) if n not in in_a_set),
        nominal_error=(
            walk_error_percent(banks, none, False),
            walk_error_percent(banks, none, True) if many else None,
        ),
        extended_error=(
            walk_error_percent(banks, best, False),
            walk_error_percent(banks, best, True) if many else None,
        ),
        ceiling_percent=floor_percent(banks),
        next_experiment=_experiment(search, best, order),
        search=search,
        best=best,
    )


def is_supported(cause: Cause) -> bool:
    """Whether what took no part supports a cause: strides held out; for what belongs to neither leg, other stances.

    By likelihood: squared errors are mostly what landmarks and plates make in every session.

    What chance does as well without a cause that was refused is none either.

    A single stride leaves nothing out: then only what is certain is named.
    """
    other_leg = cause.further["other_leg"]
    if other_leg is not None and other_leg <= 0.0:
        return False
    if cause.evidence is None:
        return cause.p_value < CERTAIN_LEVEL
    return cause.p_value < LEVEL and cause.evidence.low > 0.0


def _causes(search: WalkSearch, best: Set, nulls: Nulls, seed: int) -> list[tuple[int, Cause]]:
    banks, fits = search.banks, search.fits
    many = banks.strides.count > 1
    sizes = fits.sizes(best)
    spread = np.sqrt(np.diag(best.fitted.covariance))
    owners = [i for i in best.forms for _ in banks.forms[i].parameters]
    rivals: dict[int, list[Set]] = {i: [] for i in best.forms}
    for gone, other in search.swaps(best):
        if other.price - best.price < SEPARABLE:
            rivals[gone].append(other)
    out = []
    for i in best.forms:
        form, without = banks.forms[i], fits.fit(tuple(k for k in best.forms if k != i))
        stds = [s for owner, s in zip(owners, spread, strict=True) if owner == i] * np.maximum(nulls.spread[i], 1.0)
        instead = [banks.forms[k] for r in rivals[i] for k in r.forms if k not in best.forms]
        others = tuple(sorted({f.cause for f in instead} - {form.cause}))
        sites = tuple(dict.fromkeys(f.site for f in instead if f.cause == form.cause))
        fitted = walk_gain(banks, without, best, False, seed)
        either = not form.site.startswith(("left", "right")) and not form.shifts  # a clock is of no leg
        out.append(
            (
                i,
                Cause(
                    name=form.cause,
                    stage=STAGE,
                    site=form.site,
                    parameters={
                        n: ParameterEstimate(float(v), float(s), u)
                        for n, v, s, u in zip(form.parameters, sizes[i], stds, form.units, strict=True)
                    },
                    equivalents=others,
                    elsewhere=sites,
                    p_value=nulls.p_value(without.price - best.price),
                    gain_fit=fitted.percent,
                    gain_held_out=walk_gain(banks, without, best, True, seed) if many else replace(fitted, on=FITTED),
                    evidence=walk_evidence(banks, without, best, seed) if many else None,
                    further={"other_leg": other_leg(banks, fits.fit((i,))) if either else None},
                ),
            )
        )
    return out


def white_noise(banks: Banks) -> tuple[float, float, float] | None:
    """White noise of markers, mm, its standard deviation, and the deviance that it saves; None for a single stride."""
    if banks.strides.count < 2:
        return None
    y = banks.strides.coefficients([s.residual[:, :, None] for s in banks.as_read.scenes])[..., 0]
    waves = banks.noise.harmonics > 0
    shaken = banks.shaken[..., waves]
    values, vectors = np.linalg.eigh(np.einsum("dik,djk->ij", shaken, shaken) / (len(shaken) * waves.sum()))
    turn = (vectors / np.sqrt(values)).T  # channels in which white noise of the coordinates is independent
    noise = replace(banks.noise, turn=turn)
    apart = noise.rotated((y - y.mean(axis=0)) * np.sqrt(len(y) / (len(y) - 1.0)))
    level, std, saved = white_level(apart, noise, noise.rotated(banks.shaken))
    return level, std * np.sqrt(len(y) / (len(y) - 1.0)), saved


def _marker_noise(banks: Banks) -> Cause | None:
    """White noise on the coordinates that is more than cameras' own, from what differs from stride to stride."""
    level, std, saved = white_noise(banks) or (0.0, 0.0, 0.0)
    if level - SURE * std < ORDINARY_MM or saved < SEPARABLE:
        return None
    from scipy.stats import chi2  # noqa: PLC0415

    return Cause(
        name="marker_noise",
        stage=STAGE,
        site="white",
        parameters={"markers_m": ParameterEstimate(1e-3 * level, 1e-3 * std, "m")},
        equivalents=(),
        p_value=float(chi2.sf(saved, 1)),
        gain_fit=0.0,
        gain_held_out=Gain(0.0, 0.0, 0.0),
        evidence=Evidence(saved, saved, FITTED),
        further={"other_leg": None},
    )


def _experiment(search: WalkSearch, best: Set, causes: list[Cause]) -> NextWalk | None:
    for cause in causes:
        if cause.equivalents:
            return next_walk(search, best, cause.name, SEPARABLE)
    return None
