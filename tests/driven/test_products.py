"""A spring that is hard to tell from gravity: its stiffness and its rest are told by their product first."""

import itertools

import pytest
from driven_rigs.draw import draw

from fes_pin.data.study import read_study
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import maximise
from fes_pin.identify.process_noise import first_guess
from fes_pin.models.effects import ParallelStiffness
from fes_pin.models.nominal import nominal_model


@pytest.fixture(scope="module", params=range(3))
def upright(request, tmp_path_factory):
    """A pendulum that stands, near where it would fall from; gravity is believed as it is."""
    folder = tmp_path_factory.mktemp("upright")
    drawn = (draw(("parallel_stiffness",), 1.0, seed, folder / str(seed)) for seed in itertools.count(31))
    return next(itertools.islice((one for one in drawn if one.base == "upright"), request.param, None))


def test_a_fit_follows_the_product_of_stiffness_and_rest(upright):
    study = read_study(upright.study)
    size, rest = upright.truth["parallel_stiffness"], upright.truth["rest"]

    def fitted(share):
        spring = ParallelStiffness(stiffness_nm_per_rad=share * size, rest_angle_rad=rest / share)
        model = nominal_model(study) + spring
        start = model.with_parameters({"inertia_scale": 1.0, "gravity_scale": share})
        return maximise(LikelihoodProblem(start, study.trials, first_guess(model, study.trials)))

    assert fitted(0.25).sse < fitted(1.0).sse + 0.5
