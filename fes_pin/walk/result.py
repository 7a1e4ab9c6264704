"""The answer of a diagnosis of walking: causes, how sure, with what gain, what stays open; and it in words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fes_pin.body.build import Body
from fes_pin.data.results import Result
from fes_pin.data.show import from_to, last_notes
from fes_pin.data.smooth import CUTOFF_HZ
from fes_pin.infer.result import CROSS_VALIDATED, FITTED, Cause, Explained, shown
from fes_pin.infer.text import probability
from fes_pin.walk.experiment import NextWalk
from fes_pin.walk.extended import extended_body
from fes_pin.walk.judge import CHANNELS
from fes_pin.walk.models import WalkFit, WalkModels

NEXT_FILE = "next_trial.csv"


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class WalkDiagnosis(Result):
    """What a model of walking gets wrong: "adequate", "causes_found", "unexplained" or "stopped".

    Attributes
    ----------
    remainder
        Whether residuals of the same course come again in every stride.
    absorbed
        Causes that these data could not show.
    nominal_error, extended_error
        E in percent: on all strides, and on strides held out; None of a single stride.
    models, best
        The fits behind it.
    """

    causes: tuple[Cause, ...]
    absorbed: tuple[str, ...]
    nominal_error: tuple[float, float | None]
    extended_error: tuple[float, float | None]
    ceiling_percent: float
    next_experiment: NextWalk | None
    models: WalkModels
    best: WalkFit
    cutoff_hz: float = CUTOFF_HZ
    MODEL: ClassVar[str] = "the walking model"

    @property
    def model(self) -> Body:
        """The body with the masses, centres and inertias that were found."""
        return extended_body(self.models, self.best)

    @property
    def explained(self) -> Explained:
        """What all causes gain of the errors of the ground reaction that the motion requires."""
        pairs = zip((CROSS_VALIDATED, FITTED), self.nominal_error[::-1], self.extended_error[::-1], strict=True)
        on, before, after = next((o, b, a) for o, b, a in pairs if b is not None and a is not None)
        return Explained("squared error of the ground reaction", on, before, after, self.ceiling_percent or None)

    def own_record(self) -> dict[str, Any]:
        """What `diagnosis.json` has of a walk."""
        plan = self.next_experiment
        trial = None
        if plan and plan.conditions is not None:
            trial = {"coordinates": NEXT_FILE, "file": NEXT_FILE, "kind": "motion", **plan.conditions}
        parameters = {
            f"{c.name}.{n}": {"value": shown(one.value), "std": shown(one.std)}
            for c in self.causes
            for n, one in c.parameters.items()
        }
        nominal, extended = (
            {"fit": shown(f), "held_out": shown(h)} for f, h in (self.nominal_error, self.extended_error)
        )
        return {
            "absorbed": list(self.absorbed),
            "nominal": {"parameters": {}, "error_percent": nominal},
            "extended": {"parameters": parameters, "error_percent": extended},
            "noise": self._noise(),
            "ceiling_percent": shown(self.ceiling_percent),
            "next_experiment": {"why": plan.why, "separates": list(plan.separates), "trial": trial} if plan else None,
            "cutoff_hz": self.cutoff_hz,
        }

    def _noise(self) -> dict[str, Any]:
        """Root mean square of what the extended model leaves in the mean stride, by channel: N and N m."""
        residual = self.models.banks.residual(self.best.names, self.best.fitted.values)
        size = np.sqrt(np.sum(residual[0] ** 2, axis=1))
        return {
            name.replace(" ", "_"): {"std": shown(float(s)), "ar": []} for name, s in zip(CHANNELS, size, strict=True)
        }

    def notes(self) -> list[str]:
        """What is said below the table."""
        errors = from_to(self.nominal_error, self.extended_error, ("fitted", "strides held out"))
        lines = [f"error E {errors}; stride to stride {self.ceiling_percent:.2f} %; low pass {self.cutoff_hz:g} Hz"]
        where = f", most in {self.remainder.where}" if self.remainder.where else ""
        state = "something comes" if self.remainder.unexplained else "nothing more comes"
        lines.append(f"{state} again in every stride ({probability(self.remainder.p_value)}{where})")
        for cause in self.causes:
            if (gain := cause.further.get("other_leg")) is not None:
                lines.append(f"{cause.name}: fitted to one leg's stances it gains {gain:.0f} % on the other's")
            if cause.elsewhere:
                lines.append(f"{cause.name}: as well at {'; '.join(cause.elsewhere[:4])}")
        return [*lines, *last_notes(self.absorbed, self.next_experiment, self.warnings)]
