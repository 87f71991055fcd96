"""What the regridders with a weight share: the weight itself, and sides that may follow it.

With `boundary` "given" the sides' nodes are kept to the bit.  With "equidistributed" a regridder
owns them: it places the nodes of its `free_sides` along their polylines by the same weight (theory
R10.9), corners kept.  Inside a block that adapts to a weight, sides that do not bend the
lines that end on them: shocks on such a grid show it.

The trap: in a flow other blocks see the nodes of a contact or seam, so that only sides that lie
straight on walls may be free; the flow says which.  And a jump to the wanted places would drive
many cells through one face: told the steps of a flow, nodes go SIDE_MOTION of a spacing a full step
(at 0.3 their own speed limited dt, and dt collapsed).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from regrid.curves.spacing_laws import arc_law, solve_ed1
from regrid.equidistribution.weights import Weight
from regrid.errors import BadInput
from regrid.sides import SIDE_NAMES, SIDES

BESIDE = (np.s_[0], np.s_[-1], np.s_[:, 0], np.s_[:, -1])  # cells along the four sides
SIDE_MOTION = 0.1  # way of a side's node along its side in a full step of a flow, in spacings


class WeightedRegridder:
    """Base: `weight` (see `equidistribution.weights`), `smoothing` of what depends on fields, and
    `boundary` "given" or "equidistributed".
    """

    name = "weighted"

    def __init__(self, weight, boundary: str = "given", smoothing: int = 4):
        if boundary not in ("given", "equidistributed"):
            raise BadInput(
                f"{self.name}: boundary '{boundary}' is neither 'given' nor 'equidistributed'"
            )
        self.weight, self.boundary = Weight(weight, smoothing), boundary
        if self.owns_sides and self.weight.needs_own:
            raise BadInput(
                f"{self.name}: equidistributed sides cannot follow 'own' or 'h', which come from "
                "where the nodes lie; give a weight of x, y, 'sides' or fields"
            )
        self.free_sides = SIDE_NAMES
        self.step_fraction: float | None = None

    @property
    def owns_sides(self) -> bool:
        """Does it place nodes of its `free_sides` itself?"""
        return self.boundary == "equidistributed"

    @property
    def sees_flow(self) -> bool:
        """Is it to be told the fields of a flow and its steps?"""
        return self.weight.needs_fields or self.owns_sides

    def take_step(self, fields: Mapping[str, np.ndarray], step_fraction: float) -> None:
        """Be told the cells' fields, (ni, nj) each, and the step to come over the stable one."""
        self.weight.take_fields(fields)
        self.step_fraction = float(step_fraction)

    def distribute_sides(self, previous: np.ndarray, boundary: np.ndarray) -> np.ndarray:
        """`boundary`, with the nodes of free sides placed if it owns them."""
        if not self.owns_sides:
            return boundary
        most = np.inf if self.step_fraction is None else SIDE_MOTION * self.step_fraction
        return distribute_on_sides(boundary, self.weight, previous, self.free_sides, most)


def equidistribute_sides(nodes: np.ndarray, weight) -> np.ndarray:
    """A copy of `nodes` (2, ni+1, nj+1), the sides' nodes along their polylines with w ds constant.

    weight: see `regrid.equidistribution.weights`.  The block's corners stay; inner nodes are copied
    as they are.
    """
    weight = weight if isinstance(weight, Weight) else Weight(weight)
    return distribute_on_sides(nodes, weight, nodes)


def distribute_on_sides(
    boundary: np.ndarray,
    weight: Weight,
    previous: np.ndarray,
    sides: tuple[str, ...] = SIDE_NAMES,
    most: float = np.inf,
) -> np.ndarray:
    """A copy of `boundary` with w ds constant on some of its sides, by theory R10.9.

    A weight of position is taken on the polylines of `boundary`; any other is that of the cells
    beside, travels with them, and is known on the grid `previous`.  Nodes go no further than
    `most` (< 0.5) of the shorter step beside them from the place that they have, in parts of the
    side, in `previous`.
    """
    distributed = np.array(boundary, dtype=np.float64, order="C")
    cells = None if weight.by_position else weight.on(previous, boundary)(previous)
    for name, side, beside in zip(SIDE_NAMES, SIDES, BESIDE, strict=True):
        if name not in sides:
            continue
        line = np.ascontiguousarray(boundary[side])
        law = arc_law(line)
        if cells is None:

            def weight_at(s, line=line, law=law):
                return weight.at_points(np.interp(s, law, line[0]), np.interp(s, law, line[1]))

            wanted = solve_ed1(weight_at, line.shape[1])
        else:
            wanted = np.concatenate([[0.0], np.cumsum(1.0 / cells[beside])])
            wanted /= wanted[-1]
        if np.isfinite(most):
            here = arc_law(np.ascontiguousarray(previous[side]))
            steps = np.diff(here)
            reach = most * np.minimum(steps[1:], steps[:-1])
            wanted[1:-1] = here[1:-1] + np.clip(wanted[1:-1] - here[1:-1], -reach, reach)
        inner = np.array([np.interp(wanted, law, part) for part in line])
        distributed[side][:, 1:-1] = inner[:, 1:-1]
    return distributed
