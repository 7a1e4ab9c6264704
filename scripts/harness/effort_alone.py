"""The answer to a study by inverse dynamics alone, without the likelihood: `scripts/accuracy driven --effort`."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import fes_pin as fp
from fes_pin.effort.problem import HOLD, EffortFit
from fes_pin.effort.search import NOT_CARRIED, has_efforts, searched
from fes_pin.effort.verdict import EffortState
from fes_pin.infer.result import Cause, ParameterEstimate, Remainder
from fes_pin.infer.verdict import share_in, word_of
from fes_pin.models.effects import effect_named
from fes_pin.models.nominal import nominal_model
from fes_pin.models.rigs.joint import Joint

REJECTED = "rejected"
"""Verdict where `refusal` says why nothing is claimed."""
NO_EFFORT = "no effort was recorded: what drives the joint is not in the trials"
"""Why nothing is searched."""
NOT_TESTED = Remainder(False, math.nan, None)
"""The lack of fit of a model that was not fitted."""


@dataclass(frozen=True)
class EffortAnswer:
    """What the efforts of a joint state.

    Attributes
    ----------
    causes
        In the order of their gain on held-out data.
    nominal, extended
        Parameters of the nominal and of the extended model.
    remainder
        Lack of fit of the extended model.
    band_hz
        Cut-off frequency of the low pass.
    refusal
        Why nothing is claimed, in words; None where something is.
    """

    verdict: str
    causes: tuple[Cause, ...] = ()
    nominal: Mapping[str, ParameterEstimate] | None = None
    extended: Mapping[str, ParameterEstimate] | None = None
    remainder: Remainder = NOT_TESTED
    band_hz: float = math.nan
    refusal: str | None = None

    def to_json(self) -> str:
        """Return the answer as JSON, by the names of a diagnosis."""
        models = {"nominal": self.nominal or {}, "extended": self.extended or {}}
        record: dict[str, Any] = {
            "verdict": self.verdict,
            "causes": [one.record() for one in self.causes],
            "remainder": self.remainder.record(),
            **{n: {"parameters": {k: x.record() for k, x in one.items()}} for n, one in models.items()},
        }
        return json.dumps(record)


def search_effort(study: fp.Study, seed: int = 0) -> EffortAnswer:
    """Return the causes of a joint by least squares of its low-passed efforts.

    Parameters
    ----------
    study
        A study of a joint. Trials that it holds out are not used.

    Raises
    ------
    InputError
        The study is not of a joint, or its motion is not above the noise.
    """
    trials, joint = [t for t in study.trials if t.role != "held_out"], nominal_model(study).rig
    if not isinstance(joint, Joint):
        raise fp.InputError(f"expected a study of a joint, found one of the rig {study.rig}", file=study.folder)
    if not has_efforts(joint, trials):
        return EffortAnswer(REJECTED, refusal=NO_EFFORT)
    found = searched(joint, trials, seed)
    state, units, left = found.state, joint.units(), found.state.weighed.lack_of_fit
    if not found.is_carried:
        return EffortAnswer(REJECTED, band_hz=found.band_hz, refusal=NOT_CARRIED, remainder=left)
    nominal, extended = found.final(state.found.nominal), found.final(state.found.best)
    return EffortAnswer(
        word_of(bool(state.names), left),
        tuple(_causes(state, extended, units)),
        _estimates(nominal, "", units),
        _estimates(extended, "", units),
        left,
        found.band_hz,
    )


def _estimates(fitted: EffortFit, name: str, units: Mapping[str, str]) -> dict[str, ParameterEstimate]:
    """Return the estimates of a cause by its names, or of the nominal model for an empty name."""
    info = effect_named(name).parameters() if name else Joint.parameters()
    out = {}
    for path in fitted.free:
        cause, _, parameter = path.rpartition(".")
        if cause == name and parameter != HOLD:
            unit = info[parameter].unit.format_map(units) if parameter in info else ""
            out[parameter] = ParameterEstimate.of(fitted, path, unit)
    return out


def _causes(state: EffortState, final: EffortFit, units: Mapping[str, str]) -> list[Cause]:
    """Return the named causes, largest gain first."""
    found, sets, out = state.found, state.search.models, []
    for name, gain in state.weighed.gains.items():
        near = sets.equivalents(found.best, found.without[name], found.rivals[name])
        alike = sorted({n for f in near for n in f.names} - set(found.best.names))
        out.append(
            Cause(
                name=name,
                parameters=_estimates(final, name, units),
                equivalents=tuple(alike),
                p_value=found.p_values[name],
                stage=effect_named(name).stage.value,
                gain_fit=100.0 * share_in(found, name),
                gain_held_out=gain,
                evidence=state.weighed.evidence[name],
            )
        )
    return sorted(out, key=lambda c: -c.gain_held_out.percent)
