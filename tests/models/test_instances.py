"""Sentence and equation of a cause are of what was fitted: its form, its rig's quantities, no other parameter."""

import ast
import dataclasses
import re
from types import SimpleNamespace

import pytest

from fes_pin.infer.text import plain_name
from fes_pin.models.catalogue import installed
from fes_pin.models.describe import equation, fitted_equation, fitted_sentence, sentence
from fes_pin.models.effects import effect_named
from fes_pin.models.notation import read_equation, simplified, written
from fes_pin.models.parameters import HELD, ROTARY, SLIDING, parameter
from fes_pin.models.stage import Effect, Stage

RIGS = {
    "ankle": SimpleNamespace(name="ankle", units=lambda: ROTARY),
    "revolute": SimpleNamespace(name="joint", units=lambda: ROTARY),
    "slide": SimpleNamespace(name="joint", units=lambda: SLIDING),
    "muscle": SimpleNamespace(name="muscle", units=lambda: HELD),
}
KNOWN = """act c effort e F F_M F_net F_ref fibre force g h J K l length load M muscle phi pi q r r_s reference s
saturation speed stretching t tau threshold theta torque v w w_eff xi y y_rest position angle a z a2 b x p"""
SIGNALS = set(KNOWN.split())
"""Quantities of the rigs that are no parameters of a cause."""
WORDS = set(["replaced", "by", "replaces", "where"])


def forms_of(kind, rig):
    """The plain form of a cause, and one with each refinement that its rig tries."""
    info, changed = kind.parameters(), [{}]
    for names in kind.refinements():
        if not info[names[0]].rigs or rig.name in info[names[0]].rigs:
            candidates = (*info[names[0]].grid, info[names[0]].nearest(0.7), info[names[0]].nearest(0.3))
            changed.append({names[0]: next(v for v in candidates if v != info[names[0]].null)})
    return [dataclasses.replace(kind(), **one) for one in changed]


CASES = [
    pytest.param(one, rig, id=f"{where}-{kind.name}-{'-'.join(one.refined()) or 'plain'}")
    for where, rig in RIGS.items()
    for kind in installed().effects
    if rig.name in kind.rigs
    for one in forms_of(kind, rig)
]


def pieces_of(text):
    lines = re.sub(r" +(?==|->)", " ", text).split("\n")
    pieces = [p.strip().removesuffix(",") for line in lines for p in re.split(r"\s{3,}", line)]
    return [read_equation(p) for p in pieces if re.search(r"[=+*/^<>|-]", p)]


def symbols(text):
    """Names of an equation, without functions, and those that it defines."""
    names, defined = set(), set()
    for tree in pieces_of(text):
        called = {id(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
        names |= {n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and id(n) not in called}
        for part in tree.elts if isinstance(tree, ast.Tuple) else [tree]:
            left = part.left if isinstance(part, ast.Compare) else None
            defined |= {n.id for n in ast.walk(left) if isinstance(n, ast.Name)} if left else set()
    return tuple({n.strip("_ʹᐩ") for n in found} for found in (names, defined))


@pytest.mark.parametrize(("effect", "rig"), CASES)
def test_an_equation_has_the_fitted_parameters_and_no_others(effect, rig):
    names, defined = symbols(fitted_equation(effect, rig))
    info = effect.parameters()
    labels = {n: plain_name(n, i.in_units(rig.units()).unit).replace(" ", "_") for n, i in info.items()}
    fitted = {labels[n] for n in effect.fitted_parameters()}
    assert fitted <= names
    assert names - fitted - defined - WORDS <= SIGNALS
    others = {labels[n] for n in info} | set(info)
    assert not (others - fitted - SIGNALS) & names


@pytest.mark.parametrize(("effect", "rig"), CASES)
def test_words_and_symbols_agree_with_the_units_of_the_rig(effect, rig):
    units = rig.units()
    text = f"{fitted_sentence(effect, rig)} {fitted_equation(effect, rig)}".lower()
    assert ("torque" in text) <= (units["effort"] == "N m")
    for name, info in effect.parameters().items():
        unit, label = info.in_units(units).unit, plain_name(name, info.in_units(units).unit)
        assert ("torque" in label.split()) <= (unit == "N m") and ("angle" in label.split()) <= (unit == "rad")
        assert not re.search(r"_|\b(nm|rad|us|per|nms|hz)\b", label)


@pytest.mark.parametrize(("effect", "rig"), CASES)
def test_a_sentence_says_what_a_refinement_adds(effect, rig):
    plain, said = fitted_sentence(type(effect)(), rig), fitted_sentence(effect, rig)
    assert said.startswith(plain.removesuffix(".")) and (said != plain) == bool(effect.refined())
    assert ", with or without" not in said


@pytest.mark.parametrize("kind", installed().effects, ids=lambda e: e.name)
def test_equations_are_written_as_they_are_read(kind):
    for tree in pieces_of(equation(kind)):
        assert ast.dump(read_equation(written(tree))) == ast.dump(tree)


@pytest.mark.parametrize(
    ("text", "known", "left"),
    [
        ("T (1 + s exp(-(v / u)^2))", {"s": 0.0}, "T"),
        ("a x^n + b", {"n": 0.0, "b": 0.0}, "a"),
        ("a - s k ramp(s (q - c))", {"s": -1.0}, "a + k ramp(c - q)"),
        ("x' = |v|^n / (1 + m)", {"n": 1.5, "m": 1.0}, "x' = |v|^1.5 / 2"),
        ("b+ = torque c", {"torque": "force"}, "b+ = force c"),
        ("c = 1 at 0 s", {"k": 1.0}, "c = 1 at 0 s"),
    ],
)
def test_what_vanishes_is_left_out(text, known, left):
    assert simplified(text, known) == left


@dataclasses.dataclass(frozen=True)
class Bare(Effect):
    """A brake of one's own.

    torque - size (v ? 1)
    """

    size: float = parameter(0.1, null=0.0)
    name, stage, signal, rigs = "bare", Stage.JOINT, "torque", ("joint",)


def test_a_cause_without_clauses_has_the_sentence_and_equation_of_its_docstring():
    assert fitted_sentence(Bare(), RIGS["revolute"]) == sentence(Bare)
    assert fitted_equation(Bare(), RIGS["revolute"]) == equation(Bare)


def test_signs_are_in_words():
    load, gain = effect_named("load_error"), effect_named("effort_gain")
    assert fitted_sentence(load(error=0.1), RIGS["ankle"]) != fitted_sentence(load(error=-0.1), RIGS["ankle"])
    assert "wrong sign" in fitted_sentence(gain(error=-2.0), RIGS["slide"])
    assert "wrong sign" not in fitted_sentence(gain(error=0.2), RIGS["slide"])
