"""The weight of a grid's cells: where it is large, cells are to be small.

One design for all families that take a weight.  It is given as a number, an array of the cells, a
function of x and y, or a formula (`regrid.equidistribution.weight_formulas`) of

    x, y           cell centres of the grid as it is found: follows every iterate
    rho, u, v, ...  fields of the flow, one value a cell, told before the step (`take_fields`):
                   they travel with the cells
    own            1 over the area of the old cells: the density of nodes that the grid has
    sides          the density of nodes that the block's sides ask for, 1 over the conditional
                   lengths interpolated from them: a graded rectangle has constant sides*area
    h              root of the area of the old cells

all over their mean where they are densities, so that `sides*(1 + 5*|grad(rho)|/max)` refines a
graded block where the density changes.  The trap: a field is known on the old cells only and its
gradient is rough; what depends on fields is smoothed by (1, 2, 1)/4 along i and j.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from regrid.barrier.side_laws import LENGTH, LENGTH_CHANGE, fill_blends, fill_laws
from regrid.equidistribution.areas import weigh_points
from regrid.equidistribution.weight_formulas import FIELDS, GEOMETRY, Expression
from regrid.errors import BadInput
from regrid.measure.centres import compute_centres
from regrid.measure.quality import compute_corner_areas

NOTHING = 1e-9  # differences of a field below this part of its size are round-off, not gradients


class Weight:
    """A weight and what it may need: fields of the flow, the old grid, the sides.

    weight: see the module; `smoothing`: passes over what depends on fields.  Raises BadInput for
    text that is no formula.
    """

    def __init__(self, weight, smoothing: int = 4):
        self.given, self.smoothing = weight, int(smoothing)
        if self.smoothing < 0:
            raise BadInput(f"weight: smoothing {smoothing} must not be negative")
        self.expression = Expression(weight) if isinstance(weight, str) else None
        if self.expression is not None:
            self.expression.check_names((*GEOMETRY, *FIELDS))
        names = self.expression.names if self.expression else set()
        self.needs_fields = bool(names - {*GEOMETRY, "pi"})
        self.needs_sides, self.needs_own = "sides" in names, bool(names & {"own", "h"})
        self.fields: Mapping[str, np.ndarray] = {}

    @property
    def by_position(self) -> bool:
        """Is it a number or a function of x and y alone?"""
        if self.expression is None:
            return callable(self.given) or np.ndim(self.given) == 0
        return self.expression.names <= {"x", "y", "pi"} and not self.expression.has_gradient

    @property
    def is_frozen(self) -> bool:
        """Does it stay with the cells while a grid is found?"""
        if self.expression is None:
            return not callable(self.given)
        return not self.expression.names & {"x", "y"}

    def at_points(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Values at points, for weights that are `by_position`."""
        if self.expression is not None:
            return weigh_points(self.expression.evaluate({"x": x, "y": y}), np.array([x, y]))
        return weigh_points(self.given, np.array([x, y]))

    def take_fields(self, fields: Mapping[str, np.ndarray]) -> None:
        """Be told the fields of the cells, (ni, nj) each, that the next grids are to follow."""
        self.fields = fields

    def on(self, previous: np.ndarray, boundary: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """The weight for one regrid: a function of nodes (2, ni+1, nj+1) to cells (ni, nj).

        Raises BadInput for names that are not known and, when called, for values not positive.
        """
        if self.expression is None:
            return lambda nodes: weigh_points(self.given, compute_centres(nodes))
        self._check_names()
        cells = (previous.shape[1] - 1, previous.shape[2] - 1)
        values = dict(self.fields)
        for name, field in values.items():
            if np.shape(field) != cells:
                raise BadInput(
                    f"weight: field '{name}' has shape {np.shape(field)}; the block has cells "
                    f"{cells}"
                )
        if self.needs_own:
            areas = np.abs(compute_corner_areas(previous)).sum(axis=0)
            areas = np.maximum(0.5 * areas, 1e-300)
            values |= {"own": areas.mean() / areas, "h": np.sqrt(areas)}
        if self.needs_sides:
            values["sides"] = compute_side_density(boundary)
        old = compute_centres(previous)
        rough = self.needs_fields or self.expression.has_gradient

        def weigh(nodes):
            centres = compute_centres(nodes)
            now = values | {"x": centres[0], "y": centres[1]}
            found = self.expression.evaluate(now, lambda f: measure_gradient(f, old))
            found = np.broadcast_to(found, cells)
            for _ in range(self.smoothing if rough else 0):
                found = smooth(found)
            return weigh_points(found, centres)

        if self.expression.names & {"x", "y"}:
            return weigh
        fixed = weigh(previous)
        return lambda nodes: fixed

    def _check_names(self) -> None:
        known = [*GEOMETRY, *self.fields]
        missing = sorted(self.expression.names & set(FIELDS) - set(known))
        if missing and not self.fields:
            raise BadInput(
                f"weight '{self.given}': there is no flow here, so no field '{missing[0]}'; "
                "use x and y"
            )
        self.expression.check_names(known)


def compute_side_density(boundary: np.ndarray) -> np.ndarray:
    """1 over the product of the two conditional lengths at the cells' centres, over its mean.

    boundary (2, ni+1, nj+1), of which only the sides are read; theory R10.10.
    """
    ni, nj = boundary.shape[1] - 1, boundary.shape[2] - 1
    along_i, along_j, block = np.zeros((5, ni)), np.zeros((5, nj)), np.zeros(1)
    blend_i, blend_j = np.zeros(ni + 1), np.zeros(nj + 1)
    fill_laws(boundary, 1, along_i, along_j, block)
    fill_blends(boundary, blend_i, blend_j)
    u, v = 0.5 * (blend_i[1:] + blend_i[:-1]), 0.5 * (blend_j[1:] + blend_j[:-1])
    length = along_i[LENGTH][:, None] + along_i[LENGTH_CHANGE][:, None] * v
    width = along_j[LENGTH] + u[:, None] * along_j[LENGTH_CHANGE]
    density = 1.0 / (length * width)
    return density / density.mean()


def measure_gradient(field: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """Size of the gradient of cell values (ni, nj) known at `centres` (2, ni, nj).

    Central differences along i and j, one-sided at the sides; invariant under rotation.
    """
    field = np.broadcast_to(np.asarray(field, dtype=np.float64), centres.shape[1:])
    differences = [
        np.gradient(field, axis=k) if field.shape[k] > 1 else 0.0 * field for k in (0, 1)
    ]
    along, across = (
        np.gradient(centres, axis=k + 1) if field.shape[k] > 1 else np.zeros_like(centres)
        for k in (0, 1)
    )
    least = NOTHING * np.abs(field).max()
    f1, f2 = (np.where(np.abs(f) > least, f, 0.0) for f in differences)
    area = along[0] * across[1] - along[1] * across[0]
    g11, g22, g12 = (along**2).sum(axis=0), (across**2).sum(axis=0), (along * across).sum(axis=0)
    square = f1 * f1 * g22 - 2.0 * f1 * f2 * g12 + f2 * f2 * g11
    return np.sqrt(np.maximum(square, 0.0)) / np.maximum(np.abs(area), 1e-300)


def smooth(values: np.ndarray) -> np.ndarray:
    """One pass of (1, 2, 1)/4 along both directions; the sides are their own images."""
    for _ in range(2):
        wide = np.concatenate([values[:1], values, values[-1:]])
        values = (0.5 * values + 0.25 * (wide[:-2] + wide[2:])).T
    return np.ascontiguousarray(values)
