"""The diagnosis of a study whose fits do not converge."""

from __future__ import annotations

import math
from collections.abc import Sequence

from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.errors_ahead import free_errors
from fes_pin.diagnosis.result import Diagnosis
from fes_pin.identify.fit import rough_noise
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.infer.result import FITTED, HELD_OUT, STOPPED, Remainder
from fes_pin.models.model import Model


def unfitted(study: Study, nominal: LikelihoodFit, reason: str, test: Sequence[Trial]) -> Diagnosis:
    """Return the diagnosis where fits did not converge: the verdict is "stopped", with the reason."""
    floor = rough_noise(Model(nominal.model.rig), nominal.trials)
    inside = free_errors(nominal.model, nominal.trials, floor)
    outside = free_errors(nominal.model, test, floor).error_percent() if test else None
    return Diagnosis(
        study=study,
        verdict=STOPPED,
        causes=(),
        remainder=Remainder(True, math.nan, None),
        absorbed=(),
        nominal=nominal,
        extended=nominal,
        nominal_error=(inside.error_percent(), outside),
        extended_error=(inside.error_percent(), outside),
        ceiling_percent=inside.ceiling_percent(),
        next_experiment=None,
        ranking={},
        held_out_by=HELD_OUT if test else FITTED,
        left_out={},
        wall_s=0.0,
        reason=reason,
    )
