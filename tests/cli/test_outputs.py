"""No command writes over what it read, nor over what it did not write itself; exit code 2 writes nothing."""

import hashlib
import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cli.test_main import fails, run
from cohort.fakes import quick
from cohort.fakes import studies as fake_studies
from data import studies

import fes_pin as fp
from fes_pin.body.build import Body
from fes_pin.cli.main import app
from fes_pin.cohort.run import run_cohort
from fes_pin.data.errors import InputError
from fes_pin.data.files import read_bytes, write_files, write_text
from fes_pin.data.motion import OPTIONAL, REQUIRED
from fes_pin.data.outputs import RECORD, Outputs
from fes_pin.data.trial_files import write_trial
from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.models.nominal import nominal_model
from fes_pin.models.store import save_model

DEMO = Path(__file__).parents[2] / "analysis/studies/ankle_demo"
LIBRARY = """
from dataclasses import dataclass
from fes_pin.models.parameters import parameter
from fes_pin.models.stage import Effect, Stage


@dataclass(frozen=True)
class OwnFriction(Effect):
    \"\"\"Of one's own.\"\"\"

    name, stage, signal, rigs = "own_friction", Stage.JOINT, "torque", ("joint",)
    torque: float = parameter(0.0, unit="N m", null=0.0, lower=0.0, scale=0.01)

    def apply(self, value, s):
        return value - self.torque * s.v
"""


def swing(samples=60, step=0.01):
    time = np.arange(samples) * step
    rows = np.stack([time, 0.8 * np.cos(5.0 * time), -4.0 * np.sin(5.0 * time)], axis=1)
    return "time_s,position,velocity\n" + "".join(f"{a:.3f},{b:.6f},{c:.6f}\n" for a, b, c in rows)


def joint(folder, names, urdf="rig.urdf"):
    """A study of a pendulum whose trials and URDF have these names; the first half is of one group."""
    folder.mkdir(parents=True)
    trials = "".join(
        f'[[trial]]\nfile = "{name}"\ngroup = "{"ab"[2 * k // len(names)]}"\n' for k, name in enumerate(names)
    )
    head = studies.JOINT.split("[[trial]]")[0].replace("rig.urdf", urdf)
    (folder / "study.toml").write_text(head + trials)
    (folder / urdf).write_text(studies.URDF)
    for name in names:
        (folder / name).write_text(swing())
    return folder


@pytest.fixture
def sandbox(tmp_path, monkeypatch):
    """Every kind of file that a command reads."""
    folder = joint(tmp_path / "study", ["a.csv", "b.csv"])
    save_model(nominal_model(fp.read_study(folder)), tmp_path / "model.toml")
    (tmp_path / "own.py").write_text(LIBRARY)
    time = np.arange(100) * 0.01
    (tmp_path / "pulses.csv").write_text("time_s,pulse_width_us\n" + "".join(f"{t:.2f},300\n" for t in time))
    (tmp_path / "body.svg").write_text(Body.from_subject(70.0, 1.75).urdf)
    names = [f"q_{name}" for name in (*REQUIRED, *OPTIONAL)]
    (tmp_path / "walk.csv").write_text(
        ",".join(["time_s", *names]) + "\n" + "".join(f"{t}{',0' * len(names)}\n" for t in (0, 0.01, 0.02))
    )
    monkeypatch.chdir(tmp_path)
    return tmp_path


def hashes(folder):
    """Of every file, what it holds; of every link and folder, that it is there."""
    found = {}
    for path in sorted(folder.rglob("*")):
        content = os.readlink(path) if path.is_symlink() else path.read_bytes() if path.is_file() else "folder"
        found[path.relative_to(folder).as_posix()] = (
            hashlib.sha256(content).hexdigest() if isinstance(content, bytes) else content
        )
    return found


PULSES = ("--max-rate", "50", "--max-charge", "20", "--current", "40", "--max-width", "400", "--rate", "20")
ONE_FILE = {  # words, the option that says where to write, the inputs among the words
    "predict": (
        ("predict", "model.toml", "study/a.csv", "--columns-of", "study/study.toml", "--library", "own.py"),
        "--out",
        ("model.toml", "study/a.csv", "study/study.toml", "own.py"),
    ),
    "predict ahead": (("predict", "model.toml", "study/a.csv", "--residuals"), "--out", ("model.toml", "study/a.csv")),
    "predict a study": (
        ("predict", "model.toml", "study", "--library", "own.py"),
        "--out",
        ("model.toml", "study/study.toml", "study/a.csv", "study/rig.urdf", "own.py"),
    ),
    "urdf": (("urdf", "model.toml", "study/rig.urdf"), "--out", ("model.toml", "study/rig.urdf")),
    "pulses": (("pulses", "pulses.csv", *PULSES), "--out", ("pulses.csv",)),
    "body view": (("body", "view", "--urdf", "body.svg"), "--out", ("body.svg",)),
    "body view a walk": (("body", "view", "--walk", "walk.csv"), "--out", ("walk.csv",)),
    "body nerves": (("body", "nerves", "femoral", "--urdf", "body.svg"), "--map", ("body.svg",)),
}
FOLDERS = {  # words, what the command writes into its folder
    "diagnose": (("diagnose", "it"), ("diagnosis.json", "model.toml", "report.html", "next_trial.csv")),
    "diagnose with a table": (("diagnose", "it", "--tables", "csv"), ("trajectories.csv", "next_trial.csv")),
    "contrast": (("contrast", "it"), ("contrast.json", "report.html")),
    "contrast with another": (("contrast", "study", "it"), ("contrast.json", "report.html")),
    "compare": (("compare", "it"), ("compare.json", "b.csv")),
    "cohort": (("cohort", "it"), ("studies.csv", "causes.csv", "pooled.csv", "prevalence.csv", "cohort.html")),
    "new-study": (("new-study", "it/b.csv", "--urdf", "it/study.toml"), ("study.toml",)),
}
READING = {"allocate", "check", "effects", "body modes", "verify"}


def commands(one, before=""):
    for info in one.registered_commands:
        yield f"{before}{info.name or info.callback.__name__.replace('_', '-')}"
    for group in one.registered_groups:
        yield from commands(group.typer_instance, f"{group.name} ")


def test_every_command_that_writes_is_tried():
    tried = {
        " ".join(w for w in words[:2] if w in ("body", "view", "nerves") or w == words[0])
        for words, *_ in (*ONE_FILE.values(), *FOLDERS.values())
    }
    assert set(commands(app)) == tried | READING | {"datasets"}  # datasets reads no file


WAYS = {
    "itself": lambda path: path,
    "by another name": lambda path: Path("study") / ".." / path,
    "a link": lambda path: linked(path, Path.symlink_to),
    "a hard link": lambda path: linked(path, Path.hardlink_to),
}


def linked(path, how):
    link = Path(f"link{path.suffix}")
    how(link, path.absolute())
    return link


@pytest.mark.parametrize("force", [(), ("--force",)], ids=["", "forced"])
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(("name", "place"), [(n, i) for n, (_, _, inputs) in ONE_FILE.items() for i in inputs])
def test_no_input_is_an_output(sandbox, monkeypatch, capsys, name, place, way, force):
    words, option, _ = ONE_FILE[name]
    out = WAYS[way](Path(place))
    before = hashes(sandbox)
    line = fails(monkeypatch, capsys, *words, option, out, *force)
    assert line.startswith(f"fes-pin: {out}") and "was read" in line
    assert hashes(sandbox) == before


@pytest.mark.parametrize("force", [(), ("--force",)], ids=["", "forced"])
@pytest.mark.parametrize(("name", "place"), [(n, i) for n, (_, names) in FOLDERS.items() for i in names])
def test_no_recording_is_an_output(sandbox, monkeypatch, capsys, name, place, force):
    """A recording or a URDF with the name of a file that the command writes, in the folder that it writes into."""
    words, _ = FOLDERS[name]
    if name == "new-study":
        (sandbox / "it").mkdir()
        (sandbox / "it/b.csv").write_text(swing())
        (sandbox / "it/study.toml").write_text(studies.URDF)
    else:
        joint(sandbox / "it", ["a.csv", place, "c.csv", "d.csv"])
        joint(sandbox / "study/more", ["c.csv"])
    before = hashes(sandbox)
    line = fails(monkeypatch, capsys, *words, "--out", "it", *force)
    if name != "compare":  # of a muscle or an ankle alone
        no_csv = "expected CSV, found .json" in line  # such a recording needs [columns]
        assert place in line and ("was read" in line or "writes over it" in line or no_csv)
    assert hashes(sandbox) == before


@pytest.fixture(scope="module")
def diagnosis():
    """Of a real study, its search stopped at once."""
    return diagnose_joint(fp.read_study(DEMO), limit=0.0)


@pytest.fixture
def stopped(diagnosis, monkeypatch):
    """`fes-pin diagnose` without the diagnosis."""
    monkeypatch.setattr("fes_pin.diagnosis.diagnosis.diagnose_joint", lambda *_, **__: diagnosis)
    return diagnosis


def test_a_recording_under_the_name_of_a_table_or_of_a_proposal_stays(stopped, sandbox, monkeypatch, capsys):
    """It was named by nobody: who measures the proposed trial saves it so."""
    for name in ("trajectories.csv", "next_trial.csv"):
        (sandbox / "study" / name).write_text(swing(80))
        before = hashes(sandbox)
        words = ("diagnose", "study", "--out", "study", *(("--tables", "csv") if name < "o" else ()))
        if name == "trajectories.csv":
            assert run(monkeypatch, "diagnose", "study", "--out", "study") == 0  # it writes no table: nothing goes
            capsys.readouterr()
            after = hashes(sandbox)
            assert {n: after[n] for n in before} == before
            words = (*words, "--tables", "csv")
        before = hashes(sandbox)
        line = fails(monkeypatch, capsys, *words)
        assert name in line and "--force" in line and hashes(sandbox) == before


def test_what_a_diagnosis_wrote_it_replaces_and_takes_away(stopped, sandbox, monkeypatch):
    assert run(monkeypatch, "diagnose", "study", "--out", "answer", "--tables", "csv") == 0
    assert (sandbox / "answer/trajectories.csv").exists()
    assert run(monkeypatch, "diagnose", "study", "--out", "answer") == 0
    assert sorted(os.listdir("answer")) == [RECORD, "diagnosis.json", "model.toml", "report.html"]
    assert set(json.loads((sandbox / "answer" / RECORD).read_text())) == set(os.listdir("answer")) - {RECORD}


ENDINGS = {  # words, the option, an ending that is not written, those that are
    "predict": (("predict", "model.toml", "study"), "--out", ".xlsx", ".csv or .parquet"),
    "pulses": (("pulses", "pulses.csv", *PULSES), "--out", ".xlsx", ".csv or .parquet"),
    "urdf": (("urdf", "model.toml", "study/rig.urdf"), "--out", ".csv", ".urdf or .xml"),
    "body view": (("body", "view"), "--out", ".PDF", ".html or .htm"),
    "body nerves": (("body", "nerves", "femoral"), "--map", ".xlsx", "png"),
}


@pytest.mark.parametrize("force", [(), ("--force",)], ids=["", "forced"])
@pytest.mark.parametrize("name", ENDINGS)
def test_an_ending_that_is_not_written_is_refused(sandbox, monkeypatch, capsys, name, force):
    """A CSV file was written under the name of a spreadsheet, which no spreadsheet opens."""
    words, option, ending, written = ENDINGS[name]
    before = hashes(sandbox)
    line = fails(monkeypatch, capsys, *words, option, f"new{ending}", *force)
    assert line.startswith(f"fes-pin: new{ending}: expected a name that ends in ") and written in line
    assert hashes(sandbox) == before


def test_a_file_without_an_ending_is_csv(sandbox, monkeypatch):
    assert run(monkeypatch, "pulses", "pulses.csv", *PULSES, "--out", "new") == 0
    assert (sandbox / "new").read_text().startswith("time_s,")


@pytest.mark.parametrize("change", ["changed", "of another command", "of nobody"])
def test_what_is_not_as_this_command_wrote_it_needs_force(stopped, sandbox, monkeypatch, capsys, change):
    if change == "of nobody":
        (sandbox / "answer").mkdir()
        (sandbox / "answer/model.toml").write_text("notes")
        says = "no note is here that fes-pin diagnose wrote it"
    elif change == "changed":
        assert run(monkeypatch, "diagnose", "study", "--out", "answer") == 0
        (sandbox / "answer/model.toml").write_text((sandbox / "answer/model.toml").read_text() + "# mine\n")
        says = "was changed since fes-pin diagnose wrote it"
    else:
        Outputs("predict").write("answer", {"model.toml": "1"})
        says = "fes-pin predict wrote it"
    before = hashes(sandbox)
    capsys.readouterr()
    line = fails(monkeypatch, capsys, "diagnose", "study", "--out", "answer")
    assert line.startswith("fes-pin: answer/model.toml: is there already") and says in line and "--force" in line
    assert hashes(sandbox) == before
    assert run(monkeypatch, "diagnose", "study", "--out", "answer", "--force") == 0
    assert run(monkeypatch, "diagnose", "study", "--out", "answer") == 0
    assert (sandbox / "answer/model.toml").read_text().startswith("format = 1")


def test_a_prediction_replaces_an_earlier_one_and_no_recording(sandbox, monkeypatch, capsys):
    words = ("predict", "model.toml", "study/a.csv", "--out")
    for out in ("new.csv", "new.csv", "study/new.csv"):
        assert run(monkeypatch, *words, out) == 0
    (sandbox / "v.csv").write_text(swing())
    before = hashes(sandbox)
    capsys.readouterr()
    assert "--force" in fails(monkeypatch, capsys, *words, "v.csv")
    assert hashes(sandbox) == before
    (sandbox / "gone.csv").symlink_to("nowhere.csv")  # as of data that are kept elsewhere
    assert run(monkeypatch, *words, "gone.csv") == 0 and (sandbox / "nowhere.csv").is_file()
    assert run(monkeypatch, *words, "/dev/null") == 0 and not Path("/dev", RECORD).exists()
    capsys.readouterr()
    assert "notes what it wrote" in fails(monkeypatch, capsys, *words, RECORD)


def shell(words):
    known = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    words = f"{sys.executable} -m fes_pin {words}"
    return subprocess.run(["sh", "-c", words], check=False, env=known, capture_output=True, text=True)


def test_a_recording_that_the_shell_gives_is_an_input(sandbox):
    before = hashes(sandbox)
    made = shell("predict model.toml - --out study/a.csv --force < study/a.csv")
    assert made.returncode == 2 and "was read" in made.stderr and hashes(sandbox) == before


def test_data_sets_are_all_fetched_or_none(sandbox, monkeypatch, capsys):
    made = {"study.toml": "x", "a.csv": "x"}
    monkeypatch.setattr("fes_pin.data.datasets._retrieve", lambda *_: None)
    monkeypatch.setattr("fes_pin.data.datasets.CONVERTERS", {"servo_pendulum": lambda *_: dict(made)})
    words = ("datasets", "servo_pendulum", "--unverified", "--out", "sets")
    fails(monkeypatch, capsys, *words, "biceps_fes")
    assert not Path("sets").exists()
    assert run(monkeypatch, *words) == 0 == run(monkeypatch, *words)
    Path("sets/servo_pendulum/study.toml").write_text("edited")
    before = hashes(sandbox)
    capsys.readouterr()
    assert "was changed since" in fails(monkeypatch, capsys, *words)
    assert hashes(sandbox) == before and run(monkeypatch, *words, "--force") == 0


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a disk that is always full is Linux's")
def test_an_answer_that_cannot_be_printed_was_written(sandbox):
    """Exit code 2 says that nothing is written."""
    made = shell("new-study --rod 1 1 --out rods > /dev/full")
    assert (made.returncode, made.stderr.count("\n")) == (1, 1) and Path("rods/rod.urdf").exists()
    assert "standard output cannot be written" in made.stderr


def test_two_commands_at_once_both_note_what_they_wrote(sandbox):
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda k: Outputs("predict").write_file(sandbox / f"{k}.csv", "x"), range(40)))
    Outputs("predict").check(sandbox, [f"{k}.csv" for k in range(40)])


def test_a_contrast_does_not_replace_the_report_of_a_diagnosis(stopped, sandbox, monkeypatch, capsys):
    assert run(monkeypatch, "diagnose", "study", "--out", "answer") == 0
    before = hashes(sandbox)
    capsys.readouterr()
    line = fails(monkeypatch, capsys, "contrast", "study", "--out", "answer")
    assert "answer/report.html: is there already, and fes-pin diagnose wrote it" in line
    assert hashes(sandbox) == before


def test_a_cohort_in_which_all_fail_leaves_what_was_there(tmp_path):
    good, bad = fake_studies(tmp_path / "good", ["f1", "f2"]), fake_studies(tmp_path / "bad", ["bad"])
    for first in (True, False):
        before = hashes(tmp_path / "out")
        with pytest.raises(InputError, match="none of 1 studies could be diagnosed; the first: study"):
            run_cohort([bad], tmp_path / "out", run=quick)
        assert hashes(tmp_path / "out") == before
        if first:
            run_cohort([good], tmp_path / "out", run=quick)
    (good / "f1/study.toml").write_text("changed")
    (tmp_path / "out/studies/f1/report.html").write_text("my notes")
    before = hashes(tmp_path / "out")
    with pytest.raises(InputError, match=r"f1/report.html: is there already.*force=True"):
        run_cohort([good], tmp_path / "out", run=quick)
    assert hashes(tmp_path / "out") == before
    run_cohort([good], tmp_path / "out", run=quick, force=True)
    assert (tmp_path / "out/studies/f1/report.html").read_text() != "my notes"


def test_an_edited_urdf_is_kept(sandbox, monkeypatch, capsys):
    recordings = ("study/a.csv", "study/b.csv")
    urdf = sandbox / "v3/pendulum.urdf"
    template = ("--pendulum", "0.3", "0.5", "--out", "v3")
    assert run(monkeypatch, "new-study", *template) == 0 == run(monkeypatch, "new-study", *template)
    urdf.write_text(urdf.read_text().replace('mass value="0.5"', 'mass value="0.7"'))
    for words in (template, (*recordings, *template)):
        before = hashes(sandbox)
        capsys.readouterr()
        line = fails(monkeypatch, capsys, "new-study", *words)
        assert line.startswith("fes-pin: v3/pendulum.urdf") and "changed since fes-pin new-study wrote it" in line
        assert hashes(sandbox) == before
    assert run(monkeypatch, "new-study", *recordings, "--urdf", urdf, "--out", "v3") == 0
    assert 'mass value="0.7"' in urdf.read_text()
    capsys.readouterr()
    assert fails(monkeypatch, capsys, "new-study", *recordings, *template).endswith("writes over it")
    capsys.readouterr()
    assert run(monkeypatch, "new-study", *recordings, *template, "--force") == 0
    assert 'mass value="0.5"' in urdf.read_text()


def test_a_page_is_written_with_out_alone(sandbox, monkeypatch, capsys):
    before = hashes(sandbox)
    for words in (("walk.csv",), ("study/study.toml",), ("walk.csv", "--walk", "walk.csv"), ("page.html", "--live")):
        line = fails(monkeypatch, capsys, "body", "view", *words)
        assert repr(words[0]) in line and "--walk FILE" in line and "--out PAGE.html" in line
    assert hashes(sandbox) == before
    assert run(monkeypatch, "body", "view", "--walk", "walk.csv", "--out", "page.html") == 0
    assert run(monkeypatch, "body", "view", "--out", "page.html") == 0
    assert hashes(sandbox)["walk.csv"] == before["walk.csv"]


OUTPUTS = [(words, option) for words, option, _ in ONE_FILE.values()]
OUTPUTS += [((*words[:-1], words[-1].replace("it", "study")), "--out") for words, _ in FOLDERS.values()]


@pytest.mark.parametrize("empty", ["", " "])
@pytest.mark.parametrize(("words", "option"), [*OUTPUTS, (("datasets", "servo_pendulum"), "--out")])
def test_an_output_without_a_name_is_refused(sandbox, monkeypatch, capsys, words, option, empty):
    before = hashes(sandbox)
    for given in ((option, empty), (f"{option}={empty}",)):
        line = fails(monkeypatch, capsys, *words, *given)
        assert option in line and "found nothing" in line
    assert hashes(sandbox) == before


def test_python_writes_over_nothing_that_was_read(tmp_path, diagnosis):
    """No function writes over what this process read and did not write."""
    folder = shutil.copytree(DEMO, tmp_path / "study")
    study = fp.read_study(folder)
    recording = next(folder.rglob("*.csv"))
    before = hashes(folder)
    for write in (
        lambda: fp.write_study(replace(study, trials=study.trials[:1]), folder),
        lambda: fp.save_model(diagnosis.model, recording),
        lambda: fp.report(diagnosis, recording),
        lambda: write_trial(study.trials[0], recording),
        lambda: write_text(recording, "x"),
        lambda: write_files(folder, {"new": "x"}, without=[recording.relative_to(folder).as_posix()]),
        lambda: Body.from_subject(70.0, 1.75).write(folder / "study.toml"),
    ):
        with pytest.raises(InputError, match="was read, and no output is written over it"):
            write()
        assert hashes(folder) == before
    copy = tmp_path / "copy"
    for _ in range(2):  # what was written here may be written again, though it was read meanwhile
        fp.write_study(study, copy)
        fp.read_study(copy)
        fp.save_model(diagnosis.model, tmp_path / "m.toml")
        fp.load_model(tmp_path / "m.toml")
    (tmp_path / "m.toml").write_text("# another program\n" + (tmp_path / "m.toml").read_text())
    fp.load_model(tmp_path / "m.toml")
    with pytest.raises(InputError, match="was read"):
        fp.save_model(diagnosis.model, tmp_path / "m.toml")
    (tmp_path / "m.toml").unlink()
    fp.save_model(diagnosis.model, tmp_path / "m.toml")


def test_a_file_that_was_read_and_is_gone_binds_no_other(tmp_path):
    """The number of a file that is gone may go to the next one."""
    for k in range(5):
        (tmp_path / f"{k}").write_text("read")
        read_bytes(tmp_path / f"{k}")
        (tmp_path / f"{k}").unlink()
        (tmp_path / "out").write_text("of another program")
        write_text(tmp_path / "out", "ours")
        (tmp_path / "out").unlink()
