# ruff: noqa: E501  (a table, one parameter a line)
"""200 command lines drawn from the grammar of the options: each ends as documented, and nothing in it is ignored.

The commands, their options, types, bounds and numbers of values are read off the application; a table gives values that
mean something for some of the names. Diagnoses and searches are replaced by what says how it was called.
"""

import hashlib
import random
import re
import shutil
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import pytest
from cli.test_ignored_options import COMMANDS, run
from cli.test_said_of_recordings import CAUSE
from data import studies
from view.reported import ankle_study, diagnosed, joint_study

from fes_pin.data.files import check_folder
from fes_pin.data.motion import OPTIONAL, REQUIRED
from fes_pin.data.outputs import RECORD
from fes_pin.data.study import read_study, write_study
from fes_pin.data.trial_files import write_trial
from fes_pin.models.nominal import nominal_model
from fes_pin.models.store import save_model
from fes_pin.view import report

EXAMPLES = 200
ENDS = Counter()
"""Exit codes, counted."""
QUIET = {"quiet", "verbose", "force", "settle"}
"""Options without an effect where nothing calls for it: no progress, nothing in the way, a limit not reached."""
PATHS = ("ankle", "joint", "ankle/trials/held.csv", "a.csv", "b.csv", "inputs.csv", "nowhere", "text.csv", "model.toml")
VALUES = {  # by the parameter, or by the command and the parameter: what means something first, then what may not
    "rig": ("joint", "ankle", "muscle", "body", "knee"),
    "urdf": ("joint/urdf.urdf", "a.csv", "nowhere"),
    "believed": ("joint/urdf.urdf", "a.csv"),
    "model": ("model.toml", "swing.toml", "a.csv"),
    "compare model": ("model.toml", "swing.toml"),
    "column": ("velocity=", "position=Angle_deg", "position=Angle_deg:rad", "position=Angle_deg:mm", "effort=", "time_s=rate=100", "x=y", "position"),
    "setting": ("a.csv:start_s=1", "load_kg=1", "start_s=1_0", "kind=isometric", "angle_rad=1.9", "damping=0.1", "x", "load_kg="),
    "predict setting": ("load_kg=2", "kind=isometric", "angle_rad=1.9", "angle_rad=190", "start_s=1", "load_kg=x", "load_kg=1e4"),
    "role": ("a.csv=held_out", "*=fit", "a=no", "c.csv=fit"),
    "group": ("a.csv=one", "*=all", "=x"),
    "library": ("own.py", "a.csv", "no_such_module"),
    "trials": ("held", "h*", "up*", "x", ","),
    "exclude": ("held", "*", "up*", "x"),
    "tables": ("csv", "xlsx"),
    "columns_of": ("joint", "ankle", "nowhere"),
    "trial": ("inputs.csv", "ankle", "ankle/study.toml", "ankle/trials/held.csv", "nowhere", "text.csv"),
    "study": ("ankle", "joint", "ankle/study.toml", "nowhere", "text.csv"),
    "studies": ("ankle", "joint"),
    "after": ("joint", "ankle"),
    "files": ("a.csv", "b.csv", "b.csv", "text.csv"),
    "by": ("group", "load_kg", "x"),
    "groups": ("a,b", "a"),
    "models": ("nominal", "nominal,hill", "x"),
    "workers": (3, 0, "x"),
    "scheduler": ("tcp://localhost:1",),
    "names": ("rat_muscle", "x"),
    "posture": ("standing", "one_leg", "mid_stance", "sitting"),
    "sex": ("male", "female", "x"),
    "stance": ("left", "right", "both"),
    "brace": ("corset", "left_knee_flexion", "plaster"),
    "influence": ("joints", "modes", "bones"),
    "map_to": ("map.png", "map.txt", "nowhere/map.png"),
    "nerve": ("left_femoral", "femoral", "vagus"),
    "body nerves name": ("femoral", "right_tibial", "vagus"),
    "segments": ("a.csv", "nowhere"),
    "torque": ("left_knee_flexion=-40", "left_knee_flexion=-30", "toe=1", "left_knee_flexion"),
    "angle": ("left_knee_flexion=20", "left_knee_flexion=900", "left_knee_flexion=10"),
    "rate": ("left_knee_flexion=-20", "left_knee_flexion=inf"),
    "predict out": ("out.csv", "-", "out", "inputs.csv", ""),
    "pulses out": ("out.csv", "inputs.csv"),
    "urdf out": ("out.urdf", "joint/urdf.urdf"),
    "urdf model": ("swing.toml", "model.toml"),
    "cohort out": ("out", "a.csv", "ankle", ""),
    "body view out": ("out.html", "a.csv", "nowhere/out.html"),
    "body view walk": ("walk.csv", "a.csv", "nowhere"),
    "pulses trial": ("inputs.csv", "ankle/trials/up.csv", "a.csv"),
    "out": ("out", "out.csv", "a.csv", "ankle", "", "-"),
    "mass": (60.0, 80.0, -1.0),
    "height": (1.7, 9.0),
    "passive": (1.0, -1.0),
    "threshold_us": (100.0, 2000.0),
    "saturation_us": (900.0, 50.0),
    "strength": (0.7, 1.0, -1.0),
    "least": (0.2, 2.0),
    "horizon": (0.1, 0.2, -1.0),
    "mode": (1, 3, 99),
    "lean": (2.0, -1.0),
    "settle": (5.0, 0.0),
    "max_braces": (1, -1),
    "max_width": (400.0, 100.0),
    "max_rate": (50.0, 10.0),
    "max_charge": (20.0, 1.0),
    "current": (40.0, 0.0),
    "pulses rate": (20.0, 0.0),
    "width": (300.0, 0.0),
    "slope": (0.05, 0.0),
    "pendulum": (0.3, 0.5),
    "rod": (0.4, 1.2),
}  # fmt: skip


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """Small studies, models, recordings and a library, to be copied for each command line; and a diagnosis."""
    folder = tmp_path_factory.mktemp("inputs")
    study = ankle_study()
    found = diagnosed(study, (), ())
    trials = [t for t in found.study.trials if t.kind == "isometric"]
    plain = type(study)(
        "ankle", "ankle", study.constants, study.start, [*trials, _renamed(found.study.trials[0], "up")]
    )
    write_study(plain, folder / "ankle")
    write_study(joint_study(folder), folder / "joint")
    (folder / "revolute.urdf").unlink()
    save_model(nominal_model(plain), folder / "model.toml")
    save_model(nominal_model(read_study(folder / "joint")), folder / "swing.toml")
    write_trial(plain.trials[1].without("angle_rad"), folder / "inputs.csv")
    for name in ("a.csv", "b.csv"):
        rows = "".join(f"{0.01 * k:.2f},{20 - 0.01 * (k - 50) ** 2:.3f},{0.1 * (k % 7):.1f}\n" for k in range(100))
        (folder / name).write_text("time_s,Angle_deg,effort\n" + rows)
    names = [f"q_{name}" for name in (*REQUIRED, *OPTIONAL)]
    rows = "".join(f"{0.02 * k:.2f}" + f",{0.01 * k:.2f}" * len(names) + "\n" for k in range(10))
    (folder / "walk.csv").write_text(",".join(["time_s", *names]) + "\n" + rows)
    (folder / "text.csv").write_text(studies.__doc__)
    (folder / "own.py").write_text(CAUSE)
    return SimpleNamespace(folder=folder, diagnosis=found)


def _renamed(trial, name):
    return type(trial)(name, trial.kind, trial.columns, trial.time, trial.conditions)


@pytest.fixture
def stubs(monkeypatch, inputs):
    """What is slow, or needs the network, says how it was called."""

    def told(*given, **named):
        named.pop("progress", None)
        if "library" in named and not isinstance(named["library"], tuple):
            named["library"] = sorted(named["library"].origins())
        names = [[t.name for t in one.trials] if hasattr(one, "trials") else str(one) for one in given]
        return f"{names} {sorted((n, str(v)) for n, v in named.items())}"

    def diagnose_joint(*given, **named):
        from dataclasses import replace

        return replace(inputs.diagnosis, warnings=(told(*given, **named),), catalogue=named["library"])

    def cohort(*given, **named):
        check_folder(given[1])
        Path(given[1]).mkdir(exist_ok=True)
        (Path(given[1]) / "cohort.html").write_text(told(*given, **named))
        return SimpleNamespace(failed=[], as_table=Told(told(*given, **named)).as_table)

    monkeypatch.setattr("fes_pin.diagnosis.diagnosis.diagnose_joint", diagnose_joint)
    monkeypatch.setattr("fes_pin.cohort.run.run_cohort", cohort)
    for name in ("contrasts.contrast.contrast", "comparison.compare.compare"):
        monkeypatch.setattr(f"fes_pin.{name}", lambda *given, **named: Told(told(*given, **named)))
    files = report.answer_files
    monkeypatch.setattr(report, "answer_files", lambda one: one.files() if isinstance(one, Told) else files(one))
    monkeypatch.setattr("fes_pin.data.datasets.download_all", lambda *given, **named: {told(*given, **named): "there"})
    monkeypatch.setattr(
        "fes_pin.cli.allocate.walk_table", lambda folder, nerves, passive: f"{folder} {nerves} {passive}"
    )
    monkeypatch.setattr("fes_pin.cli.body._serve", lambda scene: print(scene.html()[-2000:]))
    monkeypatch.setattr("fes_pin.body.minimal_sets.minimal_sets", lambda *_, **named: [str(sorted(named.items()))])
    monkeypatch.setattr("fes_pin.body.minimal_sets.pareto", lambda found: found)
    monkeypatch.setattr("fes_pin.body.observability.fewest_goniometers", lambda *_, **named: [named])


class Told(str):
    """A result that says how it was asked for."""

    verdict = "nothing_changed"

    def as_table(self):
        return self, (), (), ()

    def to_json(self):
        return str(self)

    def files(self):
        return {"contrast.json": str(self), "report.html": str(self)}

    def by_command(self, command):
        return self

    def explain(self, name):
        return [f"{name}: {self}"]


def value_of(parameter, words, rng):
    """Words of one value: of the table, or of the type, within its bounds or not."""
    for key in (f"{' '.join(words)} {parameter.name}", parameter.name):
        if key in VALUES:
            return str(VALUES[key][0] if rng.random() < 0.55 else rng.choice(VALUES[key]))
    kind = str(parameter.type_descriptor.annotation)
    if "int" in kind or "float" in kind:
        low = parameter.min if parameter.min is not None else 0
        number = low + rng.choice([1, 2, 3] if "int" in kind else [0.5, 1.0, 2.0])
        return str(rng.choice([number, number, number, low - 1, "nan", "x"]))
    return rng.choice(PATHS if "path" in kind.lower() else ("a", "b"))


def drawn(seed):
    """A command and words for some of its parameters: those that it needs nearly always, others now and then."""
    rng = random.Random(seed)
    words = rng.choice(list(COMMANDS))
    chosen = []
    for parameter in COMMANDS[words].params:
        often = 0.97 if parameter.required or parameter.name in ("files", "torque", "out") else 0.15
        if rng.random() > often:
            continue
        count = 2 if parameter.nargs == 2 else rng.choice([1, 1, 1, 2]) if parameter.nargs == -1 else 1
        values = [value_of(parameter, words, rng) for _ in range(count)]
        if parameter.param_type_name == "argument":
            chosen.append((parameter, values))
        else:
            chosen.append((parameter, [rng.choice(parameter.opts), *([] if parameter.is_flag else values)]))
    return words, chosen


def seen(words, chosen, inputs, place, monkeypatch):
    """What a command line answers: its exit code, what it prints, and the files that it leaves, by their hash."""
    shutil.rmtree(place, ignore_errors=True)
    shutil.copytree(inputs.folder, place)
    monkeypatch.chdir(place)
    result = run(*words, *(word for _, some in chosen for word in some))
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exc_info
    files = {
        str(p.relative_to(place)): hashlib.sha256(p.read_bytes()).hexdigest()
        for p in sorted(place.rglob("*"))
        if p.is_file()
    }
    return result, files


@pytest.mark.parametrize("seed", range(EXAMPLES))
def test_a_command_line_ends_as_documented_and_nothing_in_it_is_ignored(seed, inputs, stubs, monkeypatch, tmp_path):
    """Exit code 0, or 2 with one line on standard error and nothing else; an accepted option makes a difference."""
    words, chosen = drawn(seed)
    place = tmp_path / "here"
    before = {
        str(p.relative_to(inputs.folder)): hashlib.sha256(p.read_bytes()).hexdigest()
        for p in inputs.folder.rglob("*")
        if p.is_file()
    }
    result, files = seen(words, chosen, inputs, place, monkeypatch)
    ENDS[result.exit_code] += 1
    assert result.exit_code in (0, 2)
    inputs_alone = {n: h for n, h in before.items() if Path(n).name != RECORD}  # a note of what was written may grow
    for name, content in inputs_alone.items():  # --force may write over an output of others, never over what was read
        if "--force" not in result.stderr and not any("--force" in some for _, some in chosen):
            assert files.get(name) == content, f"{name} was changed"
    if result.exit_code == 2:
        assert result.stdout == "" and files == before
        (line,) = result.stderr.splitlines()
        assert line.startswith("fes-pin") and "Traceback" not in line
        return
    for k, (parameter, some) in enumerate(chosen):
        if parameter.name in QUIET or (parameter.name == "out" and some[-1] == "-"):
            continue
        other, others = seen(words, chosen[:k] + chosen[k + 1 :], inputs, place, monkeypatch)
        same = (other.exit_code, _plain(other.stdout), _plain(other.stderr), others) == (
            0,
            _plain(result.stdout),
            _plain(result.stderr),
            files,
        )
        assert not same or _is_default(parameter, some), (
            f"{some} was ignored in {words} {[w for _, s in chosen for w in s]}"
        )


def _plain(text):
    """Without what differs from run to run."""
    return re.sub(r"0x[0-9a-f]+", "0x", text)


def _is_default(parameter, some):
    """True of a value that is taken without it as well."""
    return some[-1] == str(parameter.default) or (parameter.name, some[-1]) in {
        *(("posture", "mid_stance"), ("sex", "male"), ("stance", "right"), ("by", "group"), ("rig", "joint")),
    }


def test_the_drawn_command_lines_reach_every_command_and_both_ends():
    assert {drawn(seed)[0] for seed in range(EXAMPLES)} == set(COMMANDS)
    if sum(ENDS.values()) < EXAMPLES:
        pytest.skip("some of the command lines were not run, or in other processes")
    assert ENDS[0] > 0.25 * EXAMPLES and ENDS[2] > 0.25 * EXAMPLES
