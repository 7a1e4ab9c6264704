"""Pages that are written at build time from the package itself: the study format's tables, the causes, the API.

Nothing here imports Sphinx: `write` makes files below `docs/_generated` and `docs/api`, and the tests read the texts.
"""

from __future__ import annotations

import ast
import inspect
import math
import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import fes_pin
from fes_pin.data.schema import NumberKey, RigSchema, known_rigs
from fes_pin.models.catalogue import shipped
from fes_pin.models.describe import equation, remark, sentence
from fes_pin.models.parameters import ROTARY
from fes_pin.models.stage import Effect, Stage

CHAPTERS = {
    "data": "Studies, trials, results",
    "models": "Models: rigs, effects, simulation",
    "search": "Fitting a model",
    "identify": "What a fit says",
    "verdict": "Checks and diagnoses",
    "diagnosis": "What a diagnosis says",
    "walk": "Measured walking",
    "contrasts": "What changed",
    "comparison": "Models of the literature, ranked",
    "view": "Reports and pictures",
    "paper": "The paper's ankle",
    "body": "The walking body",
    "muscles": "Muscles and nerves",
    "allocation": "Allocation",
    "control": "Position control",
}
"""The packages that public names come from, with their headings in the API reference."""

KNOWN = "known"
FITTED = "start value, fitted"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines) + "\n"


def bound(number: NumberKey) -> str:
    """The bound of a number in words."""
    if not math.isfinite(number.lower):
        return "finite"
    return f"{'above' if number.strict else 'at least'} {number.lower:g}"


def rig_text(name: str, schema: RigSchema) -> str:
    """What a study of one rig holds: columns by kind of trial, keys by table."""
    doc = inspect.cleandoc(schema.owner.__doc__ or "").split("\n", 1) if schema.owner else [""]
    parts = [f"### Rig `{name}`\n"]
    if doc[0]:
        parts.append(doc[0] + "\n")
        if block := equations(schema.owner):
            parts.append(f"```text\n{block}\n```\n")
    if len(schema.recordings) == 1:
        parts.append(_columns(schema))
    else:
        parts.append(f"Each trial names {' and '.join(f'`{n}`' for n in schema.recordings)}, two files; see below.\n")
    parts.append(table(("table", "key", "unit", "number", "needed", "role in the model"), keys(schema)))
    if schema.start_may_be_known:
        parts.append("A key of `[start]` may stand in `[rig]` instead: it is known then, and not fitted.\n")
    if schema.either:
        needed = " and ".join(f"`{n}`" for n in schema.either)
        parts.append(f"Either {needed}, or one of the files.\n")
    return "\n".join(parts)


def _columns(schema: RigSchema) -> str:
    rows = [
        (
            f"`{kind}`" + (" (default)" if kind == schema.default_kind else ""),
            _inputs(schema, kind),
            f"`{output}`",
            ", ".join(f"`{n}`" for n in (schema.motion(kind)[1:] or schema.optional)) or "none",
        )
        for kind, output in schema.outputs.items()
    ]
    return table(("kind of trial", "input column", "output column", "further columns"), rows)


def _inputs(schema: RigSchema, kind: str) -> str:
    stimuli = " or ".join(f"`{n}`" for n in schema.stimuli(kind))
    motion = [f"`{n}`" for n in schema.motion(kind)[:1]]
    free = stimuli + ("" if schema.inputs_required else ", or none")
    return ", and ".join([*([free] if stimuli else []), *motion])


def keys(schema: RigSchema) -> list[tuple[str, ...]]:
    """Every key of every table of a rig's studies: table, key, unit, bound, whether it must be there, what it is."""
    rows = []
    for key, must in schema.files.items():
        rows.append(("`[rig]`", f"`{key}`", "file", "a path inside the study", "yes" if must else "no", KNOWN))
    for where, numbers, role in (
        ("`[rig]`", schema.constants, KNOWN),
        ("`[rig.passive]`", schema.passive, KNOWN),
        ("`[start]`", schema.start, FITTED),
        ("`[[trial]]`", schema.conditions, "condition of the trial"),
    ):
        for key, number in numbers.items():
            rows.append((where, f"`{key}`", number.unit or "1", bound(number), _needed(schema, key, number), role))
    return rows


def _needed(schema: RigSchema, key: str, number: NumberKey) -> str:
    kinds = [kind for kind, needed in schema.needed.items() if key in needed]
    if kinds:
        return f"in {' and '.join(kinds)} trials" + (" only" if key in schema.only else "")
    return "yes" if number.required else "no"


def equations(owner: type) -> str:
    """The equations of a rig, as its docstring has them: the first indented block."""
    return equation(owner)


def rigs_text() -> str:
    """What a study of each rig holds, rig by rig."""
    return "\n".join(rig_text(name, schema) for name, schema in known_rigs().items() if _ours(schema))


def _ours(schema: RigSchema) -> bool:
    return schema.owner is None or schema.owner.__module__.startswith("fes_pin.")


def causes() -> list[type[Effect]]:
    """The causes that are written in the package, by stage and name."""
    order = list(Stage)
    return sorted(shipped().effects, key=lambda e: (order.index(Stage(e.stage)), e.name))


def cause_text(effect: type[Effect]) -> str:
    """One cause: what it is, its equation, how one sees it, its parameters, where it comes from."""
    rows = []
    for name, info in effect.parameters().items():
        absent = "a shape: none" if info.null is None else f"{info.null:g}"
        unit = info.in_units(ROTARY).unit or "1"
        rows.append((f"`{name}`", unit, f"{info.lower:g} to {info.upper:g}", absent, "yes" if info.optional else "no"))
    parts = [
        f"### `{effect.name}`\n",
        f"{sentence(effect)} Rigs: {', '.join(effect.rigs)}.\n",
        f"```text\n{equation(effect)}\n```\n" if equation(effect) else "",
        f"*Tell-tale*: {remark(effect, 'Tell-tale:')}\n" if remark(effect, "Tell-tale:") else "",
        table(("parameter", "unit (rotary)", "range", "absent at", "refinement"), rows) if rows else "",
        f"*Source*: {remark(effect, 'Source:')}\n" if remark(effect, "Source:") else "",
    ]
    return "\n".join(part for part in parts if part)


def causes_text() -> str:
    """Every cause, under its stage."""
    parts, stage = [], None
    for effect in causes():
        if effect.stage != stage:
            stage = effect.stage
            parts.append(f"## Stage: {stage}\n")
        parts.append(cause_text(effect))
    return "\n".join(parts)


def public_of(package: str) -> list[str]:
    """The public names of `fes_pin` that are written in one of its packages."""
    return [name for name, where in public_names().items() if where.split(".")[1] == package]


def chapter_text(package: str, heading: str) -> str:
    """The page of one package: its public names, as `import fes_pin as fp` gives them."""
    lines = [heading, "=" * len(heading), "", ".. currentmodule:: fes_pin", ""]
    for name in public_of(package):
        where = public_names()[name]
        one = resolve(where)
        if inspect.ismodule(one):
            lines += [f".. automodule:: {where}", "   :no-members:", "", ".. currentmodule:: fes_pin", ""]
        elif inspect.isclass(one):
            lines += [f".. autoclass:: fes_pin.{name}", "   :members:", ""]
        else:
            lines += [f".. autofunction:: fes_pin.{name}", ""]
    return "\n".join(lines)


def resolve(path: str) -> object:
    """What stands at a dotted path: a module, or a class or function in one."""
    try:
        return import_module(path)
    except ModuleNotFoundError:
        module, _, name = path.rpartition(".")
        return getattr(import_module(module), name)


def public_names() -> dict[str, str]:
    """Where each public name of `fes_pin` is written: a dotted path, in the order in which the package lists them."""
    chapters = {name: getattr(fes_pin, name).__name__ for name in fes_pin._CHAPTERS}
    return {**{name: f"{module}.{name}" for name, module in fes_pin._WHERE.items()}, **chapters}


def public_text() -> str:
    """The public names with their first sentences, each with a link to where it is described."""
    rows = []
    for name, where in public_names().items():
        one = resolve(where)
        summary = " ".join(inspect.cleandoc(one.__doc__ or "").split("\n\n")[0].split())
        target = f"py:mod}}`fes_pin.{name} <{where}>`" if inspect.ismodule(one) else f"py:obj}}`fes_pin.{name}`"
        rows.append((f"{{{target}", summary))
    return table(("name", "what it is"), rows)


REASONED = (
    *("infer", "identify", "remainder", "search", "prepare", "faults"),
    *("diagnosis", "contrasts", "walk", "comparison", "cohort", "verdict", "effort"),
    "models/plausibility.py",
)
"""Rooms of inference, and a file of another room, whose numbers are listed with their reasons."""
DECIDING = "infer/levels.py"
"""File of the numbers that decide what is claimed."""
KINDS = {
    "decides": "Numbers that decide what is claimed",
    "how": "How widely, how long and how finely it is searched",
    "guard": "Guards of arithmetic and of what is read",
    "measurement": "Properties of sensors, people and machines",
}


@dataclass(frozen=True)
class Number:
    """A number that a file names: its value as it is written, and its reason."""

    file: str
    name: str
    value: str
    reason: str


def numbers() -> list[Number]:
    """Every number that a file of the rooms of inference names, in their order."""
    root = Path(fes_pin.__file__).parent
    return [Number(str(path.relative_to(root)), *one) for path in _reasoned(root) for one in _named(path)]


def _reasoned(root: Path) -> list[Path]:
    return [path for room in REASONED for path in sorted((root / room).rglob("*.py")) or [root / room]]


def kinds() -> dict[str, str]:
    """The kind of each number by "file:NAME": those of `DECIDING` decide, the others as data/numbers.toml says."""
    table = tomllib.loads((Path(__file__).parent / "data" / "numbers.toml").read_text())
    found = {f"{n.file}:{n.name}": "decides" for n in numbers() if n.file == DECIDING}
    for kind, files in table.items():
        for file, names in files.items():
            for name in names.split():
                assert f"{file}:{name}" not in found, f"{file}:{name} has two kinds"
                found[f"{file}:{name}"] = kind
    return found


def unnamed_numbers() -> list[str]:
    """Numbers that stand in a comparison, or as a default of an argument or of a class, without a name.

    Those that say empty, first, one, a pair, a half or percent, and those that only guard arithmetic, are none.

    Returns
    -------
    list of str
        "file:line value" each.
    """
    root, found = Path(fes_pin.__file__).parent, []
    for path in sorted(_reasoned(root)):
        for x in (x for node in ast.walk(ast.parse(path.read_text())) for x in _deciding(node)):
            if isinstance(x, ast.Constant) and type(x.value) in (int, float) and not _says_nothing(x.value):
                found.append(f"{path.relative_to(root)}:{x.lineno} {x.value}")
    return found


def _deciding(node: ast.AST) -> list[ast.AST]:
    """Expressions of a node that may hold a number that decides."""
    if isinstance(node, ast.Compare):
        return [x for one in (node.left, *node.comparators) for x in ast.walk(one)]
    if isinstance(node, ast.arguments):
        return [d for d in (*node.defaults, *node.kw_defaults) if d is not None]
    if isinstance(node, ast.ClassDef):
        return [one.value for one in node.body if isinstance(one, ast.Assign | ast.AnnAssign) and one.value]
    return []


def _says_nothing(value: float) -> bool:
    return value in (0, 1, -1, 2, 0.5, 100) or abs(value) < 1e-5


def _named(path: Path) -> Iterable[tuple[str, str, str]]:
    """Name, value and reason of every number that a file names, several in a line too."""
    body = ast.parse(path.read_text()).body
    for one, after in zip(body, [*body[1:], None], strict=True):
        target = one.targets[0] if isinstance(one, ast.Assign) else getattr(one, "target", None)
        value = getattr(one, "value", None)
        many = isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple)
        reason = after.value.value if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant) else ""
        for name, number in zip(target.elts, value.elts, strict=True) if many else [(target, value)]:
            if isinstance(name, ast.Name) and name.id.isupper() and name.id[0] != "_" and _is_numeric(number):
                yield name.id, ast.unparse(number), " ".join(str(reason).split())


def _is_numeric(value: ast.AST | None) -> bool:
    parts = ast.walk(value) if value is not None else ()
    return any(isinstance(x, ast.Constant) and type(x.value) in (int, float) for x in parts)


def numbers_text() -> str:
    """The numbers by their kinds, with their reasons."""
    found, of, parts = numbers(), kinds(), []
    for kind, title in KINDS.items():
        own = [n for n in found if of.get(f"{n.file}:{n.name}") == kind]
        rows = [(f"`{n.name}`", f"`{n.value}`", n.reason, f"`{n.file}`") for n in own]
        parts.append(
            f"## {title}\n\n{len(rows)} of {len(found)}.\n\n" + table(("name", "value", "reason", "file"), rows)
        )
    return "\n".join(parts)


def write(docs: Path) -> None:
    """Write every generated page below a folder of documentation; files that would not change are left alone."""
    pages = {
        "_generated/rigs.md": rigs_text(),
        "_generated/causes.md": causes_text(),
        "_generated/public.md": public_text(),
        "_generated/numbers.md": numbers_text(),
        **{f"api/{package}.rst": chapter_text(package, heading) for package, heading in CHAPTERS.items()},
    }
    for stale in (docs / "api").glob("*.rst"):
        if stale.stem not in CHAPTERS:
            stale.unlink()
    for name, text in pages.items():
        path = docs / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists() or path.read_text() != text:
            path.write_text(text)
