"""The weight of a grid's cells, large where cells should be small; and sides that follow it.

All weighted grid families use this module.  A weight is a number, an array of cell values, a
function of x and y, or a formula such as "1 + 10*y" or "1 + 5*|grad(rho)|/max" of

    x, y           cell centres of the current iterate
    rho, u, v, ...  cell values of the flow, given before the step (`take_fields`):
                   they travel with the cells
    own            1 over the area of the old cells: the density of nodes that the grid has
    sides          the node density implied by the block's sides, 1 over the conditional
                   lengths interpolated from them: a graded rectangle has constant sides*area
    h              root of the area of the old cells

Densities are divided by their mean, so that `sides*(1 + 5*|grad(rho)|/max)` refines a graded block
where the density changes.  A formula has arithmetic, bars for absolute values and a few functions.
`grad(f)` is the magnitude of the gradient of f; `/max` divides the preceding expression by its
maximum in the block, except for numerical factors: 5*f/max reaches 5 for any f.  Text from a deck
is never executed by Python; it is parsed, and only known nodes of the syntax tree are evaluated.
Note: a field is known on the old cells only and its gradient is rough, so field-dependent weights
are smoothed by (1, 2, 1)/4 along i and j.

With `boundary` "given" the sides' nodes are preserved bitwise.  With "equidistributed" the
regridder places the nodes of its `free_sides` along their polylines with the same weight (theory
R10.9); corners are fixed.  In a block that adapts to a weight, sides that do not adapt bend the
lines that end on them, which is visible in shocks on such a grid.  Note: in a flow other blocks
share the nodes of a contact or seam, so only straight sides on walls may be free; the flow
determines which.  A jump to the target positions would sweep many cells through one face, so in a
flow nodes move by SIDE_MOTION of a spacing per full step (at 0.3 their own speed limited dt, and dt
collapsed).
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping

import numpy as np

from shockgrid.regrid.barrier.side_inputs import LENGTH, LENGTH_CHANGE, fill_spacings
from shockgrid.regrid.errors import BadInput, suggest
from shockgrid.regrid.measure.corners import compute_centres
from shockgrid.regrid.measure.quality import compute_corner_areas
from shockgrid.regrid.sides import SIDE_NAMES, SIDES
from shockgrid.regrid.spacings import arc_spacing, solve_ed1

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
FIELDS = ("rho", "u", "v", "p", "e")  # of a flow, one value per cell
GEOMETRY = ("x", "y", "own", "sides", "h")  # of the grid: see `regrid.equidistribution.weights`
MOST_CHARACTERS = 1000
MOST_DEPTH = 60
MOST_NUMBER = 1e300
GRADIENT = "grad"


class Expression:
    """A parsed weight: `names` are those it uses, `evaluate` takes their values.

    Raises BadInput with the text, its purpose `what` and the fault, for all faults except unknown
    names.
    """

    def __init__(self, text: str, what: str = "weight"):
        self.text = text
        self.what = what
        if len(text) > MOST_CHARACTERS:
            raise BadInput(f"{what}: the expression is longer than {MOST_CHARACTERS} characters")
        try:
            self.tree = ast.parse(_spell_bars(text).strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise self._fault("is not a formula that can be read") from None
        self.names: set[str] = set()
        self.has_gradient = False
        self._check(self.tree, 0)

    def _fault(self, fault: str) -> BadInput:
        """The exception for a formula, with what is wrong with it."""
        return BadInput(f"{self.what} '{self.text}': {fault}")

    def _check(self, node: ast.expr, depth: int) -> None:
        """Raise BadInput for a part of the formula that is not allowed; collect its names."""
        if depth > MOST_DEPTH:
            raise self._fault("it is nested too deeply")
        operands: list[ast.expr] = []
        # numbers and names
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
        # operations, whose operands are checked below
        elif _is_over_max(node):
            operands = [node.left]
        elif isinstance(node, ast.BinOp | ast.UnaryOp) and type(node.op) in OPERATORS:
            operands = [node.left, node.right] if isinstance(node, ast.BinOp) else [node.operand]
        elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitXor):
            raise self._fault("a power is written **, not ^")
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
            self._check_call(node)
            operands = list(node.args)
        else:
            raise self._fault("only + - * / **, brackets, |...|, numbers, names and functions work")
        # one level deeper
        for child in operands:
            self._check(child, depth + 1)

    def _check_call(self, node: ast.Call) -> None:
        """Raise BadInput for a function that is not there, or has another number of values."""
        name = node.func.id
        if name not in FUNCTIONS and name != GRADIENT:
            raise self._fault(
                f"there is no function '{name}'{suggest(name, [*FUNCTIONS, GRADIENT])}"
            )
        wanted = 2 if name in TWO_ARGUMENTS else 1
        if len(node.args) != wanted:
            raise self._fault(f"{name} takes {wanted} value{'s' * (wanted > 1)}")
        self.has_gradient |= name == GRADIENT

    def check_names(self, allowed_names) -> None:
        """Raise BadInput for a name that is neither in `allowed_names` nor a constant."""
        for name in sorted(self.names):
            if name not in allowed_names and name not in CONSTANTS:
                hint = suggest(name, [*allowed_names, *CONSTANTS])
                raise self._fault(f"there is no '{name}' here{hint}")

    def evaluate(
        self,
        values: Mapping[str, np.ndarray],
        gradient: Callable[[np.ndarray], np.ndarray] | None = None,
    ) -> np.ndarray:
        """The formula's value for arrays of one shape, named in `values`.

        `gradient` maps cell values to the magnitude of their gradient.  Undefined results are NaN
        or infinity.
        """
        with np.errstate(all="ignore"):
            return np.asarray(self._evaluate(self.tree, values, gradient), dtype=np.float64)

    def _evaluate(self, node, values, gradient):
        """The value of one part of the formula."""
        if isinstance(node, ast.Constant):
            return np.float64(node.value)
        if isinstance(node, ast.Name):
            return values[node.id] if node.id in values else CONSTANTS[node.id]
        if _is_over_max(node):
            factor, formula = _split_number(node.left)
            value = 1.0 if formula is None else self._evaluate(formula, values, gradient)
            maximum = np.max(value)
            return factor * (value / maximum if maximum != 0.0 else 0.0 * value)
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
    """`|f|` as `abs(f)`: a bar opens where an operand is expected and closes after one."""
    out = []
    value_ended = False
    open_bars = 0
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
    """Whether it is something divided by `max`, its own maximum."""
    return (
        isinstance(node, ast.BinOp)
        and isinstance(node.op, ast.Div)
        and isinstance(node.right, ast.Name)
        and node.right.id == "max"
    )


def _split_number(node: ast.expr) -> tuple[float, ast.expr | None]:
    """The leading number of a product or quotient (1 if none), and what it multiplies."""
    if isinstance(node, ast.Constant):
        return float(node.value), None
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        factor, formula = _split_number(node.operand)
        return -factor, formula
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult | ast.Div):
        factor, formula = _split_number(node.left)
        second_factor, second_formula = _split_number(node.right)
        if isinstance(node.op, ast.Div):
            if second_formula is not None:
                return factor, ast.BinOp(formula or ast.Constant(1.0), node.op, node.right)
            return factor / second_factor if second_factor else np.inf, formula
        if formula is None or second_formula is None:
            return factor * second_factor, formula or second_formula
        return factor, ast.BinOp(formula, node.op, node.right)
    return 1.0, node


# differences of a field below this part of its size are round-off, not gradients
ROUND_OFF_DIFFERENCE = 1e-9


def weigh_points(weight, points: np.ndarray) -> np.ndarray:
    """The weight of cells with the centres `points` (dimensions, ...).

    weight: a number, an array of cell values or a function of the coordinates; must be positive.
    """
    value = weight(*points) if callable(weight) else weight
    value = np.asarray(value, dtype=np.float64)
    cells = points.shape[1:]
    if value.shape not in ((), cells):
        raise BadInput(
            f"equidistribution: a weight of shape {value.shape} does not fit cells {cells}"
        )
    value = np.broadcast_to(value, cells)
    if not (np.isfinite(value).all() and value.min() > 0.0):
        cell = tuple(int(k) for k in np.argwhere(~((value > 0.0) & np.isfinite(value)))[0])
        raise BadInput(f"equidistribution: the weight must be positive; it is not in cell {cell}")
    return np.ascontiguousarray(value)


class Weight:
    """A weight and the data it may need: fields of the flow, the old grid, the sides.

    weight: see the module; `smoothing`: passes over field-dependent weights.  Raises BadInput for
    an invalid formula.
    """

    def __init__(self, weight, smoothing: int = 4):
        self.weight = weight
        self.smoothing = int(smoothing)
        if self.smoothing < 0:
            raise BadInput(f"weight: smoothing {smoothing} must not be negative")
        self.expression = Expression(weight) if isinstance(weight, str) else None
        if self.expression is not None:
            self.expression.check_names((*GEOMETRY, *FIELDS))
        names = self.expression.names if self.expression else set()
        self.needs_fields = bool(names - {*GEOMETRY, "pi"})
        self.needs_sides = "sides" in names
        self.needs_old_cells = bool(names & {"own", "h"})
        self.fields: Mapping[str, np.ndarray] = {}

    @property
    def by_position(self) -> bool:
        """Whether it is a number or a function of x and y alone."""
        if self.expression is None:
            return callable(self.weight) or np.ndim(self.weight) == 0
        return self.expression.names <= {"x", "y", "pi"} and not self.expression.has_gradient

    @property
    def is_frozen(self) -> bool:
        """Whether it stays with the cells during the iteration."""
        if self.expression is None:
            return not callable(self.weight)
        return not self.expression.names & {"x", "y"}

    def at_points(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Values at points, for weights `by_position`."""
        if self.expression is not None:
            return weigh_points(self.expression.evaluate({"x": x, "y": y}), np.array([x, y]))
        return weigh_points(self.weight, np.array([x, y]))

    def take_fields(self, fields: Mapping[str, np.ndarray]) -> None:
        """Set the cell fields, (ni, nj) each, for the next grids."""
        self.fields = fields

    def on(self, previous: np.ndarray, boundary: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """The weight for one regrid: a function of nodes (2, ni+1, nj+1) to cells (ni, nj).

        Raises BadInput for unknown names and, when called, for values that are not positive.
        """
        if self.expression is None:
            return lambda nodes: weigh_points(self.weight, compute_centres(nodes))
        self._check_names()
        cells = (previous.shape[1] - 1, previous.shape[2] - 1)
        values = dict(self.fields)
        for name, field in values.items():
            if np.shape(field) != cells:
                raise BadInput(
                    f"weight: field '{name}' has shape {np.shape(field)}; the block has cells "
                    f"{cells}"
                )
        if self.needs_old_cells:
            areas = np.abs(compute_corner_areas(previous)).sum(axis=0)
            areas = np.maximum(0.5 * areas, 1e-300)
            values |= {"own": areas.mean() / areas, "h": np.sqrt(areas)}
        if self.needs_sides:
            values["sides"] = compute_side_density(boundary)
        old_centres = compute_centres(previous)
        depends_on_fields = self.needs_fields or self.expression.has_gradient

        def weigh(nodes):
            centres = compute_centres(nodes)
            named_values = values | {"x": centres[0], "y": centres[1]}
            cell_weights = self.expression.evaluate(
                named_values, lambda f: measure_gradient(f, old_centres)
            )
            cell_weights = np.broadcast_to(cell_weights, cells)
            for _ in range(self.smoothing if depends_on_fields else 0):
                cell_weights = smooth(cell_weights)
            return weigh_points(cell_weights, centres)

        if self.expression.names & {"x", "y"}:
            return weigh
        fixed = weigh(previous)
        return lambda nodes: fixed

    def _check_names(self) -> None:
        """Raise BadInput for names that are neither geometry nor fields of this flow."""
        known_names = [*GEOMETRY, *self.fields]
        missing = sorted(self.expression.names & set(FIELDS) - set(known_names))
        if missing and not self.fields:
            raise BadInput(
                f"weight '{self.weight}': there is no flow here, so no field '{missing[0]}'; "
                "use x and y"
            )
        self.expression.check_names(known_names)


def compute_side_density(boundary: np.ndarray) -> np.ndarray:
    """1 over the product of the two conditional lengths at the cells' centres, over its mean.

    Only the sides of boundary (2, ni+1, nj+1) are read; theory R10.10.
    """
    ni, nj = boundary.shape[1] - 1, boundary.shape[2] - 1
    along_i, along_j = np.zeros((5, ni)), np.zeros((5, nj))
    blend_i, blend_j = np.zeros(ni + 1), np.zeros(nj + 1)
    fill_spacings(boundary, True, along_i, along_j, blend_i, blend_j)
    u, v = 0.5 * (blend_i[1:] + blend_i[:-1]), 0.5 * (blend_j[1:] + blend_j[:-1])
    length = along_i[LENGTH][:, None] + along_i[LENGTH_CHANGE][:, None] * v
    width = along_j[LENGTH] + u[:, None] * along_j[LENGTH_CHANGE]
    density = 1.0 / (length * width)
    return density / density.mean()


def measure_gradient(field: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """Magnitude of the gradient of cell values (ni, nj) at `centres` (2, ni, nj).

    Central differences along i and j, one-sided at the sides; invariant under rotation.
    """
    field = np.broadcast_to(np.asarray(field, dtype=np.float64), centres.shape[1:])
    differences = [
        np.gradient(field, axis=k) if field.shape[k] > 1 else 0.0 * field for k in (0, 1)
    ]
    step_i, step_j = (
        np.gradient(centres, axis=k + 1) if field.shape[k] > 1 else np.zeros_like(centres)
        for k in (0, 1)
    )
    round_off = ROUND_OFF_DIFFERENCE * np.abs(field).max()
    f1, f2 = (np.where(np.abs(f) > round_off, f, 0.0) for f in differences)
    area = step_i[0] * step_j[1] - step_i[1] * step_j[0]
    g11 = (step_i**2).sum(axis=0)
    g22 = (step_j**2).sum(axis=0)
    g12 = (step_i * step_j).sum(axis=0)
    square = f1 * f1 * g22 - 2.0 * f1 * f2 * g12 + f2 * f2 * g11
    return np.sqrt(np.maximum(square, 0.0)) / np.maximum(np.abs(area), 1e-300)


def smooth(values: np.ndarray) -> np.ndarray:
    """One pass of (1, 2, 1)/4 along both directions, with reflection at the sides."""
    for _ in range(2):
        extended = np.concatenate([values[:1], values, values[-1:]])
        values = (0.5 * values + 0.25 * (extended[:-2] + extended[2:])).T
    return np.ascontiguousarray(values)


BESIDE = (np.s_[0], np.s_[-1], np.s_[:, 0], np.s_[:, -1])  # cells along the four sides
SIDE_MOTION = 0.1  # motion of a side's node along its side per full step of a flow, in spacings


class WeightedRegridder:
    """Base: `weight` (see `equidistribution.weights`), `smoothing` of field-dependent weights, and
    `boundary` "given" or "equidistributed".
    """

    name = "weighted"

    def __init__(self, weight, boundary: str = "given", smoothing: int = 4):
        if boundary not in ("given", "equidistributed"):
            raise BadInput(
                f"{self.name}: boundary '{boundary}' is neither 'given' nor 'equidistributed'"
            )
        self.weight = Weight(weight, smoothing)
        self.boundary = boundary
        if self.owns_sides and self.weight.needs_old_cells:
            raise BadInput(
                f"{self.name}: equidistributed sides cannot follow 'own' or 'h', which come from "
                "where the nodes lie; give a weight of x, y, 'sides' or fields"
            )
        self.free_sides = SIDE_NAMES
        self.step_fraction: float | None = None

    @property
    def owns_sides(self) -> bool:
        """Whether it places the nodes of its `free_sides` itself."""
        return self.boundary == "equidistributed"

    @property
    def sees_flow(self) -> bool:
        """Whether it needs the fields and steps of a flow."""
        return self.weight.needs_fields or self.owns_sides

    def take_step(self, fields: Mapping[str, np.ndarray], step_fraction: float) -> None:
        """Set the cell fields, (ni, nj) each, and the next step as a fraction of the stable one."""
        self.weight.take_fields(fields)
        self.step_fraction = float(step_fraction)

    def distribute_sides(self, previous: np.ndarray, boundary: np.ndarray) -> np.ndarray:
        """`boundary`, with the nodes of free sides redistributed if it places them."""
        if not self.owns_sides:
            return boundary
        most_motion = np.inf if self.step_fraction is None else SIDE_MOTION * self.step_fraction
        return distribute_on_sides(boundary, self.weight, previous, self.free_sides, most_motion)


def distribute_on_sides(
    boundary: np.ndarray,
    weight: Weight,
    previous: np.ndarray,
    sides: tuple[str, ...] = SIDE_NAMES,
    most_motion: float = np.inf,
) -> np.ndarray:
    """A copy of `boundary` with w ds constant on some of its sides, by theory R10.9.

    A weight of position is evaluated on the polylines of `boundary`; any other is that of the
    adjacent cells on the grid `previous` and moves with them.  Nodes move by at most `most_motion`
    (< 0.5) of the shorter adjacent spacing from their relative position on the side in `previous`.
    """
    distributed = np.array(boundary, dtype=np.float64, order="C")
    cells = None if weight.by_position else weight.on(previous, boundary)(previous)
    for name, side, cells_at_side in zip(SIDE_NAMES, SIDES, BESIDE, strict=True):
        if name not in sides:
            continue
        line = np.ascontiguousarray(boundary[side])
        spacing = arc_spacing(line)
        if cells is None:

            def weight_at(s, line=line, spacing=spacing):
                return weight.at_points(
                    np.interp(s, spacing, line[0]), np.interp(s, spacing, line[1])
                )

            wanted = solve_ed1(weight_at, line.shape[1])
        else:
            wanted = np.concatenate([[0.0], np.cumsum(1.0 / cells[cells_at_side])])
            wanted /= wanted[-1]
        if np.isfinite(most_motion):
            old_spacing = arc_spacing(np.ascontiguousarray(previous[side]))
            steps = np.diff(old_spacing)
            reach = most_motion * np.minimum(steps[1:], steps[:-1])
            wanted[1:-1] = old_spacing[1:-1] + np.clip(
                wanted[1:-1] - old_spacing[1:-1], -reach, reach
            )
        inner = np.array([np.interp(wanted, spacing, coordinate) for coordinate in line])
        distributed[side][:, 1:-1] = inner[:, 1:-1]
    return distributed
