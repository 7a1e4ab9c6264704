"""Effects in words."""

import inspect
import re
import sys
from collections.abc import Mapping, Set
from typing import Any

from fes_pin.infer.text import ON_A_SLIDE, UNIT_IN_NAME, plain_name
from fes_pin.models.notation import simplified
from fes_pin.models.outside import origin
from fes_pin.models.parameters import ROTARY
from fes_pin.models.rigs.base import Rig
from fes_pin.models.stage import Effect

CONDITION = re.compile(r",? ?\b(on|with|without) (\w+(?: or \w+)*)$")
"""Behind an equation: the rigs that it is of, or the refinements with or without which it holds."""


def sentence(effect: type) -> str:
    """What the effect is, in one sentence."""
    return inspect.cleandoc(effect.__doc__ or "").split("\n", 1)[0]


def equation(effect: type, here: Set[str] | None = None) -> str:
    """The equation of an effect, as its docstring has it: the first indented block.

    Parameters
    ----------
    here
        A rig and refinements, or the words of a site: only lines that hold for these, without their conditions.
    """
    lines = inspect.cleandoc(effect.__doc__ or "").split("\n")[1:]
    start = next((i for i, line in enumerate(lines) if line.startswith("    ")), len(lines))
    block = []
    for line in lines[start:]:
        if line.strip() and not line.startswith("    "):
            break
        block.append(line[4:] if here is None else _applicable(line[4:], here))
    kept = block if here is None else filter(None, block)
    return "\n".join(kept).strip("\n").rstrip()


def _applicable(line: str, here: Set[str]) -> str:
    """A line of an equation without its conditions; empty if one does not hold for a rig and refinements."""
    while found := CONDITION.search(line):
        if here.isdisjoint(found[2].split(" or ")) == (found[1] != "without"):
            return ""
        line = line[: found.start()].rstrip()
    return line


def fitted_sentence(effect: Effect, rig: Rig) -> str:
    """The sentence of an effect as it is on a rig: with what its parameters add, and the rig's quantities."""
    info = effect.parameters().items()
    added = [i.said(v) for n, i in info if i.null is not None and (v := float(getattr(effect, n))) != i.null]
    words = ", ".join([sentence(type(effect)).removesuffix("."), *filter(None, added)]) + "."
    for turning, sliding in _on_rig(effect, rig).items():
        words = re.sub(rf"\b({turning[0]}|{turning[0].upper()}){turning[1:]}\b", sliding, words)
    return words[:1].upper() + words[1:]


def fitted_equation(effect: Effect, rig: Rig) -> str:
    """The equation of an effect as it is on a rig: its parameters are those that are fitted, without units in names.

    The values of others, and constants of its module in capitals, are in it as numbers, and what vanishes by them is
    not. An equation that cannot be parsed stays as it is written.
    """
    known: dict[str, float | str] = {
        n: v
        for n, v in vars(sys.modules[type(effect).__module__]).items()
        if n.isupper() and isinstance(v, int | float)
    }
    known |= _on_rig(effect, rig)
    for name, info in effect.parameters().items():
        fitted = name in (*effect.fitted_parameters(), *effect.unknowns())
        printed = plain_name(name, info.in_units(rig.units()).unit).replace(" ", "_")
        known |= dict.fromkeys((name, UNIT_IN_NAME.sub("", name)), printed if fitted else float(getattr(effect, name)))
    lines = equation(type(effect), {rig.name, *effect.refined()}).split("\n")
    try:
        return "\n".join(_line(line, known) for line in lines)
    except (SyntaxError, ValueError, RecursionError):
        return "\n".join(lines)


def _line(line: str, known: Mapping[str, float | str]) -> str:
    """A line of an equation with names replaced; remarks on it stand behind three spaces."""
    pieces = re.split(r"(\s{3,})(?=\w)", re.sub(r"\s+(?==|->)", " ", line))
    for k, piece in enumerate(pieces):
        if re.search(r"[=+*/^<>|-]", piece):
            pieces[k] = simplified(piece.removesuffix(","), known) + "," * piece.endswith(",")
    return "".join(pieces)


def _on_rig(effect: Effect, rig: Rig) -> dict[str, str]:
    """Words for a slide, by those for a joint that turns; an angle stays one where no parameter is of the position."""
    units = rig.units()
    moved = any("{q}" in info.unit for info in effect.parameters().values())
    of_slide = {"torque": units["effort"] == "N", "angle": units["q"] == "m" and moved}
    return {turning: sliding for turning, sliding in ON_A_SLIDE.items() if of_slide[turning]}


def remark(effect: type[Effect], label: str) -> str:
    """The text after a label such as "Tell-tale:" in an effect's docstring."""
    text = " ".join(inspect.cleandoc(effect.__doc__ or "").split())
    after = text.partition(f"{label} ")[2]
    return after.partition(" Source: ")[0] if label != "Source:" else after


def describe(effect: type[Effect]) -> str:
    """Name, stage, sentence, equation, tell-tale and parameters."""
    parameters = {}
    for name, info in effect.parameters().items():
        absent = f"absent at {info.null:g}" if info.null is not None else "a shape"
        also = ", a refinement" if info.optional else ""
        also += f": {info.words}" if isinstance(info.words, str) and info.words else ""
        unit = info.in_units(ROTARY).unit or "1"
        parameters[name] = f"[{unit}] in [{info.lower:g}, {info.upper:g}], {absent}{also}"
    return described(effect, effect.stage, parameters)


def described(effect: Any, stage: str, parameters: Mapping[str, str]) -> str:
    """The name, stage, sentence, equation and tell-tale of an effect, and the description of each parameter."""
    whose = f"; code of {where}" if (where := origin(effect)) else ""
    lines = [f"{effect.name} ({stage}; rigs: {', '.join(effect.rigs)}{whose})", f"  {sentence(effect)}"]
    lines += [f"      {line}" for line in equation(effect).split("\n")]
    lines += [f"  Tell-tale: {remark(effect, 'Tell-tale:')}", *(f"    {n} {words}" for n, words in parameters.items())]
    return "\n".join(lines) + "\n"
