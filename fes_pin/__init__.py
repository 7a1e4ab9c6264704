"""Functional electrical stimulation on Pinocchio: simulate, diagnose, extend, control."""

import ast
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fes_pin.data.schema import rigs_from

if TYPE_CHECKING:  # every public name with its module: it is imported from there when it is first asked for
    from fes_pin.allocation.allocate import allocate as allocate
    from fes_pin.allocation.allocator import Allocator as Allocator
    from fes_pin.allocation.attainable_torques import AttainableTorques as AttainableTorques
    from fes_pin.allocation.horizon import Horizon as Horizon
    from fes_pin.allocation.horizon import StrengthFatigue as StrengthFatigue
    from fes_pin.allocation.horizon import invert_lag as invert_lag
    from fes_pin.allocation.walk import allocate_walk as allocate_walk
    from fes_pin.body.build import Body as Body
    from fes_pin.body.catchable import attainable as attainable
    from fes_pin.body.catchable import catchable as catchable
    from fes_pin.body.closed_loop import close_the_loop as close_the_loop
    from fes_pin.body.gait import posture_angles as posture_angles
    from fes_pin.body.inputs import Inputs as Inputs
    from fes_pin.body.linearize import linearize as linearize
    from fes_pin.body.minimal_sets import minimal_sets as minimal_sets
    from fes_pin.body.observability import fewest_goniometers as fewest_goniometers
    from fes_pin.body.passive import ElasticJoints as ElasticJoints
    from fes_pin.body.passive import PassiveLegs as PassiveLegs
    from fes_pin.comparison.compare import compare as compare
    from fes_pin.comparison.result import Comparison as Comparison
    from fes_pin.contrasts.contrast import contrast as contrast
    from fes_pin.contrasts.result import Contrast as Contrast
    from fes_pin.control.control import PositionController as PositionController
    from fes_pin.control.dynamics import AnkleDynamics as AnkleDynamics
    from fes_pin.control.dynamics import JointObserver as JointObserver
    from fes_pin.control.endurance import least_rest as least_rest
    from fes_pin.control.endurance import muscle_budget as muscle_budget
    from fes_pin.control.loop import track as track
    from fes_pin.control.margins import delay_margin as delay_margin
    from fes_pin.control.pulse import StimulationLimits as StimulationLimits
    from fes_pin.data.errors import InputError as InputError
    from fes_pin.data.errors import InputWarning as InputWarning
    from fes_pin.data.named import NamedArray as NamedArray
    from fes_pin.data.results import load_result as load_result
    from fes_pin.data.results import save_result as save_result
    from fes_pin.data.study import Study as Study
    from fes_pin.data.study import read_study as read_study
    from fes_pin.data.study import write_study as write_study
    from fes_pin.data.trial import Trial as Trial
    from fes_pin.data.trial_files import read_trial as read_trial
    from fes_pin.data.trial_files import write_trial as write_trial
    from fes_pin.diagnosis.result import Diagnosis as Diagnosis
    from fes_pin.identify.fit import Fit as Fit
    from fes_pin.models import effects as effects
    from fes_pin.models import rigs as rigs
    from fes_pin.models.catalogue import Catalogue as Catalogue
    from fes_pin.models.catalogue import load_library as load_library
    from fes_pin.models.model import Model as Model
    from fes_pin.models.nominal import nominal_model as nominal_model
    from fes_pin.models.predict import predict as predict
    from fes_pin.models.simulate import simulate as simulate
    from fes_pin.models.store import load_model as load_model
    from fes_pin.models.store import save_model as save_model
    from fes_pin.muscles.nerve_inputs import controllability as controllability
    from fes_pin.muscles.nerve_inputs import subject_nerves as subject_nerves
    from fes_pin.muscles.nerves import Nerves as Nerves
    from fes_pin.muscles.recruitment import GompertzRecruitment as GompertzRecruitment
    from fes_pin.muscles.recruitment import HillRecruitment as HillRecruitment
    from fes_pin.muscles.recruitment import Hysteresis as Hysteresis
    from fes_pin.muscles.recruitment import LinearRecruitment as LinearRecruitment
    from fes_pin.muscles.recruitment import MeasuredRecruitment as MeasuredRecruitment
    from fes_pin.muscles.recruitment import SaturatingRecruitment as SaturatingRecruitment
    from fes_pin.muscles.recruitment import SigmoidRecruitment as SigmoidRecruitment
    from fes_pin.paper.antagonist import fit_antagonist as fit_antagonist
    from fes_pin.paper.kalman import GainFilter as GainFilter
    from fes_pin.paper.kalman import track_gain as track_gain
    from fes_pin.search.fit import fit as fit
    from fes_pin.verdict.ask import check as check
    from fes_pin.verdict.ask import diagnose as diagnose
    from fes_pin.view.report import report as report
    from fes_pin.view.viewer import show_influence as show_influence
    from fes_pin.view.viewer import show_mode as show_mode
    from fes_pin.view.viewer import show_posture as show_posture
    from fes_pin.walk.diagnosis import diagnose_walk as diagnose_walk

__version__ = "0.2.0"


def _written_above() -> dict[str, str]:
    """The module of each public name, as the imports above have it, which only type checkers run."""
    (block,) = (node for node in ast.parse(Path(__file__).read_text("utf-8")).body if isinstance(node, ast.If))
    imports = [node for node in block.body if isinstance(node, ast.ImportFrom)]
    return {each.name: str(node.module) for node in imports for each in node.names}


_CHAPTERS = {name: f"{module}.{name}" for name, module in _written_above().items() if module == "fes_pin.models"}
_WHERE = {name: module for name, module in _written_above().items() if name not in _CHAPTERS}

# whoever reads a study asks for the rigs that the models bring; `data` itself imports no models
rigs_from(lambda: import_module("fes_pin.models.catalogue").installed().schemas())

__all__ = ["__version__", *_WHERE, *_CHAPTERS]  # noqa: PLE0604


def __getattr__(name: str) -> Any:
    """Import what is asked for when it is asked for: the command line starts fast."""
    if name in _CHAPTERS:
        return import_module(_CHAPTERS[name])
    if name in _WHERE:
        return getattr(import_module(_WHERE[name]), name)
    raise AttributeError(f"module 'fes_pin' has no attribute {name!r}")


def __dir__() -> list[str]:
    """Every public name."""
    return sorted(__all__)
