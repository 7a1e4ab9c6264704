"""Diagnosis of a study of walking: named causes with their significance and gain, lack of fit, the next experiment.

That is the simple trial, of walking or of standing, which distinguishes two causes best.
"""

import math
import time
from dataclasses import replace

import numpy as np

from fes_pin.data.asked import asked
from fes_pin.data.provenance import provenance_now
from fes_pin.data.results import Plan
from fes_pin.data.smooth import CUTOFF_HZ
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.infer.levels import STRONG_EVIDENCE
from fes_pin.infer.search import SearchResult
from fes_pin.infer.verdict import word_of
from fes_pin.infer.why import why_of
from fes_pin.walk.designs import Designs
from fes_pin.walk.judge import not_testable
from fes_pin.walk.models import WalkFit, WalkModels, WalkSearch, searched
from fes_pin.walk.motion import about
from fes_pin.walk.recording import recordings_of
from fes_pin.walk.result import WalkDiagnosis
from fes_pin.walk.verdict import WalkVerdict, marker_noise
from fes_pin.walk.walk_trial import WalkTrial
from fes_pin.workers import Progress, noting_stops, one_thread_each, time_limit

PLANS = {
    "stand still on one plate": (0.0, 0.0),
    "walk at 60 % of the speed": (0.6, 0.0),
    "carry a known weight of 10 kg at the trunk": (1.0, 10.0),
}
"""Trials that are compared: share of the usual speed, and load at the trunk, kg."""


def next_walk(models: WalkModels, found: SearchResult[WalkFit], cause: str) -> Plan | None:
    """Return the trial that separates a cause from its nearest rival of another name; None if it has no rival.

    Its columns are the coordinates of the motion to make, `q_<coordinate>`.
    """
    designs, best = models.designs, found.best
    own = {n for n in best.names if designs.forms[n].cause == cause}
    near = [(r.criterion, set(r.names) - set(best.names), n) for n in own for r in models.near_rivals(found, n)]
    rivals = [(criterion, new, gone) for criterion, (new,), gone in near if designs.forms[new].cause != cause]
    if not rivals:
        return None
    _, new, gone = min(rivals)
    pair = (cause, designs.forms[new].cause)
    signal = models.sizes(best)[gone]
    scores = {}
    for words, (speed, carried_kg) in PLANS.items():
        trial = _planned(designs.as_read.trials[0], speed, carried_kg)
        mine, its = (designs.forms[n].columns(trial) for n in (gone, new))
        scores[words] = _separation(designs, mine @ signal, its, designs.plausible((new,)), best)
    words = max(scores, key=lambda n: scores[n])
    if scores[words] < STRONG_EVIDENCE:
        alike = f"{pair[0]} and {pair[1]} look alike in standing, in slower walking and under a known weight"
        why = f"{alike}: weigh the plates with known masses, or measure the body by other means"
        return Plan(why, pair)
    why = f"{words} (it separates {pair[0]} from {pair[1]} by {np.sqrt(scores[words]):.1f} standard deviations)"
    return Plan(why, pair, _to_make(designs.as_read.trials[0], PLANS[words][0]))


def _to_make(usual: WalkTrial, speed: float) -> Trial:
    """Return the motion to make at a share of the usual speed."""
    columns = {n: c for n, c in usual.coordinates.items() if n.startswith("q_")}
    if not speed:
        places = {n: np.mean(c) if n.startswith("q_pelvis_t") else 0.0 for n, c in columns.items()}
        columns = {n: np.full_like(c, places[n]) for n, c in columns.items()}
    time = (usual.time - usual.time[0]) / (speed or 1.0)
    return Trial("next", "motion", columns, time, {"belt_speed_mps": speed * usual.session.belt_speed_mps})


def _planned(usual: WalkTrial, speed: float, carried_kg: float) -> WalkTrial:
    """Return a trial at a share of the usual speed and with a load at the trunk; plates measure what it requires."""
    motion, trunk = usual.motion, usual.motion.parameters["trunk"]
    q = motion.q if speed else np.tile(motion.q[:1], (len(motion.q), 1))
    slow = replace(motion, q=q, v=speed * motion.v, a=speed**2 * motion.a)
    load = usual.regressors["trunk"] @ (carried_kg * trunk / trunk[0])
    needed = slow.required + about(load, -motion.centre)
    shares = usual.load_shares if speed else {"left": np.zeros(len(q)), "right": np.ones(len(q))}
    feet = {side: share[:, None] * needed for side, share in shares.items()}
    loaded = {side: share > 0.0 for side, share in shares.items()}
    plates = replace(usual.plates, feet=feet, loaded=loaded, way=0.0 * usual.plates.way)
    return replace(usual, motion=slow, plates=plates)


def _separation(designs: Designs, signal: np.ndarray, rival: np.ndarray, prior: np.ndarray, best: WalkFit) -> float:
    """Return the squared distance of a signal (n, 6) from the span of a rival (n, 6, p), in units of the noise."""
    columns = np.concatenate([signal[:, :, None], rival], axis=2)
    _, rows, _ = designs.strides.windows[0]
    white = designs.noise.rotated(designs.strides.first(columns[rows])) / np.sqrt(best.fitted.variance)
    y, x = white[0].ravel(), white[1:].reshape(len(prior), -1).T * prior
    values = np.linalg.solve(x.T @ x + np.eye(x.shape[1]), x.T @ y)
    return float(np.sum((y - x @ values) ** 2))


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
            search, found = searched(models, tell)
        tell(0.85, "strides held out")
        out = _judged(study, search, found)
    tell(1.0, "done")
    return out.ended(began, made, limit if stops else None)


def _judged(study: Study, search: WalkSearch, found: SearchResult[WalkFit]) -> WalkDiagnosis:
    """Return the diagnosis of a search's result."""
    models, verdict = search.models, WalkVerdict(search)
    state = verdict.of(found)
    found, left, errors = state.found, verdict.lack_of_fit(state), verdict.errors
    causes = [verdict.cause(state, n) for n in found.best.names]
    noise = [one] if (one := marker_noise(models.designs)) is not None else []
    causes += [cause for fault, cause in noise if fault.is_named and fault.name not in {c.name for c in causes}]
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
        why=replace(why_of(state), corrections=tuple(fault for fault, _ in noise)),
    )
