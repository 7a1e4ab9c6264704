"""What a search proposes is within physical bounds, however large the readings are."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

import fes_pin as fp
from fes_pin.identify.problem import limits_of
from fes_pin.models.catalogue import installed
from fes_pin.models.rigs import Ankle, Joint, Muscle
from fes_pin.search.library import Library
from fes_pin.search.starts import from_afar, refinements

SCALES = (1e-4, 1.0, 1e3, 1e6)
"""Ranges of readings: a stiff actuator in metres, radians, a wheel in degrees, counts."""
RIGS = {
    "joint": (Joint, {"inertia": 0.1, "gravity_cos": 0.0, "gravity_sin": 1.0, "revolute": 1.0}),
    "muscle": (Muscle, {}),
    "ankle": (
        Ankle,
        {
            "foot_mass_kg": 1.0,
            "com_distance_m": 0.1,
            "moment_arm_m": 0.05,
            "force_scale_n": 200.0,
            "threshold_us": 100.0,
            "saturation_us": 500.0,
            "f0_n": 1.0,
            "f1_per_rad": 1.0,
            "theta_r_rad": 1.0,
        },
    ),
}


def trial_of(rig, kind, scale):
    """A trial whose columns reach as far as `scale`, beginning far from zero."""
    time = np.arange(200) * 0.01
    wave = scale * (5.0 + np.sin(time) + 0.3 * np.sin(7.0 * time))
    columns = {
        "joint": {"position": wave, "effort": wave},
        "muscle": {"pulse_width_us": np.where(time > 0.5, 300.0, 0.0), "force_n": wave},
        "ankle": {"pulse_width_us": np.where(time > 0.5, 300.0, 0.0), "angle_rad": wave},
    }[rig]
    conditions = {"load_kg": 1.0} if rig == "ankle" else {}
    return fp.Trial("far", kind, columns, time, conditions)


@pytest.mark.parametrize(("name", "scale"), [*itertools.product(RIGS, SCALES)])
def test_no_start_of_a_search_is_beyond_a_bound(name, scale):
    rig, constants = RIGS[name]
    model = fp.Model(rig(constants=constants))
    trial = trial_of(name, rig.schema.default_kind, scale)
    library = Library(model, [trial])
    for effect in installed().effects_for(model.rig):
        for one in [*library.grid(effect), *from_afar(library.grid(effect)[0], library.measured)]:
            extended = model + one
            info = extended.parameter_info()
            assert all(info[n].holds(v) for n, v in extended.parameters().items())
            assert refinements(extended, one, library.measured) is not None
            for n, (low, high) in limits_of(extended, [trial]).items():
                assert low <= high, n
                ends = {n: float(np.clip(extended.parameters()[n], low, high))}
                assert replace(extended).with_parameters(ends)
