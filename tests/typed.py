"""What a user writes, in types that `mypy --strict` accepts; `.ci/run` checks them, a test runs it."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

import fes_pin as fp


def with_friction(study: fp.Study) -> fp.Model:
    """The believed model with a cause added."""
    extended: fp.Model = fp.nominal_model(study) + fp.effects.CoulombFriction(torque_nm=0.04)
    return extended


def residual(model: fp.Model, trial: fp.Trial, column: str) -> NDArray[np.float64]:
    """Measured minus simulated."""
    simulated: fp.Trial = fp.simulate(model, trial)
    return np.asarray(trial[column] - simulated[column], dtype=np.float64)


def gains(diagnosis: fp.Diagnosis) -> dict[str, float]:
    """Held-out gain by cause, percent."""
    return {cause.name: cause.gain_held_out.percent for cause in diagnosis.causes}


def refitted(study: fp.Study, folder: Path) -> fp.Fit:
    """The fit of the model that was saved."""
    fp.save_model(with_friction(study), folder / "model.toml")
    return fp.fit(fp.load_model(folder / "model.toml"), study.trials)


def tables(study: fp.Study, fitted: fp.Fit) -> tuple[float, float, str]:
    """A time, a value and what a notebook shows."""
    seconds = float(study.to_frame()["duration_s"].sum())
    values: NDArray[np.float64] = fitted.to_numpy()
    return seconds, float(values[0]), repr(fitted)


def one_line(folder: Path) -> str:
    """What is wrong with a study that cannot be read."""
    try:
        return repr(fp.read_study(folder))
    except fp.InputError as error:
        return f"{error.file}: {error.message}"


def answered(study: fp.Study, folder: Path) -> tuple[str, fp.Model | None]:
    """A verdict with its model and its page; of a rig, which is no walk, the model as such."""
    diagnosis = fp.diagnose(study, limit=0.0)
    fp.save_model(diagnosis.model, folder / "model.toml")
    fp.report(diagnosis, folder / "report.html")
    return diagnosis.verdict, diagnosis.model if isinstance(diagnosis, fp.Diagnosis) else None


def friction() -> fp.effects.CoulombFriction:
    """A cause by the name of its class."""
    return fp.effects.CoulombFriction(torque_nm=0.04)


if TYPE_CHECKING:  # what is misspelt is found before it runs
    fp.effects.CoulombFrictoin(torque_nm=0.04)  # type: ignore[attr-defined]
    fp.effects.CoulombFriction(torque=0.04)  # type: ignore[call-arg]
    fp.save_model(friction(), "model.toml")  # type: ignore[arg-type]
