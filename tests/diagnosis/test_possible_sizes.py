"""What a cause cannot be is no answer of a free simulation either."""

from dataclasses import replace

from diagnosis.hidden import study_of

from fes_pin.diagnosis.likelihood_models import LikelihoodModels
from fes_pin.models.effects import effect_named
from fes_pin.models.nominal import nominal_model
from fes_pin.search.likelihood_fits import MEASUREMENT


def test_a_size_at_the_end_of_its_range_comes_last():
    """Beside a detent an ankle that hung at 1 rad, the most that it may be tilted by, had been named."""
    study = study_of("ankle")
    looked_for = [effect_named(name) for name in ("base_tilt", "coulomb_friction")]
    sets = LikelihoodModels(nominal_model(study), study.trials, looked_for, answered=False, noise=MEASUREMENT)
    sets.nominal()
    sets.extend(())
    sets.converge(1)
    tilt, friction = sets.fits["base_tilt",], sets.fits["coulomb_friction",]
    assert all(map(sets.is_possible, (tilt, friction)))
    most = tilt.model.parameter_info()["base_tilt.tilt_rad"].upper
    ended = replace(
        tilt,
        model=tilt.model.with_parameters({"base_tilt.tilt_rad": most}),
        at_bound=("base_tilt.tilt_rad",),
        sse=min(tilt.sse, friction.sse) - 1000.0,
        converged=True,
    )
    sets.fits["base_tilt",] = ended
    assert not sets.is_possible(ended)
    assert sets.ranked(1) == [("coulomb_friction",), ("base_tilt",)]
