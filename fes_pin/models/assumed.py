"""What a model of trials assumes: constants that are held, and how its trials begin."""

from collections.abc import Sequence

from fes_pin.data.trial import Trial
from fes_pin.models.model import Model


def assumed_of(model: Model, trials: Sequence[Trial]) -> dict[str, str]:
    """Return what a model holds as stated, and how its trials begin, in words by topic."""
    fitted, values = model.rig.fitted_parameters(), model.parameters()
    own = {n: values[n] for n in model.rig.parameters() if n not in fitted}
    held = {**{n: float(v) for n, v in model.rig.constants.items()}, **own}
    begins = dict.fromkeys(n for t in trials for n in model.rig.unknowns(t.kind))
    start = f"{', '.join(begins)} estimated for each trial" if begins else "at rest, as each trial states"
    constants = {"held as stated": ", ".join(f"{n} = {v:.4g}" for n, v in held.items())} if held else {}
    return {**constants, "start": start}
