"""Other conventions of a walk's files are told by its motion, said, and taken; what is right is left alone."""

import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import fes_pin as fp
from fes_pin.data.errors import InputError
from fes_pin.data.motion import read_coordinates
from fes_pin.data.new_body_study import new_body_study
from fes_pin.data.schema import BODY
from fes_pin.data.wanted import Wanted
from fes_pin.walk.recording import recordings_of

pytestmark = pytest.mark.shared
WRONG = ("right knee", "left knee", "both knees", "left ankle", "both ankles", "exchanged feet",
         "numbered plates", "three plates", "action",
         "shear sign", "lateral sign", "moments in N mm", "moments about a corner", "moment sign", "forces in kN",
         "degrees under no", "rad under yes", "wraps", "pressure in mm", "translations in mm",
         "inclined axes")  # fmt: skip
RIGHT = ("as it is", "laboratory turned by 90 degrees", "laboratory turned by -40 degrees",
         "laboratory turned by 180 degrees", "clock that began 1000 s before", "columns reordered")  # fmt: skip


@pytest.fixture(scope="module")
def walks(gait, tmp_path_factory):
    """Folders of a usual and of a stiff walk, by whether they limp, and the reaction of each."""
    from walking_matrix.conventions import walk

    folders = {limps: tmp_path_factory.mktemp("walks") / "walk" for limps in (False, True)}
    for limps, folder in folders.items():
        walk(gait, folder, 40 + limps, limps)
    return {limps: (folder, reaction(folder)) for limps, folder in folders.items()}


@pytest.fixture
def made(walks, tmp_path, request):
    """The folder of a stiff walk, to be changed."""
    return Path(shutil.copytree(walks[True][0], tmp_path / "walk"))


def reaction(folder):
    (one,) = recordings_of(fp.read_study(folder))
    return one


def level(values):
    """Lengths of horizontal parts, which no turn about the vertical changes."""
    return np.linalg.norm(values.reshape(len(values), 2, 3)[:, :, :2], axis=2)


def test_there_are_no_others():
    from walking_matrix import conventions

    assert tuple(conventions.WRONG) == WRONG and tuple(conventions.RIGHT) == RIGHT


@pytest.mark.parametrize(("number", "name"), [*enumerate(WRONG)])
def test_a_wrong_convention_is_named_and_the_walk_is_the_same(walks, tmp_path, number, name):
    from walking_matrix import conventions

    whole, usual = walks[number % 2 == 1 or "knee" in name]
    folder = Path(shutil.copytree(whole, tmp_path / "walk"))
    conventions.WRONG[name][0](folder)
    study = fp.read_study(folder)
    (found,) = recordings_of(study)
    assert conventions.named(name, (*study.trials[0].remarks, *found.said))
    size = np.sqrt(np.mean(usual.measured**2)) * (4.0 if name == "inclined axes" else 1.0)  # 0.1 degrees are measured
    for one, other in ((found.measured, usual.measured), (found.needed, usual.needed)):
        assert np.allclose(level(one), level(other), atol=0.005 * size)
        assert np.allclose(one[:, [2, 5]], other[:, [2, 5]], atol=0.005 * size)


@pytest.mark.parametrize(("number", "name"), [*enumerate(RIGHT)])
def test_of_what_is_right_nothing_is_said_and_the_walk_is_the_same(walks, tmp_path, number, name):
    from walking_matrix import conventions

    whole, usual = walks[number % 2 == 1]
    folder = Path(shutil.copytree(whole, tmp_path / "walk"))
    conventions.RIGHT[name](folder)
    assert fp.check(fp.read_study(folder)).odd == ()
    found = reaction(folder)
    assert np.allclose(level(found.residual), level(usual.residual), atol=0.5)
    assert np.allclose(found.residual[:, [2, 5]], usual.residual[:, [2, 5]], atol=0.5)


@pytest.mark.parametrize("by", [0.0, np.pi / 2.0, np.pi, -8.0])
@pytest.mark.parametrize("how", ["numbered", "walkway", "exchanged"])
def test_the_feet_of_one_who_turns_are_known(made, by, how):
    """The right of a walker who turns is no direction of the laboratory."""
    from walking_matrix import conventions

    conventions.over_ground(by)(made)
    usual = fp.read_study(made).trials[0]
    jumps = [words for words in usual.remarks if "jumps by a turn" in words]
    assert len(usual.remarks) == len(jumps) == (abs(by) > 3.0)
    getattr(conventions, how)(made)
    found = fp.read_study(made).trials[0]
    assert len(found.remarks) == 1 + len(jumps)
    assert np.ptp(found["q_pelvis_rotation"]) == pytest.approx(abs(by), abs=0.5)
    for name in ("r_Fy", "l_Fy", "r_copx", "l_copz", "r_Ty"):
        loaded = usual[f"{name[0]}_Fy"] > 30.0
        np.testing.assert_allclose(found[name][loaded], usual[name][loaded], atol=1e-3)


def test_of_one_who_stands_nothing_is_said(gait, tmp_path):
    from walks.synthetic import Wrong, make

    still = replace(
        gait, coefficients=gait.coefficients * np.r_[1.0, np.full(len(gait.coefficients) - 1, 0.03)][:, None]
    )
    make(replace(still, share=0.0 * gait.share + 0.5), tmp_path, Wrong(strides=3, tissue=0.05), 7)
    assert fp.read_study(tmp_path).trials[0].remarks == ()


def stated(folder, **keys):
    lines = "\n".join(f"{key} = {value!r}".replace("'", '"') for key, value in keys.items())
    path = folder / "study.toml"
    path.write_text(path.read_text() + f"\n[conventions]\n{lines}\n")


def test_what_is_stated_is_kept_and_not_tested(made):
    from walking_matrix.conventions import WRONG

    usual = fp.read_study(made).trials[0]
    WRONG["right knee"][0](made)
    stated(made, knee_flexion_right="positive", knee_flexion_left="negative")
    study = fp.read_study(made)
    assert study.trials[0].remarks == ()
    np.testing.assert_allclose(study.trials[0]["q_knee_angle_r"], usual["q_knee_angle_r"])
    text = (made / "study.toml").read_text()
    (made / "study.toml").write_text(text.replace("positive", "negative"))
    kept = fp.read_study(made).trials[0]  # although the walk says otherwise
    np.testing.assert_allclose(kept["q_knee_angle_r"], -usual["q_knee_angle_r"])


def test_a_plate_is_stated_by_its_number(walks, made):
    from walking_matrix.conventions import numbered

    usual = walks[True][1]
    numbered(made)
    stated(made, right_plates=[2], left_plates=[1])
    assert fp.read_study(made).trials[0].remarks == ()
    np.testing.assert_allclose(reaction(made).measured, usual.measured, atol=0.01)
    text = (made / "study.toml").read_text()
    (made / "study.toml").write_text(text.replace("right_plates = [2]", "right_plates = [7]"))
    with pytest.raises(InputError, match="states plate 7; the file has 1, 2"):
        fp.read_study(made)


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("knee_flexion", "positive", "conventions.knee_flexion: unknown"),
        ("knee_flexion_left", "up", "expected one of negative, positive; found 'up'"),
        ("moment_unit", "mN m", "expected one of N m, N mm, kN m"),
        ("right_plates", 1, "expected a list of plates"),
    ],
)
def test_what_no_file_follows_cannot_be_stated(made, key, value, words):
    stated(made, **{key: value})
    with pytest.raises(InputError, match=re.escape(words)) as caught:
        fp.read_study(made)
    assert "study.toml" in str(caught.value)


def test_what_is_written_is_as_the_format_has_it(made, tmp_path):
    from walking_matrix.conventions import WRONG

    for name in ("left knee", "action"):
        WRONG[name][0](made)
    study = fp.read_study(made)
    fp.write_study(study, tmp_path / "copy")
    again = fp.read_study(tmp_path / "copy")
    assert again.trials[0].remarks == study.trials[0].remarks and len(again.trials[0].remarks) == 2
    for column in study.trials[0].columns:
        np.testing.assert_allclose(again.trials[0][column], study.trials[0][column], atol=1e-9)


def test_each_trial_of_a_convention_is_named_once(made):
    from walking_matrix.conventions import WRONG

    WRONG["both knees"][0](made)
    for file in ("coords", "grf"):
        shutil.copy(made / f"{file}.csv", made / f"b_{file}.csv")
    (made / "study.toml").write_text(
        (made / "study.toml").read_text().replace("},", '},\n{coordinates="b_coords.csv",ground_reaction="b_grf.csv"}')
    )
    (said,) = fp.check(fp.read_study(made)).odd
    assert said == "both knees count flexion positive: taken with the other sign (coords, b_coords)"


def test_an_angle_that_wraps_is_unwrapped_in_coordinates_alone(made):
    from walking_matrix.conventions import read, turned

    turned(np.pi, wraps=True)(made)
    assert np.ptp(read(made / "coords.csv")["q_pelvis_rotation"]) > 6.0
    assert np.ptp(read_coordinates(made / "coords.csv")[1]["q_pelvis_rotation"]) < 1.0


def test_the_measured_walk_follows_the_format(walk, tmp_path):
    from walking_matrix import conventions

    for source, name in (("coords_mtpfree.csv", "coords.csv"), ("grf_raw_600hz.csv", "grf.csv")):
        (tmp_path / name).write_bytes((walk / source).read_bytes())
    rig = '[study]\nname = "w"\nrig = "body"\n[rig]\nmass_kg = 72.6\nheight_m = 1.80\n[[trial]]\n'
    trial = 'coordinates = "coords.csv"\nground_reaction = "grf.csv"\nbelt_speed_mps = 1.135\n'
    (tmp_path / "study.toml").write_text(rig + trial)
    assert fp.read_study(tmp_path).trials[0].remarks == ()
    for name in ("right knee", "lateral sign", "pressure in mm"):
        conventions.WRONG[name][0](tmp_path)
    said = fp.read_study(tmp_path).trials[0].remarks
    assert len(said) == 3 and all(
        conventions.WRONG[n][1] in " ".join(said) for n in ("right knee", "lateral sign", "pressure in mm")
    )


def test_a_new_study_states_conventions_that_are_set(walks, tmp_path):
    from walking_matrix.conventions import numbered

    folder = Path(shutil.copytree(walks[False][0], tmp_path / "walk"))
    numbered(folder)
    (folder / "grf.csv").unlink()
    (folder / "study.toml").unlink()
    settings = {"mass_kg": "70", "height_m": "1.7", "knee_flexion_left": "positive"}
    wanted = Wanted(tuple(sorted(folder.glob("*.*"))), BODY, folder, "mine", settings=settings)
    text = new_body_study(wanted).contents["study.toml"]
    assert '[conventions]\nknee_flexion_left = "positive"\n' in text
    (folder / "study.toml").write_text(text)
    assert "plate 1 is the left foot's" in " ".join(fp.read_study(folder).trials[0].remarks)
