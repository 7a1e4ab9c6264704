"""Find the twins on a frame whose best fit of eq. (1) is the paper's table 1, with its E.

Four numbers are free (k1, k2, k3 and the frame's coupling); four conditions hold: E has its least value at table 1
(three components of its gradient), and that value is the printed one. The frame's frequency and damping are chosen.

    .venv/bin/python scripts/generate/paper_twins.py
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import scipy.optimize

sys.path.insert(0, str(Path(__file__).parents[2] / "analysis"))
from paper_ankle.constants import FRAME_DAMPING, FRAME_HZ, PRINTED, STEPWISE, twin_of_ratios
from paper_ankle.ratios import RATIOS, RatioProblem, ankle_of, least_error
from paper_ankle.twin import AnkleTwin, record, staircase


def on_frame(name: str, x: np.ndarray) -> AnkleTwin:
    """The twin of log ratios and log coupling, x of shape (4,)."""
    twin = twin_of_ratios(dict(zip(RATIOS, np.exp(x[:3]), strict=True)), PRINTED[name].load_kg)
    return replace(twin, frame_coupling=float(np.exp(x[3])), frame_hz=FRAME_HZ, frame_damping=FRAME_DAMPING)


def problem_of(name: str, x: np.ndarray) -> RatioProblem:
    """Eq. (1) from table 1, on the trial of such a twin."""
    believed = twin_of_ratios(PRINTED[name].ratios, PRINTED[name].load_kg)
    return RatioProblem(ankle_of(believed), [record(on_frame(name, x), staircase(list(STEPWISE)), name)])


def conditions(x: np.ndarray, name: str) -> np.ndarray:
    """What is zero for the twin: Newton's step from table 1, and the error against the printed one; shape (4,)."""
    problem = problem_of(name, x)
    error, gradient = problem.error(problem.start)
    step = np.linalg.solve(problem.curvature(problem.start), gradient)
    return np.r_[step, np.log(error / PRINTED[name].error_percent)]


def main() -> None:
    """Print the constants of `paper_ankle.constants.ON_FRAME`."""
    for name, printed in PRINTED.items():
        table = np.log([printed.ratios[n] for n in RATIOS])
        start = np.r_[table + np.log([0.8, 0.8, 0.35]), np.log(1.2)]
        low, high = np.r_[table - 2.5, np.log(0.05)], np.r_[table + 1.5, np.log(5.0)]
        found = scipy.optimize.least_squares(
            conditions, start, args=(name,), bounds=(low, high), xtol=1e-10, ftol=1e-12
        )
        best = least_error(problem_of(name, found.x))
        hidden = dict(zip((*RATIOS, "coupling"), (round(float(v), 6) for v in np.exp(found.x)), strict=True))
        print(f'"{name}": {hidden},  # fit: {best.ratios}, E {best.error_percent:.3f} %, cost {found.cost:.1e}')


if __name__ == "__main__":
    main()
