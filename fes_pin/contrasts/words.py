"""Changes in words."""

from collections.abc import Mapping
from dataclasses import dataclass

from fes_pin.models.describe import fitted_sentence
from fes_pin.models.rigs.base import Rig
from fes_pin.models.stage import Effect


@dataclass(frozen=True)
class Words:
    """Words for a change of a nominal parameter.

    Attributes
    ----------
    more, less
        Words for a value that rose, and for one that fell.
    by_share
        Whether the ratio of the values is reported, not their difference.
    """

    more: str
    less: str
    by_share: bool = False


NOMINAL: Mapping[str, Words] = {
    "inertia_scale": Words("inertia was added", "inertia was taken away"),
    "inertia_kgm2": Words("inertia was added", "inertia was taken away"),
    "damping": Words("damping was added", "damping was taken away"),
    "damping_nms": Words("damping was added", "damping was taken away"),
    "gravity_scale": Words("weight was added", "weight was taken away", True),
    "gain": Words("the muscle became stronger", "the muscle became weaker", True),
    "time_constant_s": Words("activation became slower", "activation became faster"),
}
"""Words by the names of the study format; any other parameter rose or fell."""


def of_nominal(rig: Rig, name: str, before: float, after: float, unit: str) -> str:
    """Return the change of a nominal parameter in words, with its size in the unit that it has on the rig."""
    words = NOMINAL.get(name, Words(f"{name} rose", f"{name} fell", True))
    happened = words.more if after > before else words.less
    if words.by_share and before:
        return f"{happened}, by {abs(100.0 * (after / before - 1.0)):.3g} %"
    size = abs(after - before)
    if name == "inertia_scale":
        size *= float(rig.constants["inertia"])
        unit = "kg m2" if rig.constants.get("revolute", 1.0) else "kg"
    return f"{happened}, {size:.3g} {unit}".strip()


def of_cause(rig: Rig, effect: Effect, before: float, after: float, unit: str, there_before: bool) -> str:
    """Return the change of a cause in words, by its first parameter."""
    cause = fitted_sentence(effect, rig).removesuffix(".")
    if not there_before:
        return f"new: {cause}, {after:.3g} {unit}".strip()
    return f"changed: {cause}, {before:.3g} -> {after:.3g} {unit}".strip()
