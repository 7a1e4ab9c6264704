"""A constant effort may be larger than any commanded one: a load that belief lacks is no offset of a drive."""

import numpy as np
import pytest
from diagnosis.hidden import study_of

from fes_pin.diagnosis.diagnosis import diagnose_joint


def hides(offset):
    """A pendulum with a constant effort."""
    return study_of("joint", lambda *_: {"effort_offset": {"offset": offset}}, seed=4)


@pytest.mark.parametrize("times", [1.5, -2.5])
def test_an_offset_larger_than_the_largest_command_is_found(times):
    offset = times * max(float(np.abs(t["effort"]).max()) for t in hides(0.0).trials)
    (cause,) = diagnose_joint(hides(offset)).causes
    low, high = cause.parameters["offset"].interval
    assert cause.name == "effort_offset"
    assert low < offset < high
