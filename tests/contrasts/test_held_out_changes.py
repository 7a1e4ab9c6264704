"""What changes add to the likelihood of trials that took no part, by fits to the others of every group."""

from dataclasses import replace

import pytest
from contrast_pairs.free import free_pair

import fes_pin as fp
from fes_pin.contrasts.verdict import ContrastVerdict, folds_of_groups


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return free_pair("muscle", ("gain",), 80.0, 9500003, tmp_path_factory.mktemp("pair"))


@pytest.mark.parametrize("sizes", [(2, 2), (2, 5), (7, 3), (12, 12)])
def test_every_fold_holds_out_and_keeps_trials_of_every_group(study, sizes):
    trials = {g: list(study.trials[:1]) * n for g, n in zip("ab", sizes, strict=True)}
    folds = folds_of_groups(trials)
    assert len(folds) == min(5, *sizes)
    assert sorted(i for out in folds for i in out) == list(range(sum(sizes)))
    first = sizes[0]
    for out in folds:
        held = [sum(i < first for i in out), sum(i >= first for i in out)]
        assert all(0 < h < n for h, n in zip(held, sizes, strict=True))


def test_one_trial_of_a_group_is_never_held_out(study):
    assert folds_of_groups({"a": list(study.trials[:1]), "b": list(study.trials[:4])}) == []


def test_held_out_trials_confirm_a_change(study):
    found = fp.contrast(study)
    (change,) = found.changes
    assert change.name == "gain"
    assert change.evidence.low > 0.0
    said = change.record()["judged_by"]
    assert said["measure"] == "twice the log-likelihood" and said["on"] == "cross_validated"
    assert found.provenance is not None and found.record()["provenance"]["seed"] == 0


def test_a_change_that_held_out_trials_do_not_confirm_is_not_claimed(study, monkeypatch):
    monkeypatch.setattr(ContrastVerdict, "_cost_of_held", lambda self, one, folds: float(len(one.items)))
    found = fp.contrast(study)
    assert not found.changes
    assert any("gain:after is significant" in words and "do not confirm" in words for words in found.warnings)


def test_where_nothing_can_be_held_out_the_change_stands(study):
    kept = [next(t for t in study.trials if t.group == "before"), *(t for t in study.trials if t.group == "after")]
    found = fp.contrast(replace(study, trials=tuple(kept)))
    assert any("one trial only" in words for words in found.warnings)
    assert [c.name for c in found.changes] == ["gain"]
    assert "judged_by" not in found.changes[0].record()
