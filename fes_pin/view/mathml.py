"""Equations of docstrings as MathML, which browsers set as mathematics; what cannot be parsed stays as it is written.

The notation: products by a space, quotients by /, powers by ^, calls by a bracket that follows at once, v' and v'' for
derivatives, b+ for the next value, x_y for an index of a letter, -> for "becomes". Three spaces separate an equation
from a remark on it.

Source: MathML Core, W3C.
"""

from __future__ import annotations

import html
import re
from collections.abc import Callable

from fes_pin.view.page import Markup

GREEK = {
    **{"alpha": "α", "beta": "β", "delta": "δ", "epsilon": "ε", "zeta": "ζ", "theta": "θ", "mu": "μ", "xi": "ξ"},
    **{"pi": "π", "rho": "ρ", "sigma": "σ", "tau": "τ", "phi": "φ", "omega": "ω"},
}
RELATIONS = {"=": "=", "->": "→", "<": "<", ">": ">", ",": ",", "<=": "≤", ">=": "≥"}
WORDS = set(
    ["where", "replaced", "by", "replaces", "shortens", "the", "muscle", "from", "up", "for", "at", "if", "else", "and"]
)
"""Words of a sentence, which are no names of quantities."""
_TOKEN = re.compile(r"\s*(?:(\d+\.?\d*(?:e-?\d+)?)|([^\W\d]\w*)('*)|(->|<=|>=|[-+*/^()|,=<>]))")
_NEXT = re.compile(r"([^\W\d]\w*)\+(?=\s*(?:=|$))")


class _Unreadable(ValueError):
    """What is no equation in this notation."""


def equations_mathml(text: str) -> Markup:
    """Lines of equations as one block of mathematics each; as they are written where one of them cannot be parsed."""
    lines = [line for line in text.split("\n") if line.strip()]
    try:
        made = [_line(line) for line in lines]
    except _Unreadable:
        return Markup(f"<pre>{html.escape(text)}</pre>")
    return Markup(f'<div class="equations">{"".join(made)}</div>')


def _line(line: str) -> str:
    """One line: equations and, behind three spaces, what is said of them; side by side if there is room."""
    pieces = re.split(r"(?<=[^\s])\s{3,}(?=\w)", re.sub(r"\s+(?==|->)", " ", line.strip()))
    made = [
        f"<math><mrow>{_math(p)}</mrow></math>" if re.search(r"[=+*/^<>|-]", p) else f"<span>{html.escape(p)}</span>"
        for p in pieces
    ]
    return f"<div>{' '.join(made)}</div>"


def _math(text: str) -> str:
    tokens = _tokens(text)
    parser = _Parser(tokens)
    made = parser.relation()
    if parser.at < len(tokens):
        raise _Unreadable(text)
    return made


def _tokens(text: str) -> list[tuple[str, str, bool]]:
    """Kind, text and whether a space stands before it."""
    text, out, at = _NEXT.sub(r"\1⁺", text), [], 0
    while at < len(text.rstrip()):
        if text[at] == "⁺":
            out.append(("next", "+", False))
            at += 1
            continue
        found = _TOKEN.match(text, at)
        if found is None:
            raise _Unreadable(text)
        spaced = found.group(0)[:1].isspace()
        number, name, primes, sign = found.groups()
        kind = "number" if number else "name" if name else "sign"
        out.append((kind, number or (name or "") + (primes or "") or sign, spaced))
        at = found.end()
    return out


class _Parser:
    """Recursive descent; every method gives MathML."""

    def __init__(self, tokens: list[tuple[str, str, bool]]) -> None:
        self.tokens, self.at, self.inside = tokens, 0, 0

    def _peek(self) -> tuple[str, str, bool]:
        return self.tokens[self.at] if self.at < len(self.tokens) else ("end", "", False)

    def _sign(self, *signs: str) -> str | None:
        kind, text, _ = self._peek()
        if kind != "sign" or text not in signs:
            return None
        self.at += 1
        return text

    def relation(self) -> str:
        """Sums, and what stands between them; a comma may end it, and words may stand in it."""
        out = [self._sum()]
        while (sign := self._sign(*RELATIONS)) is not None:
            out.append(f"<mo>{html.escape(RELATIONS[sign])}</mo>")
            if self._peek()[0] != "end":
                out.append(self._sum())
        return "".join(out)

    def _sum(self) -> str:
        sign = self._sign("-", "+")
        out = [f"<mo>{'−' if sign == '-' else '+'}</mo>" if sign else "", self._product()]
        while (sign := self._sign("+", "-")) is not None:
            out += [f"<mo>{'−' if sign == '-' else '+'}</mo>", self._product()]
        return "".join(out)

    def _product(self) -> str:
        out = self._power()
        while True:
            kind, text, _ = self._peek()
            if self._sign("/"):
                out = f"<mfrac><mrow>{_bare(out)}</mrow><mrow>{_bare(self._power())}</mrow></mfrac>"
            elif self._sign("*"):
                out += "<mo>·</mo>" + self._power()
            elif kind in ("number", "name") or (kind == "sign" and (text == "(" or (text == "|" and not self.inside))):
                out += '<mspace width="0.22em"/>' + self._power()
            else:
                return out

    def _power(self) -> str:
        base = self._factor()
        if self._sign("^"):
            return f"<msup><mrow>{base}</mrow><mrow>{_bare(self._factor())}</mrow></msup>"
        return base

    def _factor(self) -> str:
        kind, text, _ = self._peek()
        self.at += 1
        if kind == "number":
            return f"<mn>{text}</mn>"
        if kind == "name":
            return self._called(_name(text))
        if kind == "sign" and text == "(":
            return self._between("(", ")", self.relation)
        if kind == "sign" and text == "|":
            self.inside += 1
            made = self._between("|", "|", self._sum)
            self.inside -= 1
            return made
        raise _Unreadable(text)

    def _called(self, name: str) -> str:
        kind, text, spaced = self._peek()
        if kind == "next":
            self.at += 1
            return f"<msup>{name}<mo>+</mo></msup>"
        if kind == "sign" and text == "(" and not spaced:
            self.at += 1
            return name + self._between("(", ")", self.relation)
        return name

    def _between(self, opening: str, closing: str, inner: Callable[[], str]) -> str:
        kept, self.inside = self.inside, self.inside if opening == "|" else 0
        made = inner()
        if self._sign(closing) is None:
            raise _Unreadable(closing)
        self.inside = kept
        return f'<mrow><mo stretchy="false">{opening}</mo>{made}<mo stretchy="false">{closing}</mo></mrow>'


def _bare(made: str) -> str:
    """Without the brackets that a fraction or a power needs no more."""
    opening, closing = '<mrow><mo stretchy="false">(</mo>', '<mo stretchy="false">)</mo></mrow>'
    whole = (
        made.startswith(opening) and made.endswith(closing) and "<mo stretchy" not in made[len(opening) : -len(closing)]
    )
    return made[len(opening) : -len(closing)] if whole else made


def _name(text: str) -> str:
    """A quantity, with its index and primes."""
    name = text.rstrip("'")
    primes = "′" * (len(text) - len(name))
    if name in WORDS:
        return f'<mspace width="0.3em"/><mtext>{name}</mtext><mspace width="0.3em"/>'
    letter, _, index = name.partition("_")
    if index and (len(letter) == 1 or letter in GREEK):
        made = f"<msub><mi>{GREEK.get(letter, html.escape(letter))}</mi><mi>{html.escape(index)}</mi></msub>"
    else:
        made = f"<mi>{GREEK.get(name, html.escape(name))}</mi>"
    return f"<msup>{made}<mo>{primes}</mo></msup>" if primes else made
