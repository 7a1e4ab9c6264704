"""A study is read the same in twelve ways to record it."""

from itertools import islice

import pytest
from harness.generators import generator_of
from harness.invariance import SAME, WAYS, difference, recorded_as

GENERATORS = ("free", "driven", "laboratory", "swing-up", "imposed", "stimulated")


@pytest.mark.parametrize("name", GENERATORS)
def test_a_study_is_read_the_same_however_it_was_recorded(name, tmp_path):
    made = generator_of(name)
    for item in islice(made.plan(77), 1):
        folder = tmp_path / item.key
        folder.mkdir()
        study = made.make(item, folder)[0]
        for way in WAYS:
            other = recorded_as(study, way, tmp_path / f"{item.key} {way}")
            assert difference(study, other) <= SAME, way


def test_a_column_in_another_unit_is_a_difference(tmp_path):
    made = generator_of("driven")
    item = next(made.plan(5))
    study = made.make(item, tmp_path)[0]
    other = recorded_as(study, "in thousandths", tmp_path / "other")
    text = (tmp_path / "other/study.toml").read_text()
    assert 'unit = "mN' in text
    trial = other.trials[0]
    spoiled = trial.with_columns(effort=1.001 * trial["effort"])
    assert difference(study, type(study)(**{**vars_of(other), "trials": (spoiled, *other.trials[1:])})) > 1e-4


def vars_of(study):
    names = ("name", "rig", "constants", "start", "files")
    return {n: getattr(study, n) for n in names}
