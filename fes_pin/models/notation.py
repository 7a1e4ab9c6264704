"""Equations of docstrings as expressions: read, with numbers in the place of names, and written again.

The notation: products by a space, quotients by /, powers by ^, calls by a bracket that follows at once, v' and v'' for
derivatives, b+ for the next value, x_y for an index of a letter, -> for "becomes". It is rewritten as an expression of
Python, which Python's own parser reads.
"""

import ast
import re
from collections.abc import Callable, Mapping

PRIME, NEXT = "ʹ", "ᐩ"
"""Letters of Python's names that mean a prime and the plus of a next value."""
AS_PYTHON = {
    r"([^\W\d]\w*)\+(?=\s*(?:=|$))": rf"\1{NEXT}",
    "'": PRIME,
    r"\b[^\W\d]": r"_\g<0>",  # no name is a keyword
    r"\^": "**",
    r"(?<![<>])=": "==",
    "->": ">>",
    r"\|([^|]*)\|": r"abs(\1)",
    r"(?<=[\w)])\s+(?=[\w(])": "@",  # a product
}
"""The notation, and what Python has for it; in this order."""
AS_WRITTEN: dict[str, str | Callable[[re.Match[str]], str]] = {
    r"abs\(((?:[^()]|\([^()]*\))*)\)": r"|\1|",
    ">>": "->",
    "==": "=",
    r" \*\* ": "^",
    r" @ ": " ",
    rf"\b_(\w*?)({PRIME}*)({NEXT}?)\b": lambda m: m[1] + "'" * len(m[2]) + "+" * len(m[3]),
}
"""Python as `ast` writes it, and the notation; in this order."""


def read_equation(text: str) -> ast.expr:
    """Return equations as an expression of Python: a product is `@`, "becomes" is `>>`, and names begin with "_".

    Raises
    ------
    SyntaxError, ValueError, RecursionError
        They cannot be parsed.
    """
    for pattern, instead in AS_PYTHON.items():
        text = re.sub(pattern, instead, text)
    return ast.parse(text, mode="eval").body


def written(expression: ast.expr) -> str:
    """Return the equations of an expression in the notation."""
    if isinstance(expression, ast.Tuple):
        return ", ".join(map(written, expression.elts))
    text = ast.unparse(expression)
    for pattern, instead in AS_WRITTEN.items():
        text = re.sub(pattern, instead, text)
    return text


def simplified(text: str, known: Mapping[str, float | str]) -> str:
    """Return equations with names replaced by numbers or other names, without what vanishes then."""
    return written(_Simplifier(known).visit(read_equation(text)))


class _Simplifier(ast.NodeTransformer):
    """Replaces names, and leaves out terms that are 0, factors and powers that are 1."""

    def __init__(self, known: Mapping[str, float | str]) -> None:
        self.known = known

    def visit_Name(self, node: ast.Name) -> ast.expr:
        name = node.id.removeprefix("_")
        value = self.known.get(name.rstrip(PRIME + NEXT))
        if isinstance(value, str) and value != name:
            return ast.Name(f"_{value}{name[len(name.rstrip(PRIME + NEXT)) :]}")
        return _constant(value) if isinstance(value, float | int) else node

    def visit_Call(self, node: ast.Call) -> ast.expr:
        node.args = [self.visit(one) for one in node.args]  # the function keeps its name
        return node

    def visit_UnaryOp(self, node: ast.UnaryOp) -> ast.expr:
        operand = self.visit(node.operand)
        return node if operand is node.operand else _negative(operand)

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        left, right = self.visit(node.left), self.visit(node.right)
        if left is node.left and right is node.right:  # numbers that are written may be of a sentence
            return node
        op, a, b = node.op, _number(left), _number(right)
        is_product, is_sum = isinstance(op, ast.Mult | ast.MatMult), isinstance(op, ast.Add)
        is_power, is_quotient = isinstance(op, ast.Pow), isinstance(op, ast.Div)
        if a is not None and b is not None and (is_sum or is_power):
            return _constant(a + b if is_sum else a**b)
        if (is_sum and a == 0.0) or (is_product and (a == 1.0 or b == 0.0)):
            return right
        if (b == 0.0 and isinstance(op, ast.Add | ast.Sub)) or (a == 0.0 and (is_product or is_quotient)):
            return left
        if b == 1.0 and (is_product or is_quotient or is_power):
            return left
        return _constant(1.0) if is_power and b == 0.0 else _with_sign(left, op, right)


def _with_sign(left: ast.expr, op: ast.operator, right: ast.expr) -> ast.expr:
    """Return an operation, with a sign of its parts before it or in it."""
    match op, left, right:
        case ast.Mult() | ast.MatMult(), ast.Constant(value=-1), _:
            return _negative(right)
        case ast.Mult() | ast.MatMult(), ast.UnaryOp(op=ast.USub(), operand=before), _:
            return _negative(ast.BinOp(before, op, right))
        case ast.Add() | ast.Sub(), _, ast.UnaryOp(op=ast.USub(), operand=behind):
            return ast.BinOp(left, ast.Sub() if isinstance(op, ast.Add) else ast.Add(), behind)
    return ast.BinOp(left, op, right)


def _number(node: ast.expr) -> float | None:
    return float(node.value) if isinstance(node, ast.Constant) and isinstance(node.value, int | float) else None


def _constant(value: float) -> ast.expr:
    """Return a number with four digits; below 0 the negative of one."""
    short = float(f"{value:.4g}")
    return ast.Constant(int(short) if short.is_integer() else short)


def _negative(node: ast.expr) -> ast.expr:
    match node:
        case ast.UnaryOp(op=ast.USub(), operand=inside):
            return inside
        case ast.BinOp(left=left, op=ast.Sub(), right=right):
            return ast.BinOp(right, ast.Sub(), left)
    return ast.UnaryOp(ast.USub(), node)
