"""Measured and practice data beside the repository: the right causes, and predictions of swings never seen."""

import json

import pytest

from fes_pin.data.study import read_study
from fes_pin.diagnosis.diagnosis import diagnose_joint

pytestmark = pytest.mark.shared

NAMED = ("p02", "p04", "p06", "p08", "p09", "p11", "p12", "p14", "p19", "p20")
STUDIES = [*(f"{n}_one" for n in NAMED), "n00_none", "n01_none", "n02_none"]


@pytest.mark.parametrize("name", STUDIES)
def test_practice(shared, name):
    diagnosis = diagnose_joint(read_study(shared / "practice" / name))
    truth = json.loads((shared / "practice/answers" / name / "answer.json").read_text())["causes"]
    if not truth:
        assert diagnosis.verdict == "adequate", str(diagnosis)
        return
    assert diagnosis.verdict == "causes_found"
    for cause in truth:
        assert any(cause in (c.name, *c.equivalents) for c in diagnosis.causes), str(diagnosis)


def test_a_servo_is_not_explained(shared):
    """Its effort was computed, at a scale that differs between trials, and its log was interpolated.

    No answer of its controller is seen in the log. Friction is significant, and no held-out trial confirms it.
    """
    diagnosis = diagnose_joint(read_study(shared / "data" / "servo_pendulum"))
    assert {c.name for c in diagnosis.causes} <= {"coulomb_friction"}
    assert diagnosis.remainder.unexplained
