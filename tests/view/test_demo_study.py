"""The study that is shipped: small, readable, and with the answer that its README states."""

from pathlib import Path

import pytest

from fes_pin.data.study import read_study
from fes_pin.models.effects import effect_named
from fes_pin.models.nominal import nominal_model
from fes_pin.search.fit import fit

FOLDER = Path(__file__).parents[2] / "analysis" / "studies" / "ankle_demo"


def test_the_demo_study_is_small():
    assert sum(p.stat().st_size for p in FOLDER.rglob("*") if p.is_file()) <= 300_000


def test_the_demo_study_holds_what_its_readme_says():
    study = read_study(FOLDER)
    assert [t.kind for t in study.trials].count("motion") == 5
    truth = dict(
        (cells[1].strip(" `"), float(cells[2]))
        for line in (FOLDER / "README.md").read_text().splitlines()
        if len(cells := line.split("|")) == 5 and "`" in cells[1]
    )
    assert set(truth) == set(study.start)
    found = fit(nominal_model(study) + effect_named("recruitment_hysteresis")(), study.trials)
    assert found.values["recruitment_hysteresis.half_width_us"] == pytest.approx(35.0, abs=0.5)
    for name, value in truth.items():
        assert found.values[name] == pytest.approx(value, rel=0.03)
