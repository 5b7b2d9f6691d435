"""Fields given as text, such as "0.01 * cos(pi * x)": functions of the place that a file can hold."""

from __future__ import annotations

import ast
import functools
import operator
from collections.abc import Callable
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator

from ..errors import quoted, suggestion

LONGEST = 1000  # characters
NAMES = ("x", "y", "z", "pi")
FUNCTIONS: dict[str, tuple[int, Callable[..., Any]]] = {
    **{
        name: (1, getattr(np, name))
        for name in ("sin", "cos", "tan", "exp", "log", "sqrt", "abs", "tanh", "sinh", "cosh")
    },
    "atan2": (2, np.arctan2),
    "hypot": (2, np.hypot),
    "min": (2, np.minimum),
    "max": (2, np.maximum),
    "where": (3, lambda condition, a, b: np.where(condition > 0, a, b)),
}
"""Name -> (arguments, function); min and max may have more."""
OPERATORS: dict[type, Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.And: np.logical_and,
    ast.Or: np.logical_or,
    ast.Not: np.logical_not,
}


def evaluate(text: str, points: np.ndarray) -> np.ndarray:
    """Values of an expression of x, y, z [m] at points of shape (n, 3): shape (n,).

    Numbers, + - * / **, comparisons, and, or, not, pi and FUNCTIONS. Raises ValueError for anything else.
    """
    if len(text) > LONGEST:
        raise ValueError(f"an expression of {len(text)} characters; {LONGEST} at most")
    try:
        tree = ast.parse(text.strip(), mode="eval").body
        x, y, z = np.array(points, float).T
        with np.errstate(all="ignore"):  # what is no number is refused by whoever asked
            found = _value(tree, {"x": x, "y": y, "z": z, "pi": np.float64(np.pi)})
    except (SyntaxError, RecursionError, MemoryError):
        raise ValueError(f"{quoted(text)} is no expression; one is such as 0.1 + 0.01 * cos(pi * x)") from None
    return np.broadcast_to(np.asarray(found, float), (len(points),))


def _value(node: ast.AST, names: dict[str, Any]) -> Any:
    """What a node comes to, as floats: what holds is 1, what does not is 0."""
    return np.asarray(_raw(node, names), float)


def _raw(node: ast.AST, names: dict[str, Any]) -> Any:
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        return np.float64(node.value)
    if isinstance(node, ast.Name):
        if node.id not in names:
            raise ValueError(f"unknown name {quoted(node.id)}{suggestion(node.id, (*NAMES, *FUNCTIONS))}")
        return names[node.id]
    if isinstance(node, ast.BinOp | ast.UnaryOp) and type(node.op) in OPERATORS:
        parts = [node.left, node.right] if isinstance(node, ast.BinOp) else [node.operand]
        return OPERATORS[type(node.op)](*(_value(part, names) for part in parts))
    if isinstance(node, ast.BoolOp):
        first, *rest = (_value(part, names) for part in node.values)
        for other in rest:
            first = OPERATORS[type(node.op)](first, other)
        return first
    if isinstance(node, ast.Compare) and all(type(op) in OPERATORS for op in node.ops):
        sides = [_value(part, names) for part in (node.left, *node.comparators)]
        held = [OPERATORS[type(op)](a, b) for op, a, b in zip(node.ops, sides, sides[1:], strict=False)]
        return np.logical_and.reduce(np.broadcast_arrays(*held))
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        if node.func.id not in FUNCTIONS:
            raise ValueError(f"unknown function {quoted(node.func.id)}{suggestion(node.func.id, FUNCTIONS)}")
        wanted, function = FUNCTIONS[node.func.id]
        parts = [_value(part, names) for part in node.args]
        if len(parts) == wanted:
            return function(*parts)
        if node.func.id in ("min", "max") and len(parts) > wanted:
            return functools.reduce(function, parts)
        raise ValueError(f"{node.func.id}: not with {len(parts)} arguments")
    raise ValueError(f"{quoted(ast.unparse(node))} is nothing that an expression may hold")


def _readable(text: str) -> str:
    evaluate(text, np.zeros((1, 3)))
    return text


Expression = Annotated[str, AfterValidator(_readable)]
