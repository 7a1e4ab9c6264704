"""Efforts along the measured motion of a joint: as recorded, and as models predict them by inverse dynamics.

A model predicts the effort by its own equations, as of an imposed motion: along the smoothed reading, corrected by what
the model says of the sensor. What was recorded passes the same filters as what is predicted; see `effort.motion`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.imposed import moved_along
from fes_pin.data.schema import IMPOSED
from fes_pin.data.trial import Trial, derived_trial
from fes_pin.effort.columns import Links
from fes_pin.effort.motion import Band, Motion, Record, band_of, has_rows
from fes_pin.effort.problem import HELD_ROWS, Rows
from fes_pin.effort.search import has_efforts
from fes_pin.models.effects.coulomb_friction import STATED
from fes_pin.models.model import Model
from fes_pin.models.outside import origin
from fes_pin.models.rigs.base import Rig
from fes_pin.models.rigs.joint import Joint
from fes_pin.models.simulate import Simulator
from fes_pin.models.stage import Effect

DRAG, LAG = "quadratic_damping", "sensor_lag"
"""Friction that acts on the torque, and a reading that is late."""
OF_TORQUE = ("gravity_angle", "torque", "friction", "effort")
"""Signals that a motion which is measured and one which is imposed have in common."""

FEWEST = 12
"""Rows that a figure of a trial has at least: a smooth curve needs them (`view.missing.smooth`)."""


@dataclass(frozen=True, eq=False)
class AlongMotion:
    """Efforts of one trial at the rows of its band.

    Attributes
    ----------
    name
        Of the trial.
    time, position, velocity
        Shape (m,); s, and rad and rad/s or m and m/s.
    measured
        The recorded effort, shape (m,), N m or N.
    predicted, friction
        Effort of each model, and what of it is damping, dry friction and drag; shape (m,) by the model's name.
    """

    name: str
    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    measured: np.ndarray
    predicted: Mapping[str, np.ndarray]
    friction: Mapping[str, np.ndarray]

    def residual(self, of: str) -> np.ndarray:
        """Return the measured effort minus that of a model, shape (m,)."""
        return self.measured - self.predicted[of]

    def without_others(self, of: str) -> np.ndarray:
        """Return the measured effort minus all of a model's but friction, shape (m,)."""
        return self.residual(of) + self.friction[of]


def with_efforts(rig: Rig, trials: Sequence[Trial]) -> list[Trial]:
    """Return the trials of a joint that have an effort and a position at every sample."""
    return [t for t in trials if has_efforts(rig, [t])]


def effort_band(rig: Rig, trials: Sequence[Trial]) -> Band | None:
    """Return the band of the motion of trials with efforts; None without one, or where it is not above the noise."""
    records = [Record.of(t) for t in with_efforts(rig, trials) if t.role != "held_out"]
    try:
        return band_of(records) if records else None
    except InputError:
        return None


def along_motion(models: Mapping[str, Model], trials: Sequence[Trial], band: Band) -> list[AlongMotion]:
    """Return the efforts of trials, in their order, without those that have fewer than `FEWEST` rows.

    Parameters
    ----------
    models
        By name, all of the same joint.
    trials
        Trials with efforts.
    band
        Their band.
    """
    kept = [t for t in trials if len(Motion(Record.of(t), band).rows) >= FEWEST]
    read = [Motion(Record.of(t), band) for t in kept]
    predicted = {n: _efforts(model, kept, band) for n, model in models.items()}
    others = {n: _efforts(_without_friction(model), kept, band) for n, model in models.items()}
    out = []
    for k, (trial, track) in enumerate(zip(kept, read, strict=True)):
        here = {n: one[k] for n, one in predicted.items()}
        friction = {n: one - others[n][k] for n, one in here.items()}
        motion = track.time[track.rows], track.moved(0), track.moved(1)
        out.append(AlongMotion(trial.name, *motion, _measured(trial, band), here, friction))
    return out


def effort_percent(model: Model, trials: Sequence[Trial], band: Band) -> float | None:
    """Return E of the low-passed effort that a model of a joint needs for the measured motion, percent.

    It is the squared error over the square of the recorded effort. Rows in which the joint rests do not count: friction
    may have any size below its limit there.

    Parameters
    ----------
    trials
        Trials with efforts.
    band
        Their band, or that of others by which they are judged.

    Returns
    -------
    float, or None
        None where a cause of the model has no part in that effort, and where trials are too short for the band or rest.
    """
    rig, records = model.rig, [Record.of(t) for t in trials]
    assert isinstance(rig, Joint)
    if left_out(model, trials) or not has_rows(records, band):
        return None
    fast = Rows(records, band, Links.of_rig(rig)).sizes.fast
    squares = power = 0.0
    for trial, predicted in zip(trials, _efforts(model, trials, band), strict=True):
        moves = ~Motion(Record.of(trial), band).resting(fast)
        measured = _measured(trial, band)[moves]
        squares += float(np.sum((measured - predicted[moves]) ** 2))
        power += float(np.sum(measured**2))
    return 100.0 * squares / power if power > 0.0 else None


def left_out(model: Model, trials: Sequence[Trial]) -> list[str]:
    """Return the causes of a model that are not in the efforts along a measured motion."""
    acting = [_acting(model, t) for t in trials if t.kind != IMPOSED]
    return [e.name for e in model.effects if e.each_trial or not (_is_view(e) or all(e.name in one for one in acting))]


def _measured(trial: Trial, band: Band) -> np.ndarray:
    """Return the recorded effort at the rows: a command is held until the next, on average half a sample."""
    record = Record.of(trial)
    smooth = Motion(record, band, record.effort).wide(0)
    late = 0.0 if trial.kind == IMPOSED else HELD_ROWS * record.dt
    return Motion(replace(record, effort=smooth), band).effort(late, 0.0)


def _efforts(model: Model, trials: Sequence[Trial], band: Band) -> list[np.ndarray]:
    """Return the effort of a model at the rows of each trial."""
    out = []
    for trial in trials:
        track, acting = Motion(Record.of(trial), band), model
        if trial.kind != IMPOSED:
            track = _seen(model, track)
            names = _acting(model, trial)
            acting = Model(model.rig, tuple(e for e in model.effects if e.name in names))
        given = moved_along(_imposed(trial), np.stack([track.q, track.v, track.a]))
        (run,) = Simulator(acting, [given]).run(acting.parameters())
        out.append(track.low(run.readings[:, 0]))
    return out


def _imposed(trial: Trial) -> Trial:
    return derived_trial(trial, kind=IMPOSED, low_pass_hz=None)


def _acting(model: Model, trial: Trial) -> set[str]:
    """Return the causes that act alike in a trial and along its motion: a user's own may read the recorded effort."""
    out = set()
    for effect in (e for e in model.effects if e.signal in OF_TORQUE):
        try:
            if origin(type(effect)):
                Simulator(Model(model.rig, (effect,)), [moved_along(_imposed(trial), np.zeros((3, len(trial))))])
            out.add(effect.name)
        except InputError:
            continue
    return out


def _seen(model: Model, track: Motion) -> Motion:
    """Return the motion of the joint by the reading that a model's sensor gives of it."""
    views, values, record, rig = [e for e in model.effects if _is_view(e)], model.parameters(), track.record, model.rig
    if not views:
        return track
    if f"{LAG}.lag_s" in values:
        lag, shift = values[f"{LAG}.lag_s"], values[f"{LAG}.shift"]
        earlier = np.interp(record.time + shift * lag, record.time, record.reading)
        reading = earlier + (1.0 - shift) * lag * np.gradient(earlier, record.dt)
        record = replace(record, reading=reading)
    assert isinstance(rig, Joint)
    names = [e.name for e in reversed(views) if e.name != LAG]
    (seen,) = Rows([record], track.band, Links.of_rig(rig)).seen(values, names)[1]
    return Motion(record, track.band, seen.reading)


def _is_view(effect: Effect) -> bool:
    """Return whether a cause is of the reading, and can be taken off it."""
    return effect.name in (LAG, "backlash", "sensor_drift", "sensor_gain", "sensor_nonlinearity", "sensor_offset")


def _without_friction(model: Model) -> Model:
    """Return a model without damping, dry friction and drag."""
    rubs = (e.signal == "friction" or e.name == DRAG for e in model.effects)
    kept = tuple(e for e, rubbing in zip(model.effects, rubs, strict=True) if not rubbing)
    rig = model.with_parameters({"damping": 0.0}).rig
    return Model(replace(rig, constants={n: x for n, x in rig.constants.items() if n != STATED}), kept)
