"""What the library does not have leaves a remainder."""

import math

import oracle.rigs
from diagnose.hidden import study_of

from fes_pin.diagnose.diagnosis import diagnose


def test_a_detent_is_not_explained(monkeypatch):
    """A joint that prefers every quarter radian."""
    usual = oracle.rigs.joint_torque

    def torque(x, q, v, t, causes):
        return usual(x, q, v, t, causes) - 0.02 * math.sin(2.0 * math.pi * q / 0.25)

    monkeypatch.setattr(oracle.rigs, "joint_torque", torque)
    diagnosis = diagnose(study_of("ankle", seed=30))
    assert diagnosis.verdict != "adequate"
    assert diagnosis.remainder.unexplained and diagnosis.remainder.where, str(diagnosis)
