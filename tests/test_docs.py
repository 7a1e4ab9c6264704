"""The documentation says what is there: links, paths, commands, examples, and a docstring for every public name."""

import ast
import inspect
import re
import sys
import tomllib
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fes_pin as fp
from fes_pin.cli.own import new_study
from fes_pin.data.recorded.columns_table import FILE_KEYS, columns_of
from fes_pin.data.results import RESULT, TABLE, TEXT
from fes_pin.data.schema import known_rigs
from fes_pin.data.units import UNITS
from fes_pin.data.walk_conventions import MOMENTS_ON, STANDARD, checked_conventions
from fes_pin.infer import held_out, levels

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS))

import stories  # noqa: E402
import tables  # noqa: E402

PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.glob("*.md")), DOCS / "api" / "index.md"]
WRITTEN = ("_generated/", "stories/", "api/")
"""Below `docs`, what a build writes."""
STORIES = sorted((ROOT / "analysis").glob("*.py"))


def name(path):
    return str(path.relative_to(ROOT))


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", page.read_text()):
        if not target.startswith(("http://", "https://")):
            assert (page.parent / target).exists() or target.startswith(WRITTEN), target


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_paths_of_the_repository_are_there(page):
    shown = re.findall(r"(?<![\w./-])((?:fes_pin|analysis|scripts|tests|docs|urdf)/[\w./]*\w)", page.read_text())
    wild = [path for path in shown if not path.endswith("_") and not (ROOT / path).exists()]
    assert not [path for path in wild if not list(ROOT.glob(f"{path}*"))]


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_no_line_of_text_begins_with_a_percent_sign(page):
    """MyST takes such a line for a comment and leaves it out."""
    assert not re.findall(r"^%.*", page.read_text(), re.MULTILINE)


def test_every_page_is_in_the_table_of_contents():
    listed = set(re.findall(r"^([\w/]+)$", (DOCS / "index.md").read_text(), re.MULTILINE))
    assert {page.stem for page in DOCS.glob("*.md")} - {"index"} <= listed
    assert {"api/index", "stories/index"} <= listed
    assert set(tables.CHAPTERS) == set(re.findall(r"^(\w+)$", (DOCS / "api" / "index.md").read_text(), re.MULTILINE))


def test_the_api_reference_has_every_public_name_once_and_no_other():
    names = [name for package in tables.CHAPTERS for name in tables.public_of(package)]
    assert sorted(names) == sorted(set(fp.__all__) - {"__version__"})


@pytest.mark.parametrize("public", sorted(set(fp.__all__) - {"__version__"}))
def test_every_public_name_is_described_and_in_the_api_reference(public):
    where = tables.public_names()[public]
    one = tables.resolve(where)
    assert inspect.getdoc(one)
    assert f"`fes_pin.{public}" in tables.public_text()
    directive = f"automodule:: {where}\n" if inspect.ismodule(one) else f":: fes_pin.{public}\n"
    assert directive in tables.chapter_text(where.split(".")[1], "")


@pytest.mark.parametrize("package", sorted(path.parent.name for path in (ROOT / "fes_pin").glob("*/__init__.py")))
def test_everything_public_has_a_docstring(package):
    missing = []
    for found in walk_packages([str(ROOT / "fes_pin" / package)], f"fes_pin.{package}."):
        module = import_module(found.name)
        assert module.__doc__, module.__name__
        for public, one in vars(module).items():
            own = inspect.isclass(one) or inspect.isfunction(one)
            if own and not public.startswith("_") and one.__module__ == module.__name__ and not inspect.getdoc(one):
                missing.append(f"{module.__name__}.{public}")
    assert not missing


@pytest.mark.parametrize("rig", sorted(known_rigs()))
def test_the_study_format_has_every_key_and_column(rig):
    schema, text = known_rigs()[rig], tables.rig_text(rig, known_rigs()[rig])
    keys = [*schema.files, *schema.constants, *schema.passive, *schema.start, *schema.conditions]
    columns = [*schema.inputs, *schema.optional]
    if len(schema.recordings) == 1:
        columns += [*schema.outputs, *schema.outputs.values()]
    assert all(f"`{key}`" in text for key in (*keys, *columns))


def test_the_causes_page_has_every_cause_and_parameter():
    text = tables.causes_text()
    for effect in tables.causes():
        assert f"### `{effect.name}`" in text
        assert all(f"| `{parameter}` |" in text for parameter in effect.parameters())


def test_bars_within_cells_do_not_break_a_table():
    assert tables.table(("a",), [("|v|",)]).splitlines()[-1] == r"| \|v\| |"


@pytest.mark.parametrize("path", STORIES, ids=lambda p: p.stem)
def test_a_story_has_a_title_and_imports_what_there_is(path):
    text = stories.as_gallery(path.read_text())
    title, line = text.split("\n")[1:3]
    assert len(title) == len(line) and set(line) == {"="}
    assert "__file__" not in text
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("fes_pin"):
            module = import_module(node.module)
            for alias in node.names:
                assert hasattr(module, alias.name) or import_module(f"{node.module}.{alias.name}")


def test_a_story_that_is_not_run_says_so_and_has_its_picture():
    others = stories.shown(walk=False)
    assert set(others) <= {path.stem for path in STORIES}
    for story, why in others.items():
        text = stories.as_gallery((ROOT / "analysis" / f"{story}.py").read_text(), why)
        assert ".. note::" in text and why.command in text
        assert story in stories.LONG or f".. image:: /_generated/figures/{why.picture}\n" in text
        assert (ROOT / why.command).exists()


def blocks(page, language):
    return re.findall(rf"```{language}\n(.*?)```", (DOCS / page).read_text(), re.DOTALL)


def study_by_hand(place, damping):
    """The study of docs/own_recordings.md in a folder, with trials of a pendulum and a sensor's noise."""
    folder = place / "my_pendulum"
    (folder / "trials").mkdir(parents=True)
    (folder / "pendulum.urdf").write_text(blocks("own_recordings.md", "xml")[0])
    (folder / "study.toml").write_text(blocks("own_recordings.md", "toml")[0])
    header = blocks("own_recordings.md", "text")[1].splitlines()[0]
    time = np.arange(0.0, 4.0, 0.005)
    inertia, noise = 0.002 + 0.5 * 0.2**2, np.random.default_rng(0)
    for trial, begin in (("a", 0.6), ("b", -0.9), ("c", 0.3)):
        run = solve_ivp(
            lambda t, x: [x[1], (-0.5 * 9.81 * 0.2 * np.sin(x[0]) - damping * x[1]) / inertia],
            (0.0, 4.0),
            [begin, 0.0],
            t_eval=time,
            rtol=1e-9,
        )
        read = run.y[0] + 1e-4 * noise.standard_normal(time.size)
        rows = "".join(f"{t:.3f},{q:.6f}\n" for t, q in zip(time, read, strict=True))
        (folder / "trials" / f"{trial}.csv").write_text(f"{header}\n{rows}")


def test_the_study_by_hand_can_be_read_and_fitted(tmp_path, monkeypatch):
    study_by_hand(tmp_path, damping=0.02)
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(compile(blocks("own_recordings.md", "python")[0], "own_recordings.md", "exec"), names)
    assert names["fitted"].values["damping"] == pytest.approx(0.02, rel=1e-2)


def test_the_page_of_own_recordings_has_every_option_of_new_study():
    page = (DOCS / "own_recordings.md").read_text()
    own = {"files": "", "setting": "set", "force": "", "library": "", "name": ""}
    for name in inspect.signature(new_study).parameters:
        assert not (option := own.get(name, name.replace("_", "-"))) or f"--{option}" in page, name


def test_the_study_format_shows_toml():
    first, own, view, side_by_side, walking, conventions = blocks("study_format.md", "toml")
    read = columns_of(tomllib.loads(own)["columns"], known_rigs()["joint"], True, AssertionError)
    assert set(tomllib.loads(own)["columns"]["file"]) == set(FILE_KEYS)
    assert read.sources["position"](np.array([90.0, 0.0])).tolist() == pytest.approx([0.0, np.pi / 2])
    for units in UNITS.values():
        assert all(unit in (DOCS / "study_format.md").read_text() for unit in units)
    assert tomllib.loads(first)["trial"][0]["role"] == "fit"
    shown = {key for table in tomllib.loads(view)["trial"] for key in table}
    assert {"from", "to", "split", "rate", "sources", "offset_s", "derive"} <= shown
    assert {key for t in tomllib.loads(side_by_side)["trial"] for key in t["sources"]} == {"trial1", "trial2"}
    shown = tomllib.loads(conventions)["conventions"]
    assert shown == {**STANDARD, MOMENTS_ON: "foot"} and checked_conventions(shown, AssertionError) == shown
    assert set(tomllib.loads(walking)["trial"][0]) <= {"coordinates", "ground_reaction", "belt_speed_mps"}


def test_the_benchmarks_that_are_listed_are_those_that_can_be_run():
    listed = set(re.findall(r"`scripts/benchmark (\w+)`", (DOCS / "benchmarks.md").read_text()))
    files = (ROOT / "scripts" / "benchmarks").glob("*.py")
    assert listed == {path.stem for path in files if "\ndef run(" in path.read_text()}


def test_the_study_format_has_every_key_of_a_diagnosis():
    text = (DOCS / "study_format.md").read_text()
    files = [
        ROOT / "fes_pin" / name for name in ("diagnosis/result.py", "diagnosis/errors_ahead.py", "infer/result.py")
    ]
    files.append(ROOT / "fes_pin/data/results.py")
    every = [node for file in files for node in ast.walk(ast.parse(file.read_text()))]
    records = [
        f for f in every if isinstance(f, ast.FunctionDef) and f.name.endswith(("record", "_gains", "_parameters"))
    ]
    made = [node for record in records for node in ast.walk(record) if isinstance(node, ast.Dict)]
    keys = {key.value for node in made for key in node.keys if isinstance(key, ast.Constant)} | {RESULT, TEXT, TABLE}
    assert {"verdict", "equivalents", "ci95", "at_bound"} <= keys
    assert not [key for key in keys if f"`{key}`" not in text]


def test_what_the_documentation_needs_is_pinned():
    wanted = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]["docs"]
    pinned = {line.split("==")[0].lower() for line in (DOCS / "requirements.lock").read_text().splitlines()}
    assert {re.split(r"[<>=]", one)[0] for one in wanted} <= pinned


@pytest.mark.parametrize("number", tables.numbers(), ids=lambda n: f"{n.file}:{n.name}")
def test_every_number_of_a_verdict_has_its_reason(number):
    assert number.reason, f"{number.name} = {number.value} in {number.file}: expected a reason beneath it"


def test_every_number_has_a_kind_and_none_that_is_gone_has_one():
    assert set(tables.kinds()) == {f"{n.file}:{n.name}" for n in tables.numbers()}
    assert set(tables.kinds().values()) == set(tables.KINDS)


def test_no_number_decides_without_a_name():
    assert tables.unnamed_numbers() == []


def test_few_numbers_decide_and_each_says_where_it_comes_from():
    deciding = [n for n in tables.numbers() if n.file == tables.DECIDING]
    assert 20 < len(deciding) <= 45  # a further one must take another's place
    sources = re.compile("Theory|Literature|Simulation|By convention")
    assert [n.name for n in deciding if not sources.search(n.reason)] == []
    scripts = [path for n in deciding for path in re.findall(r"`((?:scripts|tests)/[\w/.]+)", n.reason)]
    assert scripts and [path for path in scripts if not (ROOT / path).exists()] == []


WORDS = {0.0625: "sixteenth", 4: "four", 5: "five"}


@pytest.mark.parametrize(
    "sentence",
    [
        f"p-value below {levels.CLAIM_LEVEL:g}, or below {levels.DRIVEN_LEVEL:g} where process noise acts",
        f"more than a {WORDS[levels.FORM_SHARE]} of what all causes explain",
        f"cannot separate from a named one at {100.0 * (1.0 - levels.UNUSUAL_LEVEL):g} %",
        f"dealt to at most {WORDS[held_out.FOLDS]} folds",
        f"by more than {levels.NOTHING_PERCENT:g} % of the nominal model's error",
        f"`horizon_s` of the study, else {levels.HORIZON_S:g} s or a tenth of",
        f"At least {WORDS[levels.FEWEST_STATED]} trials must state something",
    ],
)
def test_the_page_of_a_verdict_states_the_numbers_that_decide(sentence):
    assert sentence in " ".join((ROOT / "docs" / "verdict.md").read_text().split())


def test_the_page_of_decisions_names_files_that_are_there():
    text = (DOCS / "architecture.md").read_text()
    names = set(re.findall(r"`(\w+/[\w/]+\.py)`", text))
    assert len(names) > 30
    assert [n for n in names if not any((ROOT / top / n).exists() for top in ("", "fes_pin"))] == []


PATHS = re.compile(r"`([a-z_]+(?:\.\w+)+)`")
"""Dotted names in docstrings."""
FILES = (".toml", ".json", ".csv")


def test_docstrings_name_modules_that_are_there():
    """`infer.scatter` is a file, and `infer.scatter.excess_scatter` is a name in it."""
    root, dead = ROOT / "fes_pin", []
    rooms = {p.name for p in root.iterdir() if p.is_dir()} - {"body"}  # `body.joint_names` is an attribute
    for path in root.rglob("*.py"):
        texts = (n.value for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.Constant))
        for name in (n for text in texts if isinstance(text, str) for n in PATHS.findall(text)):
            room, *parts = name.split(".")
            if room in rooms and not name.endswith(FILES) and not _is_there(root / room, parts):
                dead.append(f"{path.relative_to(root)}: {name}")
    assert dead == []


def _is_there(place, parts):
    """Whether parts of a dotted name lead from a folder to a file, and from the file to a name in it."""
    for k, part in enumerate(parts):
        if (file := place / f"{part}.py").exists():
            return k + 1 == len(parts) or re.search(rf"\b{parts[k + 1]}\b", file.read_text()) is not None
        place = place / part
    return place.is_dir()
