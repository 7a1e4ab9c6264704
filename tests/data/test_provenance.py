"""Where a result comes from: a hash of every file that a study names, and nothing of those that it does not."""

import hashlib
import shutil
from pathlib import Path

import numpy as np

from fes_pin.data.provenance import provenance_now
from fes_pin.data.study import Study, read_study
from fes_pin.data.trial import Trial

DEMO = Path(__file__).parents[2] / "analysis/studies/ankle_demo"


def test_every_file_of_the_study_is_hashed(tmp_path):
    folder = shutil.copytree(DEMO, tmp_path / "study")
    (folder / "other.csv").write_text("no part of it\n")
    study = read_study(folder)
    made = provenance_now(study, 3)
    assert set(made.inputs) == {"study.toml", *(f"trials/{t.name}.csv" for t in study.trials)}
    assert made.inputs["study.toml"] == hashlib.sha256((folder / "study.toml").read_bytes()).hexdigest()
    assert made.seed == 3 and made.versions["numpy"] and "command" not in made.record()
    first = next(iter(folder.glob("trials/*.csv")))
    first.write_text(first.read_text() + "\n")
    assert provenance_now(study, 3).inputs == made.inputs
    changed = provenance_now(read_study(folder), 3).inputs
    assert {n for n in changed if changed[n] != made.inputs[n]} == {f"trials/{first.name}"}


def test_a_study_in_memory_has_no_files(tmp_path, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "0")
    trial = Trial("a", "isometric", {"stim": np.ones(3), "force_n": np.ones(3)}, np.arange(3.0))
    made = provenance_now(Study("s", "muscle", {}, {"gain": 1.0, "time_constant_s": 0.05}, (trial,), tmp_path), 0)
    assert made.inputs == {} and made.date == "1970-01-01T00:00:00Z"
