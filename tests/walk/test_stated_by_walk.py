"""What a walk states by itself: the mass that plates carry, and what a plate reads while its foot is in the air."""

import re

import numpy as np
import pytest

import fes_pin as fp
from fes_pin.walk.likelihood import WalkNoise, fit_many
from fes_pin.walk.recording import recordings_of
from fes_pin.walk.strides import strides_of
from fes_pin.walk.walk_trial import LOADED_N, level_in_the_air


@pytest.fixture
def clean(gait, tmp_path):
    """Return a function that makes a walk in which nothing is wrong but what is in every session: its folder."""
    from walks.synthetic import Wrong, make

    def made(seed=5, strides=3):
        make(gait, tmp_path, Wrong(strides=strides, tissue=0.44), seed)
        return tmp_path

    return made


def typed(folder, share):
    """State another mass; returns the true one, kg."""
    text = (folder / "study.toml").read_text()
    true = float(re.search(r"mass_kg = ([\d.]+)", text)[1])
    (folder / "study.toml").write_text(re.sub(r"mass_kg = [\d.]+", f"mass_kg = {share * true:.1f}", text))
    return true


def raised(folder, column, by):
    """Add a constant to a column of the plates, always."""
    path = folder / "grf.csv"
    names = path.read_text().split("\n", 1)[0].split(",")
    values = np.loadtxt(path, delimiter=",", skiprows=1)
    values[:, names.index(column)] += by
    np.savetxt(path, values, delimiter=",", header=",".join(names), comments="", fmt="%.7g")


@pytest.mark.parametrize("share", [0.88, 1.13])
def test_a_mass_that_is_mistyped_is_said_and_stands_beside_the_gain(clean, share):
    folder = clean()
    true = typed(folder, share)
    study = fp.read_study(folder)
    (said,) = fp.check(study).odd
    kg, stated = re.fullmatch(
        r"the plates carry ([\d.]+) kg in the mean of whole strides, mass_kg states (.*)", said
    ).groups()
    assert float(kg) == pytest.approx(true, rel=0.01) and float(stated) == study.constants["mass_kg"]
    found = fp.diagnose(study)
    first = found.causes[0]
    assert found.warnings == (said,)
    assert {"condition_misread", "plate_gain"} <= {first.name, *first.equivalents}
    if first.name == "condition_misread":
        value = first.parameters["mass_kg"]
        assert value.unit == "kg" and value.value == pytest.approx(true, abs=4.0 * value.std)
        assert found.model.mass_kg == pytest.approx(value.value, rel=1e-6)
        assert f"the body is stated to weigh {stated} kg; it weighs" in found.headline()
        assert "lacks" not in found.headline()


def test_of_a_mass_that_is_right_nothing_is_said(clean):
    found = fp.check(fp.read_study(clean()))
    assert found.odd == () and "nothing is odd about its numbers" in str(found)


@pytest.mark.parametrize(("side", "by"), [("right", 30.0), ("left", 30.0), ("left", -25.0), ("right", 100.0)])
def test_what_a_plate_reads_in_the_air_is_its_offset(clean, side, by):
    folder = clean()
    whole = strides_of(recordings_of(fp.read_study(folder)), 6.0).count
    raised(folder, f"{side[0]}_Fy", by)
    study = fp.read_study(folder)
    (said,) = fp.check(study).odd
    value = float(re.fullmatch(f"the {side} plate reads (.*) N up while its foot is in the air", said)[1])
    assert value == pytest.approx(by, abs=1.0)
    found = fp.diagnose(study)
    first = found.causes[0]
    assert (first.name, first.site) == ("plate_offset", f"{side} plate, up force, always")
    assert not {"plate_gain", "external_force"} & {first.name, *first.equivalents}
    assert first.parameters["up_n"].value == pytest.approx(by, abs=4.0 * first.parameters["up_n"].std)
    assert found.models.designs.strides.count == whole  # feet come and go as they did


def test_an_offset_that_is_read_in_the_air_may_add_to_errors_that_it_hid(clean):
    """Landmarks of this session are off by more: without the offset the squared forces are less."""
    folder = clean(seed=12, strides=2)
    raised(folder, "l_Fy", -25.0)
    (first,) = fp.diagnose(fp.read_study(folder)).causes
    assert first.site == "left plate, up force, always" and first.gain_held_out.high < 0.0 < first.judged.low


def test_the_measured_walk_states_its_mass(walk, tmp_path):
    for source, name in (("coords_mtpfree.csv", "coords.csv"), ("grf_raw_600hz.csv", "grf.csv")):
        (tmp_path / name).write_bytes((walk / source).read_bytes())
    rig = '[study]\nname = "w"\nrig = "body"\n[rig]\nmass_kg = 64\nheight_m = 1.80\n[[trial]]\n'
    trial = 'coordinates = "coords.csv"\nground_reaction = "grf.csv"\nbelt_speed_mps = 1.135\n'
    (tmp_path / "study.toml").write_text(rig + trial)
    study = fp.read_study(tmp_path)
    assert fp.check(study).odd == ("the plates carry 72.6 kg in the mean of whole strides, mass_kg states 64",)
    (first,) = fp.diagnose(study).causes
    assert {"condition_misread", "plate_gain"} <= {first.name, *first.equivalents}
    raised(tmp_path, "l_Fy", 30.0)
    twice = fp.check(fp.read_study(tmp_path)).odd  # an offset is no weight
    assert twice[0].startswith("the plates carry 72.6 kg") and "the left plate reads 30.1 N up" in twice[1]


TIME = np.arange(0.0, 6.0, 0.01)
STEPS = 700.0 * np.clip(np.sin(2.0 * np.pi * TIME / 1.2) + 0.2, 0.0, 1.0)


@pytest.mark.parametrize(
    ("up", "level"),
    [
        (STEPS, 0.0),
        (STEPS + 30.0, 30.0),
        (STEPS - 45.0, -45.0),
        (350.0 + 250.0 * np.sin(TIME), 0.0),  # one who sways
        (0.0 * TIME + 350.0, 0.0),  # one who stands
        (700.0 * np.sin(np.pi * TIME / 6.0) + 40.0, 0.0),  # a single stance
    ],
)
def test_the_level_of_a_foot_in_the_air_is_that_of_one_that_steps(up, level):
    noise = np.random.default_rng(3).normal(size=len(up))
    assert level_in_the_air(up + noise, np.full(len(up), 700.0)) == pytest.approx(level, abs=0.02 * LOADED_N)


def test_a_reading_of_known_error_is_a_row_of_the_fit():
    """An effect that no wave shows takes the value of its reading; one that both show, their weighted mean."""
    random, harmonics = np.random.default_rng(4), np.array([0, *(h for h in range(1, 9) for _ in range(2))])
    noise = WalkNoise(harmonics, np.eye(6), np.full(6, 4.0), np.zeros((1, 6, len(harmonics), 0)))
    x = np.zeros((1, 1, 6, len(harmonics), 2))
    x[..., 1] = random.normal(size=x.shape[:-1])
    y = 2.0 * x[..., 1] + random.normal(size=x.shape[:-1])
    told, shows = np.array([[5.0, 9.0]]), np.array([[[2.0, 0.0], [0.0, 3.0]]])
    prior = np.full((1, 2), 100.0)
    (alone,), (found,) = fit_many(y, x, prior, noise), fit_many(y, x, prior, noise, read=(told, shows))
    assert found.values[0] == pytest.approx(2.5, abs=1e-3) and np.sqrt(found.covariance[0, 0]) == pytest.approx(
        0.5, rel=1e-3
    )
    weights = 1.0 / alone.covariance[1, 1], 9.0
    expected = (weights[0] * alone.values[1] + weights[1] * 3.0) / sum(weights)
    assert found.values[1] == pytest.approx(expected, abs=0.02)
    (none,) = fit_many(y, x[..., :0], np.zeros((1, 0)), noise, read=(told, shows[..., :0]))
    (bare,) = fit_many(y, x[..., :0], np.zeros((1, 0)), noise)
    assert none.deviance - bare.deviance == pytest.approx(25.0 + 81.0)
