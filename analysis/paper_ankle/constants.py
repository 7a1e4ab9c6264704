"""The paper's two trials, as printed and as twins.

Tables 1 and 2 of Dombre, Fournier and Coiffet are copied; what they do not print is chosen here and said so: the levels
of J and l (only ratios are printed), the foot's mass, the passive curve, the stimulus, the sensor's noise.

Each trial has two twins. The plain one is eq. (1) with the ratios of table 1: the paper's model, true. The other
swings on a frame, as the paper says its rig did; its ratios and its frame are such that the paper's own method (eq. 1
fitted to it) gives table 1 and its E. `scripts/generate/paper_twins.py` finds them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.numbers import positive_number
from fes_pin.data.show import Tabulated
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from paper_ankle.twin import AnkleTwin, record, staircase

LEVER_M = 0.08
"""l; not printed."""
ANGLE_NOISE_RAD = 2e-3
FORCE_NOISE_N = 0.2
"""White noise of the potentiometer and of the dynamometric ring; not printed."""
HELD_AT_RAD = 1.9
STEPWISE = ((0.2, 0.0), (0.2, 1000.0), (0.3, 0.0), (0.2, 600.0), (0.6, 0.0))
"""The stepwise stimulus of the twins' motion trials, (s, us); the paper's own is not printed."""
STAIRCASES = (
    STEPWISE,
    ((0.2, 0.0), (0.3, 700.0), (0.5, 0.0), (0.15, 1000.0), (0.8, 0.0)),
    ((0.1, 0.0), (0.15, 900.0), (0.25, 400.0), (0.25, 800.0), (0.9, 0.0)),
    ((0.3, 0.0), (0.1, 1000.0), (0.2, 0.0), (0.1, 1000.0), (0.2, 0.0), (0.1, 1000.0), (0.7, 0.0)),
    ((0.2, 0.0), (0.5, 500.0), (0.5, 0.0), (0.25, 1000.0), (0.8, 0.0)),
    ((0.1, 0.0), (0.2, 1000.0), (0.2, 500.0), (0.2, 1000.0), (0.9, 0.0)),
)
"""Stimuli of a whole study of one ankle; the first is the paper's trial."""


@dataclass(frozen=True, eq=False)
class PrintedTrial(Tabulated):
    """What the paper prints of one trial.

    Attributes
    ----------
    load_kg
        M.
    ratios
        k1, k2 in 1/(kg m) and k3 in 1/s of least E: table 1.
    error_percent
        E there.
    domain
        Least and greatest of each ratio with E <= 10 %: table 2.
    """

    load_kg: float
    ratios: Mapping[str, float]
    error_percent: float
    domain: Mapping[str, tuple[float, float]]


PRINTED: Mapping[str, PrintedTrial] = MappingProxyType(
    {
        "3-23": PrintedTrial(
            1.0,
            {"k1": 34.0, "k2": 80.0, "k3": 58.5},
            5.35,
            {"k1": (27.656, 65.498), "k2": (72.566, 170.960), "k3": (55.248, 104.108)},
        ),
        "4-24": PrintedTrial(
            1.5,
            {"k1": 30.5, "k2": 80.0, "k3": 108.0},
            4.17,
            {"k1": (25.257, 35.461), "k2": (64.388, 90.734), "k3": (98.456, 124.483)},
        ),
    }
)
"""Tables 1 and 2, by trial."""

FRAME_HZ, FRAME_DAMPING = 4.5, 0.03
"""The frame's own mode; not printed. A chosen pair: others give table 1 as well, with other hidden ratios."""
ON_FRAME: Mapping[str, Mapping[str, float]] = MappingProxyType(
    {
        "3-23": {"k1": 13.393305, "k2": 33.65118, "k3": 20.47704, "coupling": 1.32989},
        "4-24": {"k1": 15.194487, "k2": 41.860235, "k3": 41.119818, "coupling": 2.186547},
    }
)
"""Ratios and frame of the twins whose best fit of eq. (1) is table 1; from scripts/generate/paper_twins.py."""


def twin_of_ratios(ratios: Mapping[str, float], load_kg: float) -> AnkleTwin:
    """An ankle with these k1, k2 and k3: J = l / k2, a = k1 J, xi = k3 J.

    Raises
    ------
    InputError
        For ratios that are missing, or none.
    """
    if set(ratios) < {"k1", "k2", "k3"}:
        raise InputError(f"expected k1, k2 and k3, found {', '.join(ratios)}", column="ratios")
    inertia = LEVER_M / positive_number(ratios["k2"], "k2")
    return AnkleTwin(
        inertia_kgm2=inertia,
        com_distance_m=LEVER_M,
        moment_arm_m=ratios["k1"] * inertia,
        damping_nms=ratios["k3"] * inertia,
        load_kg=load_kg,
    )


def paper_twin(name: str, frame: bool = False) -> AnkleTwin:
    """The twin of a printed trial, without or with its frame.

    Raises
    ------
    InputError
        If the paper prints no such trial.
    """
    if name not in PRINTED:
        raise InputError(f"expected a trial that the paper prints, {' or '.join(PRINTED)}, found {name!r}")
    load = PRINTED[name].load_kg
    if not frame:
        return twin_of_ratios(PRINTED[name].ratios, load)
    hidden = ON_FRAME[name]
    swinging = {"frame_coupling": hidden["coupling"], "frame_hz": FRAME_HZ, "frame_damping": FRAME_DAMPING}
    return replace(twin_of_ratios(hidden, load), **swinging)


def isometric_stimulus(seconds: float = 8.0) -> np.ndarray:
    """Steps of all sizes for an isometric trial, shape (n,) us: what shows gain and time constant."""
    levels = (0.0, 600.0, 1000.0, 400.0, 0.0, 800.0, 300.0, 700.0)
    return staircase([(0.25, levels[k % len(levels)]) for k in range(round(seconds / 0.25))])


def paper_trial(name: str, frame: bool = False, seed: int = 0, noise_std: float = ANGLE_NOISE_RAD) -> Trial:
    """The twin's recording of a printed trial: stepwise stimulus, measured angle."""
    return record(paper_twin(name, frame), staircase(list(STEPWISE)), name, noise_std=noise_std, seed=seed)


def paper_study(name: str, frame: bool = False, seed: int = 0) -> Study:
    """A study of the ankle behind a printed trial: motion trials, the printed one first, and two isometric ones.

    It starts from table 1; the last two motion trials are held out.
    """
    twin, printed = paper_twin(name, frame), PRINTED[name]
    held_out = len(STAIRCASES) - 2
    trials = [
        record(
            twin,
            staircase(list(steps)),
            f"motion_{k}" if k else name,
            noise_std=ANGLE_NOISE_RAD,
            seed=seed + k,
            role="fit" if k < held_out else "held_out",
        )
        for k, steps in enumerate(STAIRCASES)
    ]
    for k in range(2):
        isometric = record(
            twin,
            isometric_stimulus(4.0),
            f"isometric_{k}",
            held_at_rad=HELD_AT_RAD,
            noise_std=FORCE_NOISE_N,
            seed=seed + 100 + k,
            role="fit",
        )
        trials.append(isometric)
    start = {
        "gain": twin.gain,
        "time_constant_s": twin.time_constant_s,
        "inertia_kgm2": LEVER_M / printed.ratios["k2"],
        "damping_nms": printed.ratios["k3"] * LEVER_M / printed.ratios["k2"],
    }
    return Study(f"paper-{name}{'-frame' if frame else ''}", "ankle", twin.constants(), start, tuple(trials))
