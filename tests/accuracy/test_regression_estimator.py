"""The regression that stands beside the package: right where its columns are, and of joints alone."""

import json

import numpy as np
import pytest
from driven_rigs.draw import BASES, urdf
from harness import page
from harness.generator import Item, Truth
from harness.regression import plain, regressed
from harness.row import judged

import fes_pin as fp

ARM = BASES[1]


def arm(folder, friction=0.0, **more):
    """Return an arm whose effort follows from its motion in closed form; another arm's damping is stated."""
    rng = np.random.default_rng(5)
    (folder / "rig.urdf").write_text(urdf(ARM))
    time = np.arange(4000) * 0.002
    trials = []
    for k in range(2):
        w = 2.0 * np.pi * (0.4 + 0.3 * k)
        q, v, a = 0.8 * np.sin(w * time), 0.8 * w * np.cos(w * time), -0.8 * w**2 * np.sin(w * time)
        effort = ARM.inertia * a + ARM.damping * v + ARM.weight * np.sin(q) + friction * np.tanh(v / 0.01)
        effort = effort + 0.01 * rng.standard_normal(len(time))
        trials.append(fp.Trial(f"{k}", "imposed", {"position": q, "effort": effort}, time))
    start = {"inertia_scale": 1.2, "damping": 2.0 * ARM.damping, **more}
    return fp.Study("arm", "joint", {"gravity_scale": 1.0}, start, tuple(trials), folder, {"urdf": folder / "rig.urdf"})


@pytest.mark.parametrize("friction", [0.0, 0.1])
def test_friction_is_named_where_it_is_and_its_size_is_right(tmp_path, friction):
    found = regressed(arm(tmp_path, friction))
    assert found.causes == (("coulomb_friction",) if friction else ())
    assert found.extended["inertia_scale"]["value"] == pytest.approx(1.0, rel=0.01)
    assert found.extended["damping"]["value"] == pytest.approx(ARM.damping, rel=0.1)
    if friction:
        assert found.extended["coulomb_friction"]["value"] == pytest.approx(friction, rel=0.1)
        assert found.nominal["damping"]["value"] > 1.5 * ARM.damping


@pytest.mark.parametrize("friction", [0.0, 0.1])
def test_the_plain_one_has_friction_and_an_offset_without_asking(tmp_path, friction):
    found = plain(arm(tmp_path, friction))
    sizes = {"inertia_scale": 1.0, "damping": ARM.damping, "coulomb_friction": friction, "effort_offset": 0.0}
    for name, size in sizes.items():
        assert found.extended[name]["value"] == pytest.approx(size, rel=0.05, abs=0.005)


def test_its_answer_is_judged_like_the_packages(tmp_path):
    truth = Truth({"inertia_scale": 1.0})
    record = json.loads(regressed(arm(tmp_path, 0.1)).to_json())
    row = judged(Item("k", 1, ("coulomb_friction",)), truth, record, code="x")
    assert row.right and row.alone and [name for name, *_ in row.estimates] == ["inertia_scale"]


def test_a_rig_without_effort_is_refused():
    time = np.arange(50) * 0.01
    trial = fp.Trial("one", "isometric", {"pulse_width_us": 0.0 * time, "force_n": time}, time)
    known = {"threshold_us": 180.0, "saturation_us": 1000.0}
    study = fp.Study("m", "muscle", known, {"gain": 30.0, "time_constant_s": 0.05}, (trial,))
    with pytest.raises(ValueError, match="m: regression is of a joint"):
        regressed(study)


def test_the_page_puts_it_below_its_generator(tmp_path, monkeypatch):
    monkeypatch.setattr(page, "DATA", tmp_path / "a.json")
    monkeypatch.setattr(page, "PAGE", tmp_path / "a.md")
    page.DATA.write_text("{}")
    page.PAGE.write_text(f"{page.BEGIN}\n{page.END}")
    record = json.loads(regressed(arm(tmp_path, 0.1)).to_json())
    row = judged(Item("k", 1, ("coulomb_friction",)), Truth({"damping": 0.05}), record, code="x")
    for name in ("imposed", "driven" + page.BY_REGRESSION, "driven"):
        page.write(name, f"scripts/accuracy {name}", [row])
    assert list(page.read()) == ["driven", "driven, regression", "imposed"]
    assert page.PAGE.read_text().count(" % |") >= 3
