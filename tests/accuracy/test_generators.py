"""What the generators make: studies that are read as they were made, with what is true of them."""

import re
from dataclasses import asdict
from itertools import islice
from pathlib import Path

import pytest
from confusion_matrix import stimuli
from frozen_answers.answers import beside_truth
from frozen_answers.studies import COUNTS, studies
from harness import run as runs
from harness.generator import Item, Truth
from harness.generators import GENERATORS, generator_of
from harness.run import answered

import fes_pin as fp

SLOW = {"arm": "one trial of 20 s and more", "stimulated": "sized like a free one, controlled besides"}


class Answer:
    """An answer that names nothing."""

    @staticmethod
    def to_json():
        return '{"verdict": "adequate", "causes": [], "remainder": {"unexplained": false}}'


@pytest.fixture
def asked(monkeypatch):
    """The studies that are asked about; the answers name nothing."""
    seen = []

    def with_no_answer(name):
        generator = generator_of(name)
        generator.ask = lambda study: seen.append(study) or Answer()
        return generator

    monkeypatch.setattr(runs, "generator_of", with_no_answer)
    monkeypatch.setattr(stimuli, "DURATION_S", 2.0)
    return seen


NAMES = [
    pytest.param(name, marks=[pytest.mark.shared] * (name in ("walking", "halved")))
    for name in GENERATORS
    if name not in SLOW
]


@pytest.mark.parametrize("name", NAMES)
def test_a_study_is_asked_about_as_it_was_made(name, asked, request):
    if name in ("walking", "halved"):
        request.getfixturevalue("shared")
    item = next(item for item in islice(generator_of(name).plan(3), 20) if item.hidden)
    row = answered(name, item)
    assert row.error is None and row.key == item.key and row.hidden and not row.right
    (study,) = asked
    changed = name in ("contrast", "halved")
    assert len(study.trials) > 0 and (len({t.group for t in study.trials}) == 2) == changed


def test_studies_of_a_folder_have_the_answers_beside_them(tmp_path, asked):
    generator = generator_of("imposed")
    item = next(generator.plan(3))
    study, _ = generator.make(item, tmp_path / "made")
    fp.write_study(study, tmp_path / "one")
    place = tmp_path / "answers/one/answer.json"
    place.parent.mkdir(parents=True)
    place.write_text('{"causes": ["a_thing_nobody_knows"], "true_inertia_scale": 1.5, "parameters": {"b": 0.2}}')
    (item,) = generator_of(str(tmp_path)).plan(0)
    assert item == Item("one", 0, ("a_thing_nobody_knows",), outside=True)
    _, truth = generator_of(str(tmp_path)).make(item, tmp_path)
    assert truth.parameters == {"inertia_scale": 1.5, "damping": 0.2}
    assert answered(str(tmp_path), item).kind == "outside"


def test_a_cause_of_no_library_has_no_true_model(asked, monkeypatch):
    item = next(item for item in generator_of("driven").plan(3) if item.outside)
    monkeypatch.setattr(runs.never_worse, "errors_against", lambda *_: {"free, unseen": (2.0, 4.0, 1.0)})
    row = answered("driven", item, withholds=True)
    assert row.error is None and row.against and not row.true


def test_nothing_is_named_where_nothing_is_hidden(monkeypatch):
    monkeypatch.setattr(stimuli, "DURATION_S", 4.0)
    found = answered("free", Item("muscle-none-null-d0-white-5", 5))
    assert found.error is None and found.verdict == "adequate" and found.cpu_s > 0.0


def test_a_cause_is_named(monkeypatch):
    monkeypatch.setattr(stimuli, "DURATION_S", 4.0)
    found = answered("free", Item("ankle-load_inertia-pulley-d150-ar1-5", 5, ("load_inertia",)))
    assert found.right and found.part == "d = 150, another form"


@pytest.mark.shared
def test_frozen_answers_are_of_studies_that_there_are(shared):
    wanted = [one.name for one in studies(shared)]
    from frozen_answers.__main__ import TABLE, read

    assert len(wanted) == len(set(wanted)) and sum(COUNTS.values()) + 71 == len(wanted)
    assert set(read(TABLE)) == set(wanted)


@pytest.mark.shared
def test_a_frozen_answer_is_right_or_wrong_about_its_own_study(shared):
    from frozen_answers.__main__ import TABLE, read

    frozen, truth = read(TABLE), asdict(Truth())
    some = [one for one in studies(shared) if one.kind == "free" and len(one.item.hidden) == 1]
    one, other = some[0], next(o for o in some if o.item.hidden != some[0].item.hidden)
    assert beside_truth(one, frozen[one.name], truth).right
    assert not beside_truth(one, frozen[other.name], truth).right
    assert beside_truth(one, {"error": "InputError: no"}, truth).error == "InputError: no"


ROOMS = {"body", "data", "models", "paper"}
"""What generators may ask of the package wherever they are imported; `ENGINE` are imported where a study is made or
answered."""
ENGINE = {"confusion_matrix/refit.py", "walking_matrix/strength.py", "harness/effort_alone.py"}


def test_studies_that_were_made_are_answered_by_other_versions_of_the_package():
    """Nothing that moves within it is imported but where a study is made or answered."""
    scripts = Path(runs.__file__).parents[1]
    packages = ("harness", "confusion_matrix", "driven_rigs", "imposed_rigs", "large_rigs", "contrast_pairs")
    packages += ("walking_matrix",)
    files = [file for package in packages for file in scripts.glob(f"{package}/*.py")]
    files += (scripts.parent / "analysis").glob("walks/*.py")
    assert len(files) > 30
    for file in files:
        if f"{file.parent.name}/{file.name}" not in ENGINE:
            found = re.findall(r"^from fes_pin\.(\w+)", file.read_text(), re.MULTILINE)
            assert set(found) <= ROOMS, file
            held = r"^(?:from|import) .*\b(refit|strength|effort_alone)\b"
            assert not re.findall(held, file.read_text(), re.MULTILINE)
