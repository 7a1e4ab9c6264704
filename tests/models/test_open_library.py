"""Causes and rigs from outside the package: a file, a module, an installed package's entry points."""

import ast
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fes_pin as fp
from fes_pin.cli.main import main
from fes_pin.models import rigs
from fes_pin.models.catalogue import installed, shipped
from fes_pin.models.disturbance import disturbed
from fes_pin.models.effects import CoulombFriction
from fes_pin.models.model import Model
from fes_pin.models.outside import load_module
from fes_pin.models.stage import classes_in
from fes_pin.search.starts import refinements

DOCUMENT = Path(__file__).parents[2] / "docs" / "own_causes_and_rigs.md"
INERTIA, STIFFNESS, DAMPING, ONE_WAY = 0.02, 0.9, 0.01, 0.03
DT = 0.01


def files_of_the_document():
    blocks = re.findall(r"```python\n# (\w+\.py)\n(.*?)```", DOCUMENT.read_text(), re.DOTALL)
    return dict(blocks)


@pytest.fixture
def own(tmp_path):
    """The document's two files, as a user has them."""
    for name, text in files_of_the_document().items():
        (tmp_path / name).write_text(text)
    return tmp_path


def swing(number, seconds=4.0, one_way=ONE_WAY):
    """A tail with a door closer in it, by scipy: time, motor torque and angle without noise."""
    rng = np.random.default_rng([8, number])
    time = np.arange(round(seconds / DT)) * DT
    motor = np.repeat(rng.uniform(-0.4, 0.4, 1 + len(time) // 25), 25)[: len(time)]
    motor[:10] = 0.0

    def rates(_, x, torque):
        q, v = x
        return [v, (torque - STIFFNESS * q - DAMPING * v - one_way * max(v, 0.0)) / INERTIA]

    x, angle = [0.0, 0.0], []
    for torque in motor:
        angle.append(x[0])
        x = solve_ivp(rates, (0.0, DT), x, args=(torque,), rtol=1e-9, atol=1e-11).y[:, -1]
    return time, motor, np.array(angle)


def table(columns):
    rows = zip(*columns.values(), strict=True)
    return "\n".join([",".join(columns), *(",".join(f"{x:.9g}" for x in row) for row in rows)]) + "\n"


@pytest.fixture
def study(tmp_path):
    """A study of tails that hides the door closer, with wrong start values and noise."""
    rng, folder = np.random.default_rng(9), tmp_path / "study"
    folder.mkdir()
    lines = ['[study]\nname = "tail"\nrig = "tail"\n', f"[rig]\nstiffness_nm_per_rad = {STIFFNESS}\n"]
    lines.append("[start]\ninertia_kgm2 = 0.025\ndamping_nms = 0.02\n")
    for number in range(3):
        time, motor, angle = swing(number)
        noisy = angle + 1e-3 * rng.standard_normal(len(time))
        (folder / f"{number}.csv").write_text(table({"time_s": time, "motor_nm": motor, "angle_rad": noisy}))
        lines.append(f'[[trial]]\nfile = "{number}.csv"\n')
    (folder / "study.toml").write_text("\n".join(lines))
    return folder


def test_a_cause_and_a_rig_of_ones_own_files_work_end_to_end(own, study):
    library = fp.load_library(own / "tail.py", own / "door_closer.py")
    measured = fp.read_study(study, rigs=library.schemas())
    diagnosis = fp.diagnose(measured, library=library)
    (cause,) = diagnosis.causes
    assert (cause.name, cause.equivalents) == ("door_closer", ())
    estimate = cause.parameters["coefficient"]
    assert abs(estimate.value - ONE_WAY) < 4.0 * estimate.std < 0.1 * ONE_WAY
    assert estimate.unit == "N m s/rad"
    assert not diagnosis.remainder.unexplained
    assert "door_closer.py" in str(diagnosis)

    fp.report(diagnosis, own / "report.html")
    page = (own / "report.html").read_text()
    for words in (
        "A damper that brakes one way only.",
        "--library door_closer.py --library tail.py",
        "code of tail.py",
    ):
        assert words in page

    fp.save_model(diagnosis.model, own / "model.toml")
    model = fp.load_model(own / "model.toml", library=[own / "tail.py", own / "door_closer.py"])
    assert model.parameters() == diagnosis.model.parameters()
    time, motor, angle = swing(7)
    trial = fp.Trial("new", "motion", {"motor_nm": motor}, time)
    assert np.abs(fp.predict(model, trial)["angle_rad"] - angle).max() < 2e-3
    assert np.abs(fp.predict(model - "door_closer", trial)["angle_rad"] - angle).max() > 0.05
    with pytest.raises(fp.InputError, match=r"column rig: tail is of tail.py; expected library='PATH/tail.py'"):
        fp.load_model(own / "model.toml")
    with pytest.raises(fp.InputError, match=r"row \d+, column effects.door_closer: door_closer is of door_closer.py;"):
        fp.load_model(own / "model.toml", library=own / "tail.py")


@pytest.fixture
def package(own, tmp_path):
    """An installed package that registers both: a folder of modules and its dist-info."""
    site = tmp_path / "site"
    (site / "mylab").mkdir(parents=True)
    (site / "mylab" / "__init__.py").write_text("")
    for name in files_of_the_document():
        (site / "mylab" / name).write_text((own / name).read_text())
    info = site / "mylab-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: mylab\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[fes_pin.effects]\ndoor_closer = mylab.door_closer:DoorCloser\n\n[fes_pin.rigs]\ntail = mylab.tail\n"
    )
    return site


def fes_pin(*arguments, site=None):
    path = {"PYTHONPATH": str(site)} if site else {}
    command = [sys.executable, "-m", "fes_pin.cli.main", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, env=os.environ | path, check=False)


def test_a_package_brings_both_by_its_entry_points(package, study, tmp_path):
    run = fes_pin("diagnose", study, "--out", tmp_path / "out", site=package)
    assert run.returncode == 0, run.stderr
    assert run.stderr.splitlines() == [
        "fes-pin: runs the code of mylab.door_closer: door_closer",
        "fes-pin: runs the code of mylab.tail: tail",
    ]
    written = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert [c["name"] for c in written["causes"]] == ["door_closer"]
    assert written["library"] == {"mylab.door_closer": ["door_closer"], "mylab.tail": ["tail"]}

    time, motor, angle = swing(7)
    (tmp_path / "new.csv").write_text(table({"time_s": time, "motor_nm": motor}))
    given = ("predict", tmp_path / "out" / "model.toml", tmp_path / "new.csv", "--out", tmp_path / "made.csv")
    without = fes_pin(*given)
    assert (without.returncode, without.stdout, without.stderr.count("\n")) == (2, "", 1)
    assert "tail is of mylab.tail; expected --library='mylab.tail'" in without.stderr
    assert not (tmp_path / "made.csv").exists()
    assert fes_pin(*given, site=package).returncode == 0
    made = np.loadtxt(tmp_path / "made.csv", delimiter=",", skiprows=1)[:, 1]
    assert np.abs(made - angle).max() < 2e-3


def test_a_package_that_is_broken_is_one_line(package):
    (package / "mylab" / "tail.py").write_text("raise RuntimeError('no tail')")
    run = fes_pin("effects", site=package)
    assert (run.returncode, run.stdout, run.stderr.count("\n")) == (2, "", 1)
    assert "fes_pin.rigs tail = mylab.tail of the package mylab cannot be loaded: no tail" in run.stderr


def test_the_command_line_lists_ones_own_and_says_whose_code_it_runs(own, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["fes-pin", "effects", "--library", str(own / "door_closer.py")])
    with pytest.raises(SystemExit) as ended:
        main()
    printed = capsys.readouterr()
    assert ended.value.code in (0, None)
    assert printed.err == f"fes-pin: runs the code of {own / 'door_closer.py'}: door_closer\n"
    assert f"door_closer (joint; rigs: joint; code of {own / 'door_closer.py'})" in " ".join(printed.out.split())
    assert "torque - coefficient ramp(v)" in printed.out


CAUSE = files_of_the_document()["door_closer.py"]
BAD = {
    "no_file": (None, "no such file"),
    "not_python": (CAUSE.replace("class DoorCloser", "clas DoorCloser"), "row 10: cannot be run: SyntaxError"),
    "raises": (CAUSE + "\nprint(1 / 0)\n", "cannot be run: ZeroDivisionError: division by zero"),
    "ends": (CAUSE + "\nraise SystemExit(0)\n", "cannot be run: SystemExit: 0"),
    "empty": ("", "holds no cause and no rig"),
    "no_dataclass": (CAUSE.replace("@dataclass(frozen=True)\n", ""), "class DoorCloser: expected @dataclass"),
    "no_signal": (CAUSE.replace("name, stage, signal, rigs", "name, stage, signals, rigs"), "expected signal"),
    "other_signal": (CAUSE.replace('"torque", (', '"torqe", ('), "found 'torqe'"),
    "other_rig": (CAUSE.replace('("joint",)', '("knee",)'), "expected a rig that there is, found 'knee'"),
    "rig_as_text": (CAUSE.replace('("joint",)', '"joint"'), "expected rigs, a tuple of names"),
    "no_null": (CAUSE.replace("null=0.0, ", ""), "expected a parameter with a null"),
    "no_apply": (CAUSE.replace("def apply", "def act"), "expected a method apply(self, value, s)"),
    "out_of_bounds": (CAUSE.replace("parameter(0.01", "parameter(11.0"), "expected coefficient from 0 to 10"),
    "no_stage": (CAUSE.replace("Stage.JOINT", '"hip"'), "expected a stage, one of Stage.NERVE"),
    "taken": (CAUSE.replace('"door_closer"', '"coulomb_friction"'), "coulomb_friction is a name of fes_pin already"),
    "shadows": (CAUSE.replace("coefficient", "rate"), "expected another name than rate, which every effect has"),
    "odd_name": (CAUSE.replace('"door_closer"', '"door closer"'), "expected a name of letters, digits and _"),
}


@pytest.mark.parametrize(("text", "words"), BAD.values(), ids=BAD)
def test_a_file_that_is_not_whole_is_one_line(text, words, tmp_path):
    path = tmp_path / "mine.py"
    if text is not None:
        path.write_text(text)
    with pytest.raises(fp.InputError) as caught:
        fp.load_library(path)
    message = str(caught.value)
    assert message.startswith(str(path)) and words in message and "\n" not in message
    stays = f"fes_pin_library_{path.stem}" in {name.rsplit("_", 1)[0] for name in sys.modules}
    assert stays == (text is not None and "cannot be run" not in message)  # what did not run is no module


@pytest.mark.filterwarnings("ignore::fes_pin.InputWarning")
def test_an_error_in_its_equations_is_one_line_without_a_library_too(own):
    path = own / "mine.py"
    path.write_text(CAUSE.replace("s.v", "s.speed"))
    row = 1 + next(k for k, line in enumerate(path.read_text().splitlines()) if "s.speed" in line)
    rig = rigs.Joint(constants={"inertia": INERTIA, "gravity_cos": 0.0, "gravity_sin": 0.6, "revolute": 1.0})
    trial = fp.Trial("a", "motion", {"effort": np.zeros(9)}, DT * np.arange(9), {"position0": 0.1})
    with pytest.raises(fp.InputError) as caught:
        fp.simulate(Model(rig) + load_module(path).DoorCloser(), trial)
    assert str(caught.value).startswith(f"{path}, row {row}: class DoorCloser: AttributeError: ")
    assert "\n" not in str(caught.value)


def test_a_module_is_found_by_its_name(own, monkeypatch):
    monkeypatch.syspath_prepend(str(own))
    library = fp.load_library("door_closer")
    assert library.origins() == {"door_closer": ["door_closer"]}
    with pytest.raises(
        fp.InputError, match=r"no module doors; expected the name of a module, or a file that ends in \.py"
    ):
        fp.load_library("doors")
    (own / "needs.py").write_text("import nothing_of_that_name")
    with pytest.raises(fp.InputError, match="the module needs cannot be run: ModuleNotFoundError: No module named"):
        fp.load_library("needs")


def test_a_library_changes_nothing_for_others(own):
    before = installed()
    library = fp.load_library(own / "door_closer.py", own / "tail.py")
    assert installed() == before and "door_closer" not in {e.name for e in installed().effects}
    again = fp.load_library(library, own / "door_closer.py")
    assert [e.name for e in again.effects] == [e.name for e in library.effects]
    with pytest.raises(fp.InputError, match="door_closer: no such effect"):
        shipped().effect("door_closer")


def test_a_rig_is_one_file_of_its_folder(monkeypatch, own):
    """Nothing else has to be edited for it to be known."""
    monkeypatch.setattr(rigs, "__path__", [*rigs.__path__, str(own)])
    (own / "door_closer.py").unlink()
    names = {rig.name for rig in classes_in(rigs.__path__, rigs.__name__, rigs.Rig) if hasattr(rig, "name")}
    sys.modules.pop("fes_pin.models.rigs.tail")
    assert names == {*(rig.name for rig in rigs.RIGS), "tail"}


def test_nothing_asks_for_a_rigs_name():
    """No comparison with it and no table by it; effects name the rigs that they act on."""
    asked, names = [], {rig.name for rig in rigs.RIGS}
    for path in sorted(Path(fp.__file__).parent.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            compared = [node.left, *node.comparators] if isinstance(node, ast.Compare) else []
            keys = {one.value for one in getattr(node, "keys", ()) if isinstance(one, ast.Constant)}
            by_rig = isinstance(node, ast.Dict) and keys and keys <= names  # others are tables by stage, or of columns
            if by_rig or names & {one.value for one in compared if isinstance(one, ast.Constant)}:
                asked.append(f"{path.name}:{node.lineno}")
    assert not asked


def test_a_rig_like_a_joint_has_its_random_effort_and_its_forms_of_friction(own):
    """A band's stretch is one that only joints have, and whatever is like one."""
    (rig,) = (one for one in fp.load_library(own / "tail.py").rigs if one.name == "tail")
    model = Model(rig(constants={"stiffness_nm_per_rad": 1.0})) + CoulombFriction()
    assert [e.name for e in disturbed(model, "motion", ("effort",)).effects] == ["coulomb_friction", "random_effort"]
    time = np.linspace(0.0, 9.0, 100)
    measured = {"time": time, "position": np.sin(time), "reading": np.sin(time)}
    forms = [m.effects[0].refined() for m in refinements(model, CoulombFriction(), measured)]
    assert ("stretch",) in forms
    assert ("asymmetry",) not in forms
