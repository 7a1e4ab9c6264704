import os
import sys
from pathlib import Path

import pytest

from fes_pin.body.build import Body

REPOSITORY = Path(__file__).parents[1]
sys.path.insert(0, str(REPOSITORY / "analysis"))  # paper_ankle, yardsticks
ROUNDING = {
    "allocation": "active sets, and certificates to the last digit",
    "body/test_controllability.py": "eigen-decompositions",
    "body/test_linearize.py": "eigen-decompositions",
    "body/test_minimal_sets.py": "least sets, chosen by comparing sums",
    "body/test_modes.py": "eigen-decompositions",
    "diagnosis/test_claims.py": "verdicts at their critical values",
    "diagnosis/test_found.py::coulomb_friction": "verdicts of whole diagnoses",
    "diagnosis/test_held_out.py": "verdicts at their critical values",
    "driven/test_forms_again.py": "where fits of friction end",
    "identify": "fits to the last digits",
    "paper/test_kalman.py": "factors of nearly singular covariances",
}
"""Files and folders whose tests get the mark `rounding`, after :: by a part of their name; and why."""

LONG = {
    "allocation/test_walk.py": ("[allocate_walking-with what paralysed",),
    "body/test_body_viewer.py": ("test_a_live_viewer_shows", "test_a_nerve_paints"),
    "accuracy/test_generators.py": ("test_a_cause_is_named",),
    "confusion/test_named.py": ("[ankle-joint_stop", "[joint-sensor_lag", "[muscle-potentiation"),
    "contrasts/test_contrast.py": (
        *("test_a_misread_trial_is_told_as_such[changes1]", "test_a_common_cause_is_no_change"),
        *("test_strokes_that_are_repeated", "test_a_band_that_was_tightened"),
    ),
    "contrasts/test_counted_groups.py": ("test_counts_are_no_common_cause",),
    "contrasts/test_late_groups.py": ("test_what_changed", "test_a_slow_log"),
    "contrasts/test_long_groups.py": ("thinned_alike", "change_nothing"),
    "contrasts/test_noisy_groups.py": ("test_nothing_changed", "test_it_is_said"),
    "control/test_control.py": ("test_five_minutes",),
    "control/test_given.py": ("held_or_refused_by_its_name",),
    "control/test_tuning.py": ("test_the_delay_margin_that_is_stated",),
    "data/test_spikes.py": ("test_a_clean_study_is_left_alone[ankle]",),
    "diagnosis/test_adequate.py": (
        "test_nothing_hidden[joint-process]",
        "test_a_slide[False]",
        "off[ankle",
        "off[joint",
    ),
    "diagnosis/test_few_trials.py": ("test_two_real_trials",),
    "diagnosis/test_driven_far.py": ("_gain]", "_damping]", "_hum]", "test_a_twin_is_found", "one_muscle[12]"),
    "diagnosis/test_found.py": (
        *("test_intervals_hold", "-1-True", "-2-True", "-5-True", "-6-False", "-9-True", "-10-True", "-11-True"),
        *("test_friction_of_a_slide[False]", "far_away[1]", "('coulomb_friction',)-ar1-4-True"),
        "test_both_of_two",
    ),
    "diagnosis/test_gaps.py": ("[joint-names2", "[ankle-names", "lack[without"),
    "diagnosis/test_low_passed.py": ("test_nothing_hidden_is_adequate",),
    "diagnosis/test_misread.py": ("test_a_cause_that_shows_at_one_load",),
    "diagnosis/test_one_trial.py": ("test_a_real_swing", "test_friction_is_found_beneath"),
    "diagnosis/test_outside.py": ("a_detent",),
    "diagnosis/test_per_trial_phase.py": (
        "[ankle-breath-process]",
        "[joint-breath-white]",
        "[ankle-hum-white]",
        "kept[ankle",
    ),
    "driven/test_arm.py": ("test_a_diagnosis_names",),
    "driven/test_counts.py": (
        "friction[1810006]",
        "[1810010]",
        "[2230006]",
        "[6350039]",
        "test_friction_that_is_there",
        "test_a_hum",
        "test_counts_that_hunt_hide_no_cogging",
    ),
    "driven/test_driven.py": ("test_play_before", "test_what_no_cause", "adequate[12]", "no_cause[14"),
    "driven/test_evidence_of_held_out_trials.py": ("test_one_trial_unlike_the_others", "test_a_stop_that_one_of"),
    "driven/test_forms_again.py": ("test_a_form_that_led_nowhere",),
    "driven/test_laboratory.py": (
        *("read[effort_offset]", "read[quadratic", "read[cogging", "read[joint_stop", "read[parallel", "read[coulomb"),
        "test_a_seed_makes",
    ),
    "driven/test_correlation_time.py": ("is_no_motion[5", "is_no_motion[40", "misses[('joint_stop'"),
    "driven/test_late_effort.py": (
        *("test_a_reading_that_is_late", "moved[friction]", "moved[nothing else]"),
        *("test_a_log_of_every", "test_an_effort_that_acts_later"),
    ),
    "driven/test_long_record.py": ("every_second_sample[1152001]", "every_second_sample[1152002]"),
    "driven/test_noisy_effort.py": (
        *("test_friction_beside", "test_trials_without_an_effort", "test_what_acted", "no_friction[1830006]"),
    ),
    "driven/test_parts.py": ("test_a_part_that_begins_in_motion",),
    "driven/test_presliding.py": ("test_a_contact_that_stretches_far", "test_a_lag_beside"),
    "driven/test_products.py": ("[1]", "[2]"),
    "driven/test_rivals.py": ("test_a_spring",),
    "driven/test_rough_cost.py": ("test_a_torque_is_found",),
    "driven/test_smooth_play.py": ("test_a_sensor_that_lags",),
    "driven/test_smoothed.py": ("test_dry_friction_is_named_alone", "adequate[40"),
    "driven/test_swing_up.py": (
        *("held[('quadratic", "held[('parallel", "held[('effort_offset", "held[('cogging"),
        *("held[('coulomb", "test_without_a_cause", "test_a_seed_makes"),
    ),
    "driven/test_time_limit_of_likelihood.py": ("test_what_has_earned",),
    "driven/test_without.py": ("test_less_one_cause",),
    "fuzz/test_cases.py": ("a trial of milliseconds",),
    "imposed/test_imposed_ankle.py": ("predicted[force_velocity]", "predicted[passive_relaxation]", "adequate[8]"),
    "imposed/test_imposed_joint.py": (
        *("predicted[passive_relaxation]", "predicted[coulomb_friction]"),
        "test_a_further_form",
    ),
    "imposed/test_imposed_muscle.py": ("test_beside_a_form",),
    "imposed/test_session.py": ("named[potentiation-imposed]",),
    "models/test_model_objects.py": ("test_every_model_is_read_as_it_was_saved[1000]",),
    "test_results.py": ("test_a_walk_comes_back",),
    "test_shared_diagnoses.py": (
        *("[p02", "[p04", "[p06", "[p08", "[p09", "[p11", "[p12", "[p14", "[p19", "[p20"),
        *("[n00", "[n02", "test_a_servo_rubs"),
    ),
    "test_shared_pendulum.py": ("test_",),
    "walk/test_diagnosis.py": ("test_late_plates", "test_soft_tissue_alone", "growth_with_frequency[0.7]"),
    "walk/test_walk_stories.py": ("test_a_hidden_trunk",),
}
"""Whole diagnoses whose like is among those that always run; they get the mark `long`, by a part of their name."""


def pytest_configure() -> None:
    """Say where a file that must be run again, or only when asked for, was moved or renamed."""
    places = [place.partition("::")[0] for place in (*ROUNDING, *LONG)]
    if gone := [place for place in places if not (Path(__file__).parent / place).exists()]:
        raise pytest.UsageError(f"tests/conftest.py, ROUNDING or LONG: there is no {', '.join(gone)}")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what depends on how a processor rounds, to run it once more under other kernels (.ci/run); what is long."""
    for item in items:
        path = item.path.relative_to(Path(__file__).parent)
        if any(part in item.name for part in LONG.get(path.as_posix(), ())):
            item.add_marker(pytest.mark.long)
        if any(_is_of(item, path, *place.split("::")) for place in ROUNDING):
            item.add_marker(pytest.mark.rounding)


def _is_of(item: pytest.Item, path: Path, place: str, part: str = "") -> bool:
    """True of a test in a file or folder, with a part of its name."""
    return place in (path.as_posix(), path.parts[0]) and part in item.name


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
