"""What could be told at most: where the noise is known, and that one cause at most is hidden."""

import pytest
from confusion_matrix import oracle, plan, stimuli, table
from confusion_matrix.generator import make
from confusion_matrix.plan import Item
from confusion_matrix.runner import run_group
from test_matrix import record


def test_small_single_causes_whose_noise_can_be_given_are_asked():
    groups = [group for _, group in zip(range(60), plan.groups(3), strict=False)]
    asked = [item for group in oracle.asked(groups) for item in group]
    assert asked
    assert {item.distance for item in asked} == {15} and {item.kind for item in asked} == {"single"}
    assert {item.noise for item in asked} == {"white", "ar1", "process"}


@pytest.mark.parametrize(
    ("name", "sets"),
    [
        ("joint-coulomb_friction-same-d60-ar1-1", [["coulomb_friction"]]),
        ("joint-base_tilt-same-d60-white-1", [["base_tilt", "sensor_offset"]]),  # twins on a joint
        ("joint-none-null-d0-ar1-1", []),
    ],
)
def test_an_oracle_tells_what_is_there_and_nothing_where_nothing_is(name, sets, monkeypatch, tmp_path):
    monkeypatch.setattr(stimuli, "DURATION_S", 4.0)
    (made,) = make([Item.parse(name)], tmp_path)
    told = oracle.oracle(made)["sets"]
    assert [set(s) for s in told] == [set(s) for s in sets]


def test_it_answers_in_the_place_of_the_diagnosis(monkeypatch):
    monkeypatch.setattr(stimuli, "DURATION_S", 2.0)
    (said,) = run_group([Item.parse("joint-coulomb_friction-same-d15-white-1")], oracle.oracle)
    assert "error" not in said and said["felt"] > 10.0


def test_both_are_counted_on_the_same_studies():
    names = ["ankle-fatigue-same-d15-white-1", "ankle-load_error-same-d15-ar1-1", "ankle-fatigue-ding-d15-ar1-2"]
    told = [record(n, [[n.split("-")[1]]]) for n in names]
    diagnosed = {n: record(n, [["base_tilt"]]) for n in names[:2]}
    text = table.beside(told, diagnosed).splitlines()
    assert "100.0 %" in text[6] and text[6].split()[-1] == "2" and "an oracle" in text[6]
    assert " 0.0 %" in text[7] and "the diagnosis" in text[7]
    assert sum(line.startswith("  ankle") for line in text) == 2
