"""Weights written as text: "1 + 10*y", "1 + 5*|grad(rho)|/max".

Arithmetic, bars for absolute values, a few functions, and names: of coordinates, of fields, and
what the caller knows besides.  `grad(f)` is the size of the gradient of f.  `/max` divides what
stands before it by its greatest value in the block, numbers in front of it aside: so 5*f/max goes
up to 5, whatever f.  The trap: text from a deck is never given to Python to run; it is parsed, and
only the nodes of the tree that are known here are evaluated.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping

import numpy as np

from regrid.errors import BadInput, suggest

OPERATORS = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
FUNCTIONS = {
    "abs": np.abs,
    "sqrt": np.sqrt,
    "exp": np.exp,
    "log": np.log,
    "sin": np.sin,
    "cos": np.cos,
    "tanh": np.tanh,
    "min": np.minimum,
    "max": np.maximum,
}
TWO_ARGUMENTS = ("min", "max")
CONSTANTS = {"pi": np.pi}
FIELDS = ("rho", "u", "v", "p", "e")  # of a flow, one value a cell
GEOMETRY = ("x", "y", "own", "sides", "h")  # of the grid: see `regrid.equidistribution.weights`
MOST_CHARACTERS, MOST_DEPTH = 1000, 60
MOST_NUMBER = 1e300
GRADIENT = "grad"


class Expression:
    """A parsed weight: `names` are those it uses, `evaluate` takes their values.

    Raises BadInput, with `what` the text is for, the text and what is wrong with it, for all but
    the names.
    """

    def __init__(self, text: str, what: str = "weight"):
        self.text, self.what = text, what
        if len(text) > MOST_CHARACTERS:
            raise BadInput(f"{what}: the expression is longer than {MOST_CHARACTERS} characters")
        try:
            self.tree = ast.parse(_spell_bars(text).strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise self._fault("is not a formula that can be read") from None
        self.names: set[str] = set()
        self.has_gradient = False
        self._check(self.tree, 0)

    def _fault(self, words: str) -> BadInput:
        return BadInput(f"{self.what} '{self.text}': {words}")

    def _check(self, node: ast.expr, depth: int) -> None:
        if depth > MOST_DEPTH:
            raise self._fault("it is nested too deeply")
        below: list[ast.expr] = []
        if isinstance(node, ast.Constant):
            if isinstance(node.value, bool) or not isinstance(node.value, int | float):
                raise self._fault(f"{node.value!r} is not a number")
            if abs(node.value) > MOST_NUMBER:
                raise self._fault("a number in it is too large")
        elif isinstance(node, ast.Name):
            if node.id in (*FUNCTIONS, GRADIENT):
                raise self._fault(
                    f"write {node.id}(...), or /max after what is to be divided by its maximum"
                    if node.id == "max"
                    else f"{node.id} is a function; write {node.id}(...)"
                )
            self.names.add(node.id)
        elif _is_over_max(node):
            below = [node.left]
        elif isinstance(node, ast.BinOp | ast.UnaryOp) and type(node.op) in OPERATORS:
            below = [node.left, node.right] if isinstance(node, ast.BinOp) else [node.operand]
        elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitXor):
            raise self._fault("a power is written **, not ^")
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
            self._check_call(node)
            below = list(node.args)
        else:
            raise self._fault("only + - * / **, brackets, |...|, numbers, names and functions work")
        for child in below:
            self._check(child, depth + 1)

    def _check_call(self, node: ast.Call) -> None:
        name = node.func.id
        if name not in FUNCTIONS and name != GRADIENT:
            raise self._fault(
                f"there is no function '{name}'{suggest(name, [*FUNCTIONS, GRADIENT])}"
            )
        wanted = 2 if name in TWO_ARGUMENTS else 1
        if len(node.args) != wanted:
            raise self._fault(f"{name} takes {wanted} value{'s' * (wanted > 1)}")
        self.has_gradient |= name == GRADIENT

    def check_names(self, known) -> None:
        """Raise BadInput for a name that is not in `known` or a constant."""
        for name in sorted(self.names):
            if name not in known and name not in CONSTANTS:
                raise self._fault(f"there is no '{name}' here{suggest(name, [*known, *CONSTANTS])}")

    def evaluate(
        self,
        values: Mapping[str, np.ndarray],
        gradient: Callable[[np.ndarray], np.ndarray] | None = None,
    ) -> np.ndarray:
        """The formula's value for arrays of one shape, named in `values`.

        `gradient` maps values of the cells to the size of their gradient.  What is not a number
        comes out as NaN or infinity.
        """
        with np.errstate(all="ignore"):
            return np.asarray(self._evaluate(self.tree, values, gradient), dtype=np.float64)

    def _evaluate(self, node, values, gradient):
        if isinstance(node, ast.Constant):
            return np.float64(node.value)
        if isinstance(node, ast.Name):
            return values[node.id] if node.id in values else CONSTANTS[node.id]
        if _is_over_max(node):
            factor, rest = _split_number(node.left)
            value = 1.0 if rest is None else self._evaluate(rest, values, gradient)
            greatest = np.max(value)
            return factor * (value / greatest if greatest != 0.0 else 0.0 * value)
        if isinstance(node, ast.UnaryOp):
            return OPERATORS[type(node.op)](self._evaluate(node.operand, values, gradient))
        if isinstance(node, ast.BinOp):
            left = self._evaluate(node.left, values, gradient)
            return OPERATORS[type(node.op)](left, self._evaluate(node.right, values, gradient))
        arguments = [self._evaluate(child, values, gradient) for child in node.args]
        if node.func.id == GRADIENT:
            if gradient is None:
                raise self._fault("grad(...) needs the cells of a plane grid")
            return gradient(arguments[0])
        return FUNCTIONS[node.func.id](*arguments)


def make_position_weight(text: str, names: tuple[str, ...] = ("x", "y")) -> Callable:
    """A function of the coordinates from a formula in their `names`; raises BadInput."""
    expression = Expression(text)
    if expression.has_gradient:
        raise BadInput(f"weight '{text}': grad(...) needs the cells of a plane grid")
    expression.check_names(names)

    def weight(*points):
        values = dict(zip(names, points, strict=True))
        return np.broadcast_to(expression.evaluate(values), np.shape(points[0]))

    return weight


def _spell_bars(text: str) -> str:
    """`|f|` as `abs(f)`: a bar opens where a value is due, and closes where one has ended."""
    out, value_ended, open_bars = [], False, 0
    for character in text:
        if character == "|":
            out.append(")" if value_ended else "abs(")
            open_bars += -1 if value_ended else 1
            continue
        out.append(character)
        if not character.isspace():
            value_ended = character.isalnum() or character in "_)."
    if open_bars != 0:
        raise BadInput(f"weight '{text}': a bar | is not closed")
    return "".join(out)


def _is_over_max(node: ast.expr) -> bool:
    return (
        isinstance(node, ast.BinOp)
        and isinstance(node.op, ast.Div)
        and isinstance(node.right, ast.Name)
        and node.right.id == "max"
    )


def _split_number(node: ast.expr) -> tuple[float, ast.expr | None]:
    """The number that a product or quotient begins with (1 if none), and the rest of it."""
    if isinstance(node, ast.Constant):
        return float(node.value), None
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        factor, rest = _split_number(node.operand)
        return -factor, rest
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult | ast.Div):
        factor, rest = _split_number(node.left)
        other, following = _split_number(node.right)
        if isinstance(node.op, ast.Div):
            if following is not None:
                return factor, ast.BinOp(rest or ast.Constant(1.0), node.op, node.right)
            return factor / other if other else np.inf, rest
        if rest is None or following is None:
            return factor * other, rest or following
        return factor, ast.BinOp(rest, node.op, node.right)
    return 1.0, node
