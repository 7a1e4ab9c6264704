"""The verdict on causes of a walk: those that are named, with their size, significance and equivalents."""

import re
from collections.abc import Sequence
from dataclasses import replace
from functools import cache, partial

from fes_pin.infer.corrected import Correction
from fes_pin.infer.distributions import normal_tail
from fes_pin.infer.levels import CLAIM_LEVEL, PARAMETER_PENALTY, SEPARABLE
from fes_pin.infer.result import FITTED, NO_GAIN, Cause, Evidence, ParameterEstimate, Remainder
from fes_pin.infer.search import SearchResult
from fes_pin.infer.text import listed, plain_name
from fes_pin.infer.verdict import State, Verdict, Weighed
from fes_pin.models.describe import equation, sentence
from fes_pin.walk.designs import Designs
from fes_pin.walk.effect import STAGE
from fes_pin.walk.effects import EFFECTS
from fes_pin.walk.effects.stated_mass import StatedMass
from fes_pin.walk.judge import StrideErrors, lack_of_fit, other_leg
from fes_pin.walk.models import WalkFit, WalkModels, WalkSearch
from fes_pin.walk.white_noise import white_noise

ORDINARY_MM = 2.0
"""Marker noise up to this is no cause: cameras and fixations have it (L. Chiari et al., Gait Posture 21, 2005)."""


Judgement = State[WalkFit, WalkModels, Weighed]


class WalkVerdict(Verdict[WalkFit, WalkModels, Weighed]):
    """The verdict on what a search over sets of forms found.

    The likelihood of held-out strides counts errors of soft tissue, landmarks and plates in every stride as noise,
    which make up most of an error in newtons. A form that belongs to neither leg must also predict the stances of one
    leg from those of the other. An offset that is read in the air is not judged by the errors in newtons, which other
    errors may hide. With a single stride nothing can be held out; only a cause that is certain is then named.

    Parameters
    ----------
    search
        A search that has run.
    """

    def __init__(self, search: WalkSearch) -> None:
        super().__init__(search)
        self.models, self.errors = search.models, StrideErrors(search.models)
        self.other_leg = cache(partial(_on_other_leg, self.models))

    def weigh(self, found: SearchResult[WalkFit]) -> Weighed:
        """Return the evidence of held-out strides and of the test of lack of fit on a set."""
        designs, best, less = self.models.designs, found.best, found.without
        many = designs.strides.count > 1
        by_errors = {n for n in less if many and not designs.forms[n].reads}
        return Weighed(
            gains={n: self.errors.gain(f, best, many) if n in by_errors else NO_GAIN for n, f in less.items()},
            evidence={n: self.errors.likelihood(f, best) for n, f in less.items()} if many else {},
            lack_of_fit=lack_of_fit(designs, best),
            is_robust=True,
            carried={n: gain for n in less if (gain := self.other_leg(n)) is not None},
        )

    def lack_of_fit(self, state: Judgement) -> Remainder:
        """Return the lack of fit: the residual repeats in every stride, or held-out strides rejected a cause."""
        remainder = state.weighed.lack_of_fit
        if remainder.unexplained or not state.rejected:
            return remainder
        return replace(remainder, unexplained=True, reason=f"strides held out reject {listed(sorted(state.rejected))}")

    def cause(self, state: Judgement, name: str) -> Cause:
        """Return the report of one form of the set."""
        found, weighed, forms = state.found, state.weighed, self.models.designs.forms
        best, form = found.best, forms[name]
        near = self.models.near_rivals(found, name)
        instead = [forms[n] for r in near for n in r.names if n not in best.names]
        values, stds = self.models.sizes(best)[name].tolist(), self.models.deviations(best)[name].tolist()
        each = [*zip(form.parameters, values, stds, form.units, strict=True)]
        (said, equation_here), words = as_fitted(form.cause, form.site, form.parameters), ""
        if form.cause == StatedMass.name:
            body, (share,), (std,) = self.models.designs.stated.body_kg, values, stds
            each = [(form.site, body * (1.0 + share), body * std, "kg")]
            words = f"the body is stated to weigh {body:.4g} kg; it weighs {body * (1.0 + share):.4g}"
        gain = self.errors.gain(found.without[name], best, many := bool(weighed.evidence))
        gained = found.without[name].fitted.deviance - best.fitted.deviance
        return Cause(
            name=form.cause,
            stage=STAGE,
            site=form.site,
            parameters={n: ParameterEstimate(v, s, u) for n, v, s, u in each},
            equivalents=tuple(sorted({f.cause for f in instead} - {form.cause})),
            elsewhere=tuple(dict.fromkeys(f.site for f in instead if f.cause == form.cause)),
            p_value=found.p_values[name],
            gain_fit=self.errors.gain(found.without[name], best, False).percent,
            gain_held_out=gain if many else replace(gain, on=FITTED),
            evidence=weighed.evidence.get(name) or replace(Evidence.of(gained), on=FITTED),
            words=words,
            sentence=said,
            equation=equation_here,
            further={"other_leg": self.other_leg(name)},
        )


def as_fitted(name: str, site: str, parameters: Sequence[str] = ()) -> tuple[str, str]:
    """Return the sentence of a cause, and its equation at a site, with the parts of its vector that are fitted."""
    kind = next(one for one in EFFECTS if one.name == name)
    parts = ", ".join(plain_name(n, "") for n in parameters)
    of_vector = f"\n{kind.vector} = ({parts})" if kind.vector and parts else ""
    return sentence(kind), equation(kind, set(re.findall(r"\w+", site))) + of_vector


def _on_other_leg(models: WalkModels, name: str) -> float | None:
    """Return the gain of a form on the other leg; None of one leg's form, and of a clock's, which is of no leg."""
    form = models.designs.forms[name]
    of_none = form.site.startswith(("left", "right")) or form.shifts
    return None if of_none else other_leg(models.designs, models.fit((name,)))


def marker_noise(designs: Designs) -> tuple[Correction, Cause] | None:
    """Return white noise on the coordinates as a fault of the record, and as a cause; None of a single stride.

    The test is that of noise above that of cameras. The noise is estimated from differences between strides, which no
    model of the mean stride predicts, so that its likelihood is that of these differences.
    """
    if (estimated := white_noise(designs)) is None:
        return None
    level, std, saved = estimated
    beyond = normal_tail((level - ORDINARY_MM) / std) if level > ORDINARY_MM else 1.0
    words = f"white noise of {level:.2g} mm on the coordinates"
    fault = Correction("marker_noise", beyond, CLAIM_LEVEL, words, saved - PARAMETER_PENALTY, SEPARABLE)
    said, equation_here = as_fitted(fault.name, "white")
    cause = Cause(
        name=fault.name,
        stage=STAGE,
        site="white",
        parameters={"markers_m": ParameterEstimate(1e-3 * level, 1e-3 * std, "m")},
        equivalents=(),
        p_value=fault.p_value,
        gain_fit=NO_GAIN.percent,
        gain_held_out=NO_GAIN,
        evidence=replace(Evidence.of(saved), on=FITTED),
        further={"other_leg": None},
        sentence=said,
        equation=equation_here,
    )
    return fault, cause
