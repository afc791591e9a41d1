"""Formulas that a person writes in a scene file, evaluated without giving them the interpreter."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Final

import numpy as np

__all__ = ["check_formula", "evaluate_formula"]


def _erfc(argument: Any) -> Any:
    from scipy.special import erfc

    return erfc(argument)


def _erf(argument: Any) -> Any:
    from scipy.special import erf

    return erf(argument)


FUNCTIONS: Final[Mapping[str, Callable[..., Any]]] = MappingProxyType(
    {
        "abs": np.abs,
        "cos": np.cos,
        "cosh": np.cosh,
        "erf": _erf,
        "erfc": _erfc,
        "exp": np.exp,
        "log": np.log,
        "max": np.maximum,
        "min": np.minimum,
        "sin": np.sin,
        "sinh": np.sinh,
        "sqrt": np.sqrt,
        "tanh": np.tanh,
    }
)
CONSTANTS: Final[Mapping[str, float]] = MappingProxyType({"pi": float(np.pi), "e": float(np.e)})
BINARY: Final[Mapping[type, Callable[[Any, Any], Any]]] = MappingProxyType(
    {
        ast.Add: operator.add,
        ast.Sub: operator.sub,
        ast.Mult: operator.mul,
        ast.Div: operator.truediv,
        ast.Pow: operator.pow,
    }
)


def check_formula(formula: str, variable: str) -> ast.expr:
    """The syntax tree of a formula in one variable.

    Parameters
    ----------
    formula : str
        Numbers, `variable`, ``pi``, ``e``, ``+ - * / **`` (or ``^``), parentheses, and the functions
        abs, cos, cosh, erf, erfc, exp, log, max, min, sin, sinh, sqrt, tanh.
    variable : str
        Its name.

    Raises
    ------
    ValueError
        For anything else, naming it.
    """
    try:
        tree = ast.parse(formula.replace("^", "**"), mode="eval").body
    except SyntaxError as error:
        raise ValueError(f"formula: cannot read {formula!r}: {error.msg}") from None
    _check(tree, variable)
    return tree


def _check(node: ast.expr, variable: str) -> None:
    match node:
        case ast.Constant(value=value) if isinstance(value, int | float) and not isinstance(value, bool):
            pass
        case ast.Name(id=name):
            if name != variable and name not in CONSTANTS:
                raise ValueError(f"formula: unknown name {name!r}; known are {variable}, pi, e")
        case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
            _check(operand, variable)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in BINARY:
            _check(left, variable)
            _check(right, variable)
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in FUNCTIONS:
            wanted = 2 if name in ("max", "min") else 1
            if len(arguments) != wanted:
                raise ValueError(f"formula: {name} takes {wanted} argument(s), not {len(arguments)}")
            for argument in arguments:
                _check(argument, variable)
        case ast.Call(func=ast.Name(id=name)):
            raise ValueError(f"formula: unknown function {name!r}; known are {', '.join(FUNCTIONS)}")
        case _:
            raise ValueError(f"formula: {ast.unparse(node)!r} is not allowed")


def evaluate_formula(formula: str, variable: str, argument: np.ndarray) -> np.ndarray:
    """Values of the formula at `argument`, same shape, float64; not finite where it has no value.

    Examples
    --------
    >>> evaluate_formula("300 + 20*exp(-z/0.1)", "z", np.array([0.0])).tolist()
    [320.0]
    """
    tree = check_formula(formula, variable)
    argument = np.asarray(argument, dtype=np.float64)
    with np.errstate(all="ignore"):  # the caller looks at what came out
        result = _evaluate(tree, {**CONSTANTS, variable: argument})
    return np.broadcast_to(np.asarray(result, dtype=np.float64), argument.shape).copy()


def _evaluate(node: ast.expr, names: Mapping[str, Any]) -> Any:
    match node:
        case ast.Constant(value=value):
            return np.float64(value)  # type: ignore[arg-type]
        case ast.Name(id=name):
            return names[name]
        case ast.UnaryOp(op=op, operand=operand):
            result = _evaluate(operand, names)
            return -result if isinstance(op, ast.USub) else result
        case ast.BinOp(left=left, op=op, right=right):
            return BINARY[type(op)](_evaluate(left, names), _evaluate(right, names))
        case ast.Call(func=ast.Name(id=name), args=arguments):
            return FUNCTIONS[name](*(_evaluate(argument, names) for argument in arguments))
    raise AssertionError(ast.dump(node))  # check_formula let nothing else through
