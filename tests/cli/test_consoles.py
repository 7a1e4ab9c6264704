"""Whatever a console or a file system can write, a command ends as documented, and its files are UTF-8.

One interpreter is started with the variables of an environment and runs every command in a fork of its own, which is a
real process with real streams, and starts at once.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from cli.test_outputs import DEMO, PULSES, commands, joint

import fes_pin as fp
from fes_pin.cli.main import app
from fes_pin.models.nominal import nominal_model

FORKS = """
import json, os, sys
from fes_pin.cli.main import main
import fes_pin.view.report, fes_pin.diagnosis.diagnosis, fes_pin.models.store

for number, line in enumerate(open("lines", "rb").read().splitlines()):
    child = os.fork()
    if child == 0:
        for handle, name in ((1, "out"), (2, "err")):
            os.dup2(os.open(f"said/{number}.{name}", os.O_WRONLY | os.O_CREAT), handle)
        words = [os.fsdecode(bytes.fromhex(word)) for word in json.loads(line)]
        sys.argv, sys.orig_argv = ["fes-pin", *words], ["python", "-m", "fes_pin", *words]
        try:
            main()
        except SystemExit as end:
            sys.stdout.flush()
            os._exit(end.code)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    open(f"said/{number}.code", "w").write(str(code))
"""
CONSOLES = {
    "C": {"LC_ALL": "C", "PYTHONUTF8": "0"},
    "ascii": {"PYTHONIOENCODING": "ascii"},
    "cp1252": {"PYTHONIOENCODING": "cp1252"},
    "latin-1": {"PYTHONIOENCODING": "latin-1"},
}
SLOW = ("diagnose", "contrast", "cohort", "compare", "verify")
"""Tried on one console: they print as the others do."""
FOLDER = "Kniewinkel ° µs 日本"
RECORDED = "aufgenommen °/Messung µs 日本.csv"
BYTES = b"no text \xff\xb0"
"""A name that is no UTF-8: of an older computer."""


def lines(study):
    """By command a line that works, its names not ASCII wherever it has some."""
    return {
        "diagnose": ["diagnose", study, "--out", "Antwort °", "--limit", "0", "--why", "base_tilt"],
        "check": ["check", study],
        "contrast": ["contrast", study, study, "--out", "Vergleich °", "--limit", "0"],
        "compare": ["compare", study, "--models", "nominal", "--out", "Rang °"],
        "cohort": ["cohort", study, "--out", "Alle °", "--limit", "0", "--workers", "1"],
        "new-study": [
            *("new-study", RECORDED, "--rod", "0.4", "1.2", "--out", "neu °"),
            *("--column", "position=Kniewinkel °:deg", "--column", "effort=Strom µA 日本:Nm"),
        ],
        "predict": ["predict", "Modell °.toml", study, "--out", "vorhergesagt °.csv"],
        "urdf": ["urdf", "Pendel °.toml", "Pendel °.urdf", "--out", "neu °.urdf"],
        "pulses": ["pulses", "Pulse °.csv", "--out", "neue °.csv", *PULSES],
        "verify": ["verify", study, "Antwort °/model.toml"],
        "datasets": ["datasets"],
        "effects": ["effects"],
        "allocate": ["allocate", "left_knee_flexion=-40", "--nerve", "left_femoral"],
        "body modes": ["body", "modes"],
        "body view": ["body", "view", "--out", "Körper °.html"],
        "body nerves": ["body", "nerves", "femoral", "--map", "Karte °.png"],
    }


@pytest.fixture(scope="module")
def here(tmp_path_factory):
    """What the lines name, in a folder."""
    folder = tmp_path_factory.mktemp("here")
    study = folder / FOLDER
    shutil.copytree(DEMO, study)
    told = (study / "study.toml").read_text("utf-8").replace('"ankle-demo"', '"Knöchel ° 日本"')
    first = next((study / "trials").iterdir())
    first.rename(study / "trials" / "Messung µs 日本.csv")
    (study / "study.toml").write_text(told.replace(first.name, "Messung µs 日本.csv"), "utf-8")
    fp.save_model(nominal_model(fp.read_study(study)), folder / "Modell °.toml")
    joint(folder / "Pendel °", ["Messung °.csv"])
    fp.save_model(nominal_model(fp.read_study(folder / "Pendel °")), folder / "Pendel °.toml")
    shutil.copy(folder / "Pendel °/rig.urdf", folder / "Pendel °.urdf")
    time = np.arange(100) * 0.01
    (folder / "Pulse °.csv").write_text("time_s,pulse_width_us\n" + "".join(f"{t:.2f},300\n" for t in time))
    (folder / RECORDED).parent.mkdir()
    rows = "".join(f"{t:.2f},{40 * np.cos(5 * t):.4f},{np.sin(3 * t):.4f}\n" for t in time)
    (folder / RECORDED).write_text("time_s,Kniewinkel °,Strom µA 日本\n" + rows, "utf-8")
    return folder


def run(folder, environment, asked):
    """Exit code, and what was written to both streams, of each command line."""
    (folder / "said").mkdir()
    words = [[(w if isinstance(w, bytes) else w.encode("utf-8")).hex() for w in line] for line in asked]
    (folder / "lines").write_text("\n".join(map(json.dumps, words)))
    known = {n: v for n, v in os.environ.items() if not n.startswith(("LC_", "LANG", "PYTHON"))}
    known |= {"PYTHONPATH": str(Path(__file__).parents[2]), "LANG": "C.UTF-8"}
    made = subprocess.run(
        [sys.executable, "-c", FORKS], cwd=folder, env={**known, **environment}, capture_output=True, check=False
    )
    assert (made.returncode, made.stdout, made.stderr) == (0, b"", b"")
    said = folder / "said"
    return [
        (int((said / f"{k}.code").read_text()), (said / f"{k}.out").read_bytes(), (said / f"{k}.err").read_bytes())
        for k in range(len(asked))
    ]


@pytest.mark.parametrize("console", CONSOLES)
def test_every_command_ends_as_documented_on_every_console(here, tmp_path, console):
    """Those that work do, help is printed, wrong words are one line; all in signs of the console."""
    folder = tmp_path / "here"
    shutil.copytree(here, folder)
    works, every = lines(FOLDER), sorted(commands(app))
    assert set(works) == set(every), "a command without a line of names that are not ASCII"
    missing = [["° µ" if w == FOLDER else w for w in line] for line in works.values() if FOLDER in line]
    wrong = [*missing, *([*name.split(), "日本 °", "--nein °=µ"] for name in every), ["日本 °"]]
    asked = [*works.values(), *([*name.split(), "--help"] for name in every), *wrong]
    if console == "C":  # each is started by itself, and imports all that it needs
        asked = [*works.values(), *wrong[::9]]
    else:  # slow ones print as the others do
        asked = [line for line in asked if line[0] not in SLOW or line not in works.values()]
        asked = asked if console == "ascii" else asked[console == "cp1252" :: 3]
    for line, (code, out, err) in zip(asked, run(folder, CONSOLES[console], asked), strict=True):
        encoding = "ascii" if console == "C" else console
        printed, said = out.decode(encoding), err.decode(encoding)
        assert "Traceback" not in said, (line, said)
        if line in wrong:
            assert (code, printed, said[:7], said.count("\n")) == (2, "", "fes-pin", 1), (line, said)
        else:
            assert code in ((0, 1) if line[0] == "verify" else (0,)) and printed, (line, said)
    if console != "C":
        return
    for written in ("Antwort °/report.html", "neu °/study.toml", "vorhergesagt °.csv", "neu °.urdf", "Körper °.html"):
        assert (folder / written).read_text("utf-8")
    assert "Knöchel ° 日本" in (folder / "Antwort °/report.html").read_text("utf-8")
    assert "Kniewinkel °" in (folder / "neu °/study.toml").read_text("utf-8")


@pytest.mark.parametrize("console", ["C", "utf-8"])
def test_names_that_are_no_utf8(here, tmp_path, console):
    """Bytes of an older computer in names: all is read but what a study cannot name."""
    folder = tmp_path / "here"
    shutil.copytree(here, folder)
    for name, odd in ((FOLDER, BYTES), ("Pulse °.csv", BYTES + b".csv"), ("Pendel °.toml", BYTES + b".toml")):
        os.rename(folder / name, os.path.join(os.fsencode(folder), odd))
    os.rename(folder / RECORDED, os.path.join(os.fsencode(folder), b"recorded" + BYTES + b".csv"))
    asked = {
        "diagnose": ["diagnose", BYTES, "--out", b"answer" + BYTES, "--limit", "0"],
        "check": ["check", BYTES],
        "compare": ["compare", BYTES, "--models", "nominal", "--out", b"ranks" + BYTES],
        "predict": ["predict", "Modell °.toml", BYTES, "--out", b"predicted" + BYTES + b".csv"],
        "urdf": ["urdf", BYTES + b".toml", "Pendel °.urdf", "--out", b"new" + BYTES + b".urdf"],
        "pulses": ["pulses", BYTES + b".csv", "--out", b"pulses" + BYTES + b".csv", *PULSES],
        "body view": ["body", "view", "--out", b"body" + BYTES + b".html"],
        "new-study": ["new-study", b"recorded" + BYTES + b".csv", "--rod", "0.4", "1.2", "--out", "new"],
        "nowhere": ["check", b"nowhere" + BYTES],
        "no command": [BYTES],
    }
    answers = dict(zip(asked, run(folder, CONSOLES.get(console, {}), list(asked.values())), strict=True))
    for name, (code, out, err) in answers.items():
        assert b"Traceback" not in err, err.decode()
        assert code == 2 * (name in ("new-study", "nowhere", "no command")), (name, err)
        assert (out == b"" and err.count(b"\n") == 1) if code else out
    assert rb"no text \xff\xb0" in answers["nowhere"][2] and not (folder / "new").exists()
    report = os.path.join(os.fsencode(folder), b"answer" + BYTES, b"report.html")
    assert r"no text \xff\xb0" in Path(os.fsdecode(report)).read_text("utf-8")
