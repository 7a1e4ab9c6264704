import os
from pathlib import Path

import pytest

from fes_pin.body.build import Body

REPOSITORY = Path(__file__).parents[1]
ROUNDING = {
    "allocate": "active sets, and certificates to the last digit",
    "body/test_controllability.py": "eigen-decompositions",
    "body/test_linearize.py": "eigen-decompositions",
    "body/test_minimal_sets.py": "least sets, chosen by comparing sums",
    "body/test_modes.py": "eigen-decompositions",
    "diagnose/test_claims.py": "verdicts at their critical values",
    "diagnose/test_found.py": "verdicts of whole diagnoses",
    "diagnose/test_held_out.py": "verdicts at their critical values",
    "identify": "fits to the last digits",
    "paper/test_kalman.py": "factors of nearly singular covariances",
}
"""Files and folders whose tests get the mark `rounding`, and why."""

LONG = {
    "body/test_body_viewer.py": ("test_a_live_viewer_shows",),
    "confusion/test_matrix.py": ("test_slice_from_end",),
    "confusion/test_named.py": ("[ankle-joint_stop", "[joint-sensor_lag"),
    "contrast/test_contrast.py": ("test_a_misread_trial_is_told_as_such[changes1]",),
    "control/test_tuning.py": ("test_the_delay_margin_that_is_stated",),
    "data/test_spikes.py": ("test_a_clean_study_is_left_alone[ankle]",),
    "diagnose/test_adequate.py": ("test_nothing_hidden[joint-white]", "test_a_slide[False]", "off[ankle"),
    "diagnose/test_driven_far.py": ("top[sensor_gain]", "top[quadratic_damping]", "test_a_twin_is_found"),
    "diagnose/test_found.py": (
        *("test_intervals_hold", "-1-True", "-2-True", "-5-True", "-6-False", "-9-True", "-11-True"),
        *("test_friction_of_a_slide[False]", "far_away[1]"),
    ),
    "diagnose/test_gaps.py": ("[joint-names2", "[ankle-names1", "lack[without0-False]", "lack[without1-True]"),
    "diagnose/test_one_trial.py": ("test_a_real_swing",),
    "diagnose/test_per_trial_phase.py": ("[ankle-breath-process]", "[ankle-hum-white]", "kept[ankle"),
    "driven/test_driven.py": ("test_play_before", "test_what_no_cause", "adequate[12]"),
    "imposed/test_imposed_ankle.py": ("predicted[force_velocity]", "adequate[8]"),
    "test_shared_diagnoses.py": ("[p02", "[p06", "[p09", "[p19", "[p20", "[n00", "[n02"),
    "test_shared_pendulum.py": ("test_",),
}
"""Whole diagnoses whose like is among those that always run; they get the mark `long`, by a part of their name."""


def pytest_configure() -> None:
    """Say where a file that must be run again, or only when asked for, was moved or renamed."""
    if gone := [place for place in (*ROUNDING, *LONG) if not (Path(__file__).parent / place).exists()]:
        raise pytest.UsageError(f"tests/conftest.py, ROUNDING or LONG: there is no {', '.join(gone)}")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what depends on how a processor rounds, to run it once more under other kernels (.ci/run); what is long."""
    for item in items:
        path = item.path.relative_to(Path(__file__).parent)
        if any(part in item.name for part in LONG.get(path.as_posix(), ())):
            item.add_marker(pytest.mark.long)
        if not ROUNDING.keys().isdisjoint((path.as_posix(), path.parts[0])):
            item.add_marker(pytest.mark.rounding)


@pytest.fixture(scope="session")
def shared() -> Path:
    """Folder of the measured data: FES_PIN_DATA, or `shared` beside the repository."""
    folder = Path(os.environ.get("FES_PIN_DATA") or Path(__file__).resolve().parents[2] / "shared")
    if not (folder / "practice").is_dir() or not (folder / "data").is_dir():
        pytest.skip(f"measured data not there: {folder} holds no practice and data; set FES_PIN_DATA")
    return folder


@pytest.fixture(scope="session")
def walk() -> Path:
    """Folder of the measured walk; the test that needs it is skipped, and says so, where there is none."""
    root = Path(os.environ.get("FES_PIN_DATA", REPOSITORY.parent / "shared"))
    for folder in (root / "data/walking_subject01", root / "walking_subject01"):
        if folder.is_dir():
            return folder
    pytest.skip(f"no measured walk: neither FES_PIN_DATA nor {root} holds walking_subject01")


@pytest.fixture(scope="session")
def body() -> Body:
    return Body.from_subject(mass_kg=72.6, height_m=1.80, sex="male", stance="right")
