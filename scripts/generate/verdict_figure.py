"""Writes analysis/figures/verdict.png: a trial of the demo study, measured, as simulated, and as extended."""

from pathlib import Path

from fes_pin.data.study import read_study
from fes_pin.diagnose.diagnosis import diagnose
from fes_pin.diagnose.replay import replay
from fes_pin.view.plots import trial_figure
from fes_pin.view.style import styled

ANALYSIS = Path(__file__).parents[2] / "analysis"
TRIAL = "stairs"


def main() -> None:
    """Diagnose, and draw what is found."""
    diagnosis = diagnose(read_study(ANALYSIS / "studies" / "ankle_demo"))
    print(diagnosis)
    (one,) = (r for r in replay(diagnosis) if r.measured.name == TRIAL)
    figure = trial_figure(one, diagnosis.extended.noise)
    path = ANALYSIS / "figures" / "verdict.png"
    path.parent.mkdir(exist_ok=True)
    with styled():
        figure.savefig(path, dpi=160, metadata={"Software": None})
    print(f"{path.relative_to(ANALYSIS.parent)}: {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
