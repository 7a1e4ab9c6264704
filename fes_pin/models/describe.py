"""Effects in words."""

import inspect
from collections.abc import Mapping
from typing import Any

from fes_pin.models.outside import origin
from fes_pin.models.parameters import ROTARY
from fes_pin.models.stage import Effect


def sentence(effect: type[Effect]) -> str:
    """What the effect is, in one sentence."""
    return inspect.cleandoc(effect.__doc__ or "").split("\n", 1)[0]


def equation(effect: type[Effect]) -> str:
    """The equation of an effect, as its docstring has it: the first indented block."""
    lines = inspect.cleandoc(effect.__doc__ or "").split("\n")[1:]
    start = next((i for i, line in enumerate(lines) if line.startswith("    ")), len(lines))
    block = []
    for line in lines[start:]:
        if line.strip() and not line.startswith("    "):
            break
        block.append(line[4:])
    return "\n".join(block).strip("\n").rstrip()


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
