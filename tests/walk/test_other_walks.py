"""Walks of other laboratories: columns named otherwise, knees counted otherwise, one plate, and what cannot be used."""

import json

import numpy as np
import pytest

from fes_pin.data.errors import InputError
from fes_pin.data.study import read_study
from fes_pin.walk.effects.clock_offset import ClockOffset
from fes_pin.walk.recording import recordings_of
from fes_pin.walk.strides import strides_of

pytestmark = pytest.mark.shared
TOML = """[study]
name = "walk"
rig = "body"
[rig]
mass_kg = 72.6
height_m = 1.80
[[trial]]
coordinates = "coords.csv"
ground_reaction = "grf.csv"
belt_speed_mps = 1.135
"""


def table(path):
    with path.open() as file:
        names = file.readline().strip().split(",")
    return names, np.loadtxt(path, delimiter=",", skiprows=1)


def put(path, names, values):
    np.savetxt(path, values, delimiter=",", header=",".join(names), comments="", fmt="%.9g")


@pytest.fixture
def folder(walk, tmp_path):
    for source, name in (("coords_mtpfree.csv", "coords.csv"), ("grf_raw_600hz.csv", "grf.csv")):
        (tmp_path / name).write_bytes((walk / source).read_bytes())
    (tmp_path / "study.toml").write_text(TOML)
    return tmp_path


def read(folder):
    return recordings_of(read_study(folder))[0]


def scaled(path, chosen, factor):
    names, values = table(path)
    values[:, [chosen(n) for n in names]] *= factor
    put(path, names, values)


def moved(path, part, by):
    names, values = table(path)
    values[:, [part in n for n in names]] += by
    put(path, names, values)


def emptied(path):
    lines = path.read_text().splitlines()
    cells = lines[50].split(",")
    cells[5] = ""
    path.write_text("\n".join([*lines[:50], ",".join(cells), *lines[51:], ""]))


def shortened(path):
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:60], *lines[70:], ""]))


REFUSED = {  # file, change, words
    "elsewhere": ("grf.csv", lambda p: moved(p, "copx", 5.0), "m from the body: expected m"),
    "beside": ("grf.csv", lambda p: scaled(p, lambda n: n[2:3] == "F", 1e-2), "does a foot step next to them?"),
    "gap": ("coords.csv", emptied, "row 51, column q_pelvis_ty: expected a number, found nothing"),
    "samples": ("coords.csv", shortened, "expected a fixed step"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_used_is_refused_in_a_line_that_names_the_file(folder, case):
    file, change, words = REFUSED[case]
    change(folder / file)
    with pytest.raises(InputError) as caught:
        read(folder)
    assert words in str(caught.value) and file in str(caught.value) and "\n" not in str(caught.value)


def test_markers_that_shake_are_no_foot_beside_the_plates(folder):
    """At 8 Hz half a centimetre is 13 m/s2: more than the weight, from sample to sample."""
    whole = read(folder)
    names, values = table(folder / "coords.csv")
    turn = 2.0 * np.pi * 8.0
    values[:, names.index("qdd_pelvis_ty")] -= 0.005 * turn**2 * np.sin(turn * values[:, names.index("time")])
    put(folder / "coords.csv", names, values)
    assert len(read(folder).motion.time) == len(whole.motion.time)


NAMES = {  # plate, foot, force or torque, v or p, axis
    "opencap": lambda p, s, w, k, a: f"{s.upper()}_ground_{w}_{k}{a}",
    "numbered": lambda p, s, w, k, a: f"ground_{w}_{p}_{k}{a}",
    "toolbox": lambda p, s, w, k, a: f"ground_{w}{p}_{k}{a}",
    "calcn": lambda p, s, w, k, a: f"ground_{w}_calcn_{s}_{k}{a}",
}


@pytest.mark.parametrize("case", NAMES)
def test_columns_of_the_ground_reaction_may_be_named_otherwise(folder, case):
    usual = read(folder).plates
    names, values = table(folder / "grf.csv")
    labels, order = ["time"], [0]
    for plate, side in ((2, "r"), (1, "l")):
        for kind, what, letter in (("F", "force", "v"), ("cop", "force", "p"), ("T", "torque", "")):
            labels += [NAMES[case](plate, side, what, letter, axis) for axis in "xyz"]
            order += [names.index(f"{side}_{kind}{axis}") for axis in "xyz"]
    rows = "\n".join("\t".join(f"{v:.9g}" for v in row) for row in values[:, order])
    (folder / "grf.mot").write_text(f"grf\nnRows={len(values)}\nendheader\n" + "\t".join(labels) + f"\n{rows}\n")
    (folder / "study.toml").write_text(TOML.replace("grf.csv", "grf.mot"))
    plates = read(folder).plates
    for side in ("left", "right"):
        assert np.allclose(plates.feet[side], usual.feet[side], atol=1e-4)


def test_knees_that_count_flexion_positive_are_the_same_walk(folder):
    usual = read(folder).motion
    scaled(folder / "coords.csv", lambda n: "knee" in n, -1.0)
    assert np.allclose(read(folder).motion.q, usual.q, atol=1e-9)


def test_of_one_plate_the_stance_on_it_is_used_and_is_no_whole_stride(folder):
    whole = read(folder)
    scaled(folder / "grf.csv", lambda n: n.startswith("l_"), 0.0)
    one = read(folder)
    supports = [rows for side, rows in whole.plates.single_supports() if side == "right"]
    longest = max((rows.stop - rows.start) * whole.motion.dt for rows in supports)
    length = one.motion.time[-1] - one.motion.time[0]
    assert 0.8 * longest < length < 1.25 * longest
    assert strides_of([whole], 6.0).whole
    assert not strides_of([one], 6.0).whole


def test_over_ground_a_late_clock_does_not_move_with_the_body(folder):
    """The column of a clock is what a small shift changes, whether the belt or the body moves."""
    for belt in (1.135, 0.0):
        (folder / "study.toml").write_text(TOML.replace("1.135", str(belt)))
        if not belt:  # the same walk, seen from the belt
            for file, chosen in (("coords.csv", "q_pelvis_tx"), ("grf.csv", "cop")):
                names, values = table(folder / file)
                for k, name in enumerate(names):
                    if name == chosen or name in (f"r_{chosen}x", f"l_{chosen}x"):
                        values[:, k] += 0.08 * values[:, 0]
                    if name == "qd_pelvis_tx":
                        values[:, k] += 1.135
                put(folder / file, names, values)
        recording = read(folder)
        now, later = recording, recording.read_later(0.004)
        change = (later.measured - now.measured)[10:-10] / 0.004
        (form,) = ClockOffset.forms()
        column = -form.columns(now)[10:-10, :, 0]
        assert np.sqrt(np.mean((change - column) ** 2)) < 0.2 * np.sqrt(np.mean(column**2))
        late = np.mean((change - column)[:, 4])
        assert abs(late) < 0.1 * 1.135 * np.mean(now.measured[:, 2])  # a centre of pressure that is carried along


@pytest.fixture
def by_segments(walk, folder):
    """The folder of a study whose body is a table of segments, `body.json`, and the table."""
    stated = "mass_kg = 72.6\nheight_m = 1.80"
    (folder / "study.toml").write_text(TOML.replace(stated, 'segments = "body.json"'))
    content = (walk / "reference/subject01_model.json").read_bytes()
    (folder / "body.json").write_bytes(content)
    return folder, json.loads(content)


def test_a_table_of_segments_may_begin_with_a_byte_order_mark(by_segments):
    folder, _ = by_segments
    plain, path = read(folder), folder / "body.json"
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert np.array_equal(read(folder).residual, plain.residual)


@pytest.mark.parametrize(
    ("place", "stated", "says"),
    [
        ([0.1, 0.2], "", "body.json, joints.hip_r.loc_in_parent: must be three finite numbers in m"),
        (None, "", "body.json, height_m: the body's height must be known to place the pelvis"),
        ([0.0, 0.0, 0.1], "mass_kg = 80", "body.json: its segments weigh 72.60 kg, and the study says mass_kg = 80"),
    ],
)
def test_what_a_table_of_segments_lacks_is_said_with_its_name(by_segments, place, stated, says):
    folder, table = by_segments
    table["joints"]["hip_r"]["loc_in_parent"] = place
    (folder / "body.json").write_text(json.dumps(table))
    text = (folder / "study.toml").read_text()
    (folder / "study.toml").write_text(text.replace("[[trial]]", f"{stated}\n[[trial]]"))
    with pytest.raises(InputError) as error:
        read(folder)
    assert str(error.value).endswith(says)
