"""Diagnosis of a study of walking: named causes with their significance and gain, and lack of fit."""

import math
import time
from dataclasses import replace

from fes_pin.data.asked import asked
from fes_pin.data.provenance import provenance_now
from fes_pin.data.smooth import CUTOFF_HZ
from fes_pin.data.study import Study
from fes_pin.infer.search import SearchResult
from fes_pin.infer.verdict import word_of
from fes_pin.walk.designs import Designs
from fes_pin.walk.experiment import next_walk
from fes_pin.walk.judge import not_testable
from fes_pin.walk.models import POLICY, WalkFit, WalkModels, WalkSearch
from fes_pin.walk.recording import recordings_of
from fes_pin.walk.result import WalkDiagnosis
from fes_pin.walk.verdict import WalkVerdict, marker_noise
from fes_pin.workers import Progress, noting_stops, one_thread_each, time_limit


def diagnose_walk(
    study: Study,
    *,
    seed: int = 0,
    cutoff_hz: float = CUTOFF_HZ,
    limit: float | None = None,
    progress: Progress | None = None,
) -> WalkDiagnosis:
    """Name the errors of the nominal body and of the measurements in measured walking.

    Parameters
    ----------
    study
        A study of rig `body`; trials with the role "held_out" are not used.
    seed
        Of simulations: soft tissue, critical values, bootstrap intervals.
    cutoff_hz
        Cut-off of the zero-phase low pass of the plates, and of the motion where its rates are not in the file, Hz.
    limit
        Seconds that the search may take; then it stops at the best set so far, and the verdict says so. Inverse
        dynamics and the judgement of that set take time in addition.
    progress
        Called with the share that is done and a few words.

    Raises
    ------
    InputError
        If the study is of another rig, or a file of it cannot be used.
    """
    began = time.perf_counter()
    tell, made = asked(study, seed, limit, progress), provenance_now(study, seed)
    trials = study.to_fit()
    with one_thread_each(), noting_stops() as stops:
        tell(0.02, "inverse dynamics")
        recordings = recordings_of(replace(study, trials=trials), cutoff_hz=cutoff_hz)
        models = WalkModels(Designs(recordings, seed))
        with time_limit(math.inf if limit is None else limit - (time.perf_counter() - began)):
            search, found = _searched(models, tell)
        tell(0.85, "strides held out")
        out = _judged(study, search, found)
    tell(1.0, "done")
    return out.ended(began, made, limit if stops else None)


def _searched(models: WalkModels, tell: Progress) -> tuple[WalkSearch, SearchResult[WalkFit]]:
    """Search by evidence alone, and again with the noise estimated from the residual of the best set."""
    first = WalkSearch(models, lambda share, words: tell(0.3 + 0.2 * share, words), POLICY).run()
    tell(0.5, "critical values")
    models = models.with_noise_of(first.best)
    search = WalkSearch(models, lambda share, words: tell(0.55 + 0.3 * share, words), POLICY)
    found = search.run()
    if search.was_stopped and not found.best.names:
        found = search.result(first.best.names)
    return search, found


def _judged(study: Study, search: WalkSearch, found: SearchResult[WalkFit]) -> WalkDiagnosis:
    """Return the diagnosis of a search's result."""
    models, verdict = search.models, WalkVerdict(search)
    state = verdict.of(found)
    found, left, errors = state.found, verdict.lack_of_fit(state), verdict.errors
    causes = [verdict.cause(state, n) for n in found.best.names]
    noise = marker_noise(models.designs)
    causes += [noise] if noise is not None and noise.name not in {c.name for c in causes} else []
    causes.sort(key=lambda c: (c.gain_held_out.is_none, -c.gain_held_out.percent))
    in_a_set = {n for c in causes for n in (c.name, *c.equivalents)}  # these may be the true causes
    return WalkDiagnosis(
        study=study,
        verdict=word_of(bool(causes), left),
        causes=tuple(causes),
        remainder=left,
        reason=left.reason,
        absorbed=tuple(n for n in not_testable(models.designs, found.best) if n not in in_a_set),
        nominal_error=errors.error_percent(found.nominal),
        extended_error=errors.error_percent(found.best),
        ceiling_percent=errors.errors(found.nominal, False).ceiling_percent() or math.nan,  # of a single stride
        next_experiment=next((next_walk(models, found, c.name) for c in causes if c.equivalents), None),
        models=models,
        best=found.best,
        warnings=tuple(models.designs.stated.contradictions(study)),
    )
