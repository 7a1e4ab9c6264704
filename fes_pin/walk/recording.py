"""A study of walking made ready: the body that is believed, its motion, and the plates on the motion's clock.

Plates and motion that cannot be of one walk are errors; part of a record may be used.
"""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from scipy.ndimage import uniform_filter1d

from fes_pin.body.build import Body, body_of
from fes_pin.body.joints import SIDES
from fes_pin.data.errors import InputError, errors_of
from fes_pin.data.smooth import CUTOFF_HZ
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.data.trial_files import walk_recordings
from fes_pin.data.walk_conventions import MOMENTS_ON
from fes_pin.walk.motion import Motion, Session, has_rates, heading_of, motion_of
from fes_pin.walk.walk_trial import LOADED_N, Plates, WalkTrial, plates_of, stretches

FAR_M = 1.5
"""No centre of pressure lies further from the body than this, level: a long step is 1 m."""
CARRIED = 0.6
"""Share of the required vertical force below which plates do not carry the whole body: errors of plates and masses are
below a third (`infer.levels.POSSIBLE_SIZES`)."""
NEARER = 0.6
"""Share of its distance to one ankle at which a centre of pressure is the other foot's; one who stands may share it."""
FULLY = 0.9
"""Share of what they usually carry that plates carry all through a stretch; else a foot next to them carries."""
NEARLY_ALL = 0.95
"""Share of a trial that plates carry from which on all of it is used."""
ENOUGH_S = 0.3
"""Most of a single support, s: less is no record of walking."""
MEAN_S = 0.15
"""Time over which forces are averaged before they are compared, s: a foot next to a plate stands there for longer, and
accelerations of noisy markers are as large as the weight from sample to sample."""


def check_together(motion: Motion, plates: Plates) -> None:
    """Refuse plates that push down, that lie elsewhere than the feet, or whose feet are exchanged.

    Raises
    ------
    InputError
        With what was expected.
    """
    up = plates.total[:, 2]
    if np.mean(up) < 0.0:
        raise InputError(f"the ground pushes up: the mean vertical force is {np.mean(up):.0f} N", column="r_Fy")
    for side in SIDES:
        rows = plates.loaded[side]
        apart = np.linalg.norm((plates.pressure[side] - motion.centre)[rows, :2], axis=1)
        if len(apart) and np.median(apart) > FAR_M:
            raise InputError(
                f"the {side} foot's centre of pressure lies {np.median(apart):.3g} m from the body: expected m, in the "
                "coordinates' frame (belt_speed_mps on a treadmill)",
                column=f"{side[0]}_copx",
            )  # fmt: skip
    _check_sides(motion, plates)


def _check_sides(motion: Motion, plates: Plates) -> None:
    """The foot that stands alone stands on its own plate."""
    supports = plates.single_supports()
    if not supports:
        return
    above = {name: "shank" if name == motion.body.stance else "hindfoot" for name in SIDES}  # links begin at the joint
    ankles = {name: motion.poses[f"{name}_{link}"][1] for name, link in above.items()}  # towards the ground

    def apart(name: str, side: str, rows: slice) -> float:
        return float(np.sum(np.linalg.norm((ankles[name] - plates.pressure[side])[rows, :2], axis=1)))

    own = sum(apart(side, side, rows) for side, rows in supports)
    cross = sum(apart(SIDES[1 - SIDES.index(side)], side, rows) for side, rows in supports)
    if cross < NEARER * own:
        raise InputError("the right plate's centre of pressure lies under the left foot: the feet are exchanged")


def carried_along(motion: Motion, plates: Plates) -> slice:
    """The longest stretch in which the plates carry the whole body; all of the record, if it is most of it.

    Over ground a walk begins and ends next to the plates, and with one plate every other step is not measured.

    Raises
    ------
    InputError
        No stretch is long enough.
    """
    size = max(1, round(MEAN_S / motion.dt))
    needed, up = (uniform_filter1d(x[:, 2], size, mode="nearest") for x in (motion.required, plates.total))
    share = up / np.maximum(needed, LOADED_N)
    in_the_air = needed < LOADED_N  # where nothing is to be carried
    carried = (share > CARRIED) & (up > LOADED_N)
    if np.mean(carried | in_the_air) > NEARLY_ALL:
        return slice(0, len(up))
    fully = carried & (share > FULLY * np.median(share[carried])) if carried.any() else carried
    longest = max(stretches(fully | in_the_air), key=lambda rows: rows.stop - rows.start, default=slice(0, 0))
    start, stop = longest.start, longest.stop
    if (stop - start) * motion.dt < ENOUGH_S:
        raise InputError(
            f"the plates carry the whole body for {(stop - start) * motion.dt:.2f} s at a time at most, "
            f"{ENOUGH_S:g} s are needed: does a foot step next to them?",
            column="r_Fy" if plates.loaded["right"].mean() < plates.loaded["left"].mean() else "l_Fy",
        )
    return longest


SLOPE, BETTER = 1.5, 0.7
"""Moments with the other sign leave twice themselves in what the motion does not explain. The sign is changed from this
slope of the remainder over the moments, where the right sign leaves less than this share of its deviation. In made
walks it leaves 0.2 to 0.45; what a measured walk leaves is no multiple of its moments."""
FEWEST = 10
"""Samples of motion and reaction together, at least."""


def recordings_of(study: Study, *, cutoff_hz: float = CUTOFF_HZ, body: Body | None = None) -> list[WalkTrial]:
    """Every trial of a walking study, each file at its own sample rate; by the body that is given, else the study's.

    Free moments whose sign the motion contradicts are taken with the other one, which each trial's `said` says.

    Raises
    ------
    InputError
        As `body_of`, and for a trial too short to filter.
    """
    believed, hip = body_of(study)
    return [_recording(trial, body or believed, hip, cutoff_hz) for trial in study.trials]


def _recording(trial: Trial, body: Body, hip: np.ndarray, cutoff_hz: float) -> WalkTrial:
    paths = list(map(Path, trial.as_read.sha256)) if trial.as_read is not None else []
    source, reaction = paths[0] if paths else None, paths[-1] if paths else None
    (time, columns), (raw_time, raw) = walk_recordings(trial)
    edge = 0.0 if has_rates(columns) else 0.5 / cutoff_hz
    inside = (time >= max(raw_time[0], time[0] + edge)) & (time <= min(raw_time[-1], time[-1] - edge))
    if inside.sum() < FEWEST:
        raise InputError(f"trial {trial.name} has {inside.sum()} samples of motion and reaction together", file=source)
    belt = trial.conditions.get("belt_speed_mps", 0.0)
    with errors_of(source):
        session = Session(cutoff_hz, belt, float(time[0]), heading_of(columns))
    moved = partial(motion_of, body, hip=hip, session=session)
    read = partial(plates_of, raw_time, dict(raw), session=session)
    with errors_of(source):
        motion = moved(time, columns).part(inside)
        plates = read(motion.time)
    with errors_of(reaction):
        check_together(motion, plates)
        rows = carried_along(motion, plates)
    parts = motion.part(rows), plates.part(rows)
    made = WalkTrial(trial.name, *parts, time, dict(columns), moved, read, session)
    if trial.as_read is not None and MOMENTS_ON in trial.as_read.stated:
        return made
    moments = {n: v if n[1:].startswith("_T") else 0.0 * v for n, v in raw.items()}
    twist = plates_of(raw_time, moments, made.motion.time, session).total[:, 5]
    if not _is_other_sign(twist, made.residual[:, 5]):
        return made
    turned = {n: -v if n[1:].startswith("_T") else v for n, v in raw.items()}
    read = partial(plates_of, raw_time, turned, session=session)
    words = f"moments of the plates of trial {trial.name} are taken with the other sign: its motion requires them so"
    return replace(made, plates=read(motion.time).part(rows), read=read, said=(words,))


def _is_other_sign(twist: np.ndarray, left: np.ndarray) -> bool:
    """Whether vertical moments have the other sign, by what of the measured ones the motion does not require."""
    twist, left = twist - np.mean(twist), left - np.mean(left)
    power = float(twist @ twist)
    return power > 0.0 and left @ twist > SLOPE * power and np.std(left - 2.0 * twist) < BETTER * np.std(left)
