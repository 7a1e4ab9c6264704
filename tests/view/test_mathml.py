"""Equations of every cause become mathematics, and lose nothing on the way."""

import html
import re

import pytest

from fes_pin.models.catalogue import installed
from fes_pin.models.describe import equation
from fes_pin.view.mathml import GREEK, equations_mathml

SAME = {"→": "->", "−": "-", "′": "'", "≤": "<=", "≥": ">=", "·": "*", **{v: k for k, v in GREEK.items()}}


def bare(text: str) -> str:
    """Names, numbers and signs in order, without what is drawn instead of written: brackets, /, ^, _ and spaces."""
    for drawn, written in SAME.items():
        text = text.replace(drawn, written)
    return re.sub(r"[\s()/^_]", "", text)


@pytest.mark.parametrize("cause", installed().effects, ids=lambda e: e.name)
def test_every_cause_has_an_equation_that_keeps_its_names(cause):
    made = equations_mathml(equation(cause)).text
    assert "<math>" in made and "<pre>" not in made
    shown = html.unescape(re.sub(r"<[^>]*>", "", made))
    assert bare(shown) == bare(equation(cause))


def test_fractions_powers_and_indices_are_drawn():
    made = equations_mathml("F_M = a b / (1 + r)^2,   tau x' = -x").text
    assert "<mfrac><mrow><mi>a</mi>" in made and "<msup>" in made and "<msub><mi>F</mi><mi>M</mi></msub>" in made
    assert "<mi>τ</mi>" in made and "′" in made


@pytest.mark.parametrize("text", ["a = (b", "x = ? y", "a ^", "= =", "a = f(", "|v", "<b> & c = é!"])
def test_what_cannot_be_parsed_stays_as_it_is_written(text):
    made = equations_mathml(text).text
    assert made == f"<pre>{html.escape(text)}</pre>"
