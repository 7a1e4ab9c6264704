"""Equations of docstrings as MathML, which browsers set as mathematics; what cannot be parsed stays as it is written.

`models.notation` reads them. Three spaces separate an equation from a remark on it.

Source: MathML Core, W3C.
"""

import ast
import html
import re

from fes_pin.models.notation import NEXT, PRIME, read_equation
from fes_pin.view.page import Markup

GREEK = {
    **{"alpha": "α", "beta": "β", "delta": "δ", "epsilon": "ε", "zeta": "ζ", "theta": "θ", "mu": "μ", "xi": "ξ"},
    **{"pi": "π", "rho": "ρ", "sigma": "σ", "tau": "τ", "phi": "φ", "omega": "ω"},
}
WORDS = set(
    ["where", "replaced", "by", "replaces", "shortens", "the", "muscle", "from", "up", "for", "at", "if", "else", "and"]
)
"""Words of a sentence, which are no names of quantities."""
SIGNS: dict[type[ast.AST], str] = {
    **{ast.Add: "+", ast.UAdd: "+", ast.Sub: "−", ast.USub: "−", ast.Mult: "·", ast.RShift: "→"},
    **{ast.Eq: "=", ast.Lt: "&lt;", ast.Gt: "&gt;", ast.LtE: "≤", ast.GtE: "≥"},
}
BINDING: dict[type, int] = {
    **{ast.Tuple: 0, ast.Compare: 1, ast.RShift: 1, ast.Add: 2, ast.Sub: 2, ast.UAdd: 3, ast.USub: 3, ast.Mult: 3},
    **{ast.MatMult: 3, ast.Div: 3, ast.Pow: 4},
}
"""Precedence of operators; any other expression is a unit."""


def equations_mathml(text: str) -> Markup:
    """Lines of equations as one block of mathematics each; as they are written where one of them cannot be parsed."""
    lines = [line for line in text.split("\n") if line.strip()]
    try:
        made = [_line(line) for line in lines]
    except (SyntaxError, ValueError, KeyError, RecursionError):
        return Markup(f"<pre>{html.escape(text)}</pre>")
    return Markup(f'<div class="equations">{"".join(made)}</div>')


def _line(line: str) -> str:
    """One line: equations and, behind three spaces, what is said of them; side by side if there is room."""
    pieces = re.split(r"(?<=[^\s])\s{3,}(?=\w)", re.sub(r"\s+(?==|->)", " ", line.strip()))
    made = [_math(p) if re.search(r"[=+*/^<>|-]", p) else f"<span>{html.escape(p)}</span>" for p in pieces]
    return f"<div>{' '.join(made)}</div>"


def _math(text: str) -> str:
    """Equations; a comma may end them."""
    made = _drawn(read_equation(text.removesuffix(",")))
    return f"<math><mrow>{made}{'<mo>,</mo>' * text.endswith(',')}</mrow></math>"


def _bound(node: ast.expr, least: int) -> str:
    """An expression, in brackets where it binds less than what is around it."""
    made = _drawn(node)
    return _between("(", made, ")") if BINDING.get(type(getattr(node, "op", node)), 9) < least else made


def _between(opening: str, made: str, closing: str) -> str:
    return f'<mrow><mo stretchy="false">{opening}</mo>{made}<mo stretchy="false">{closing}</mo></mrow>'


def _drawn(node: ast.expr) -> str:
    match node:
        case ast.Constant(value=int() | float() as value):
            made = f"<mn>{value:g}</mn>"
        case ast.Name():
            made = _name(node.id.removeprefix("_"))
        case ast.Call(func=ast.Name(id="abs")):
            made = _between("|", _drawn(node.args[0]), "|")
        case ast.Call(func=ast.Name()):
            made = _drawn(node.func) + _between("(", "<mo>,</mo>".join(map(_drawn, node.args)), ")")
        case ast.Tuple():
            made = "<mo>,</mo>".join(map(_drawn, node.elts))
        case ast.Compare():
            pairs = zip(node.ops, node.comparators, strict=True)
            made = _bound(node.left, 1) + "".join(f"<mo>{SIGNS[type(op)]}</mo>{_bound(one, 1)}" for op, one in pairs)
        case ast.UnaryOp():
            made = f"<mo>{SIGNS[type(node.op)]}</mo>{_bound(node.operand, 3)}"
        case ast.BinOp(op=ast.Div()):
            made = f"<mfrac><mrow>{_drawn(node.left)}</mrow><mrow>{_drawn(node.right)}</mrow></mfrac>"
        case ast.BinOp(op=ast.Pow()):
            made = f"<msup><mrow>{_bound(node.left, 5)}</mrow><mrow>{_drawn(node.right)}</mrow></msup>"
        case ast.BinOp():
            own, product = BINDING[type(node.op)], isinstance(node.op, ast.MatMult)
            sign = '<mspace width="0.22em"/>' if product else f"<mo>{SIGNS[type(node.op)]}</mo>"
            made = _bound(node.left, own) + sign + _bound(node.right, min(own + 1, 3))
        case _:
            raise SyntaxError
    return made


def _name(text: str) -> str:
    """A quantity, with its index and primes."""
    name = text.rstrip(PRIME + NEXT)
    if name in WORDS:
        return f'<mspace width="0.3em"/><mtext>{name}</mtext><mspace width="0.3em"/>'
    letter, _, index = name.partition("_")
    if index and (len(letter) == 1 or letter in GREEK):
        made = f"<msub><mi>{GREEK.get(letter, letter)}</mi><mi>{index}</mi></msub>"
    else:
        made = f"<mi>{GREEK.get(name, name)}</mi>"
    marks = text[len(name) :].replace(PRIME, "′").replace(NEXT, "+")
    return f"<msup>{made}<mo>{marks}</mo></msup>" if marks else made
