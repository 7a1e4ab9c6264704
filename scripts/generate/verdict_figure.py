"""Writes analysis/figures/verdict.svg: a trial of the demo study, measured, as simulated, and as extended."""

import re
from pathlib import Path

from fes_pin.data.study import read_study
from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.diagnosis.replay import replayed_trials
from fes_pin.view.plots import trial_drawing

ANALYSIS = Path(__file__).parents[2] / "analysis"
TRIAL = "stairs"


def main() -> None:
    """Diagnose, and draw what is found."""
    diagnosis = diagnose_joint(read_study(ANALYSIS / "studies" / "ankle_demo"))
    print(diagnosis)
    (one,) = (r for r in replayed_trials(diagnosis) if r.measured.name == TRIAL)
    drawn = trial_drawing(one).svg
    sized = re.sub(r'viewBox="0 0 (\S+) (\S+)"', r'\g<0> width="\1" height="\2" font-family="sans-serif"', drawn)
    white = sized.replace(">", '><rect width="100%" height="100%" fill="#ffffff"/>', 1)
    alone = re.sub(r"var\(--[\w-]+, (#\w+)\)", r"\1", white)  # there is no page whose colours it could have
    path = ANALYSIS / "figures" / "verdict.svg"
    path.parent.mkdir(exist_ok=True)
    path.write_text(alone + "\n", encoding="utf-8")
    print(f"{path.relative_to(ANALYSIS.parent)}: {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
