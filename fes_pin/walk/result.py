"""The result of a diagnosis of walking: causes with significance and gain, lack of fit; the body extended by them."""

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar
from xml.etree.ElementTree import tostring

import numpy as np
import tomli_w
from defusedxml.ElementTree import fromstring

from fes_pin.body.build import Body
from fes_pin.data.numbers import in_full
from fes_pin.data.results import ModelResult
from fes_pin.data.urdf import MOMENTS
from fes_pin.infer.result import CROSS_VALIDATED, FITTED, Explained, shown
from fes_pin.infer.text import percent
from fes_pin.walk.effect import Segment, WalkEffect
from fes_pin.walk.effects import EFFECTS
from fes_pin.walk.judge import CHANNELS
from fes_pin.walk.models import WalkFit, WalkModels


def extended_body(models: WalkModels, best: WalkFit) -> Body:
    """Return the body with the segments' masses, centres and inertias of a set of causes."""
    body, changed = models.designs.as_read.trials[0].motion.body, models.segments(best)
    return with_segments(body, changed) if changed else body


def with_segments(body: Body, segments: dict[str, Segment]) -> Body:
    """Return a body with other masses, centres and inertias of some segments, in their links' frames."""
    tree = fromstring(body.urdf)
    for name, one in segments.items():
        written = {
            "origin": {"xyz": in_full(*one.lever), "rpy": "0 0 0"},
            "mass": {"value": in_full(one.mass)},
            "inertia": dict(zip(MOMENTS, map(in_full, one.inertia[np.triu_indices(3)]), strict=True)),
        }
        for child in tree.iterfind(f"link[@name='{name}']/inertial/*"):
            child.attrib.update(written.get(child.tag, {}))
    text = '<?xml version="1.0"?>\n' + tostring(tree, encoding="unicode") + "\n"
    return replace(body, urdf=text, label=f"{body.label}, extended")


BODY_FILE = "body.urdf"


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class WalkDiagnosis(ModelResult):
    """The result of a diagnosis of walking: "adequate", "causes_found", "unexplained" or "stopped".

    Attributes
    ----------
    remainder
        Lack of fit: whether the same residual repeats in every stride.
    nominal_error, extended_error
        E on all strides, and on strides held out; None of a single stride.
    models, best
        The fits behind it.
    """

    models: WalkModels
    best: WalkFit
    MODEL: ClassVar[str] = "the walking model"

    @property
    def model(self) -> Body:
        """The body with the estimated masses, centres and inertias."""
        return extended_body(self.models, self.best)

    @property
    def cutoff_hz(self) -> float:
        """Cut-off of the low pass, Hz."""
        return self.models.designs.as_read.trials[0].session.cutoff_hz

    @property
    def judged_on(self) -> str:
        """The predictions whose errors count: the ground reaction that the motion requires."""
        return "the ground reaction"

    def errors(self) -> list[Explained]:
        """Errors of the ground reaction, on all strides and on held-out strides."""
        pairs = zip((FITTED, CROSS_VALIDATED), self.nominal_error, self.extended_error, strict=True)
        noise = None if math.isnan(self.ceiling_percent) else self.ceiling_percent
        return [
            Explained(self.judged_on, on, before, after, noise)
            for on, before, after in pairs
            if before is not None and after is not None
        ]

    def files(self) -> dict[str, str | bytes]:
        """Return the content of every file of the diagnosis by name, without report and playback."""
        causes = [
            {"name": c.name, "site": c.site, "parameters": {n: one.value for n, one in c.parameters.items()}}
            for c in self.causes
        ]
        model = {"model": {"rig": "body", "urdf": BODY_FILE, "cutoff_hz": self.cutoff_hz}, "effect": causes}
        return super().files() | {"model.toml": tomli_w.dumps(model), BODY_FILE: self.model.urdf}

    def own_record(self) -> dict[str, Any]:
        """Return the part of `diagnosis.json` that only a walk has."""
        found = {f"{c.name}.{n}": one.record() for c in self.causes for n, one in c.parameters.items()}
        pairs = zip(({}, found), (self.nominal_error, self.extended_error), strict=True)
        nominal, extended = (
            {"parameters": p, "error_percent": {"fit": shown(f), "held_out": shown(h)}} for p, (f, h) in pairs
        )
        residual = self.models.designs.residual(self.best.names, self.best.fitted.values)[0]
        sizes = zip(CHANNELS, np.sqrt(np.sum(residual**2, axis=1)), strict=True)  # in the mean stride
        noise: dict[str, Any] = {name.replace(" ", "_"): {"std": shown(float(s)), "ar": []} for name, s in sizes}
        record = self.models_record(nominal, extended, noise, ("coordinates", "file"))
        return {**record, "cutoff_hz": self.cutoff_hz}

    def assumed(self) -> dict[str, str]:
        """See `Result.assumed`: the body, what errors are ordinary, the low pass, and the estimator."""
        body = self.models.designs.as_read.trials[0].motion.body
        errors = "landmarks, plates and soft tissue have ordinary errors"
        known = {"body": f"{body.mass_kg:.4g} kg", "ordinary": errors, "low pass": f"{self.cutoff_hz:g} Hz"}
        return {**known, **super().assumed()}

    def effect(self, name: str) -> type[WalkEffect] | None:
        """Return the class of a cause."""
        return next((e for e in EFFECTS if e.name == name), None)

    def notes(self) -> list[tuple[str, str]]:
        """Return notes in addition to the table, by topic."""
        where, many = self.remainder.where, self.models.designs.strides.count > 1
        state = "a residual" if where else "none"
        state += " repeats in every stride" if many else " exceeds that of 1 mm of marker noise"
        most = f", most in {where}" if where else ""
        rows = [("noise from stride to stride alone", f"E {percent(self.ceiling_percent)}")] * many
        rows += [("lack of fit", f"{state} ({self.remainder.tested()}{most})")]
        for cause in self.causes:
            if (gain := cause.further.get("other_leg")) is not None:
                words = f"{gain:.0f} % of its squared error, in single supports"
                rows.append((f"{cause.name} ({cause.site}) of one leg's size gains on the other", words))
            if cause.elsewhere:
                rows.append((f"{cause.name} as well at", "; ".join(cause.elsewhere[:4])))
        return [*rows, *([("not testable here", ", ".join(self.absorbed))] if self.absorbed else []), *super().notes()]
