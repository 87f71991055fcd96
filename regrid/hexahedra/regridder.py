"""The barrier regridder for blocks of hexahedra: straight lines, and a barrier against folding.

`regrid(previous, boundary)` carries a valid grid to six new faces (theory R14).  The promise: all
eight corner tetrahedra of every hexahedron handed back have positive volume, or RegridFailure
names face and node.  The trap: this is less than a positive trilinear Jacobian everywhere in a
cell; `regrid.measure.hexahedra` measures both.
"""

from __future__ import annotations

import numpy as np

from regrid.errors import BadInput
from regrid.hexahedra.corner_rows import LONGEST
from regrid.hexahedra.explain import explain_failure
from regrid.hexahedra.face_laws import compute_family_weights, compute_volume
from regrid.hexahedra.given_grids import check_grids_in_space
from regrid.hexahedra.move import HexahedraMove, HexahedraOptions, Workspace
from regrid.report import RegridResult

EVEN = 1e-6  # families whose weights differ by less are told apart by the numbers of cells


class BarrierRegridder3D:
    """Straight lines where they fit, a barrier against folding everywhere, in space.

    `epsilon` weighs the barrier; `edge_lengths` is "conditional" or "unit"; `family` "auto", "i",
    "j", "k" or the three weights of the straight lines; `area_weight` is lam of theory R14.1;
    `strengthening` is how many times epsilon goes up in sharp cells at most; `tolerance`, `floor`
    (in cells) and `max_iterations` end the linear solve; `newton_steps` is the least number of
    Newton steps a call.
    """

    def __init__(
        self,
        epsilon: float = 1e-3,
        edge_lengths: str = "conditional",
        family="auto",
        area_weight: float = 1.0,
        strengthening: float = 30.0,
        tolerance: float = 0.05,
        floor: float = 1e-3,
        max_iterations: int = 16,
        newton_steps: int = 1,
    ):
        if edge_lengths not in ("conditional", "unit"):
            raise BadInput(
                f"barrier regridder: edge_lengths '{edge_lengths}' is neither 'conditional' "
                "nor 'unit'"
            )
        for name, value, least in (
            ("epsilon", epsilon, 0.0),
            ("area_weight", area_weight, -1e-300),
            ("strengthening", strengthening, 1.0 - 1e-15),
        ):
            if not least < value < np.inf:
                raise BadInput(
                    f"barrier regridder: {name} {value} must be finite and "
                    + ("1 or more" if name == "strengthening" else "positive")
                )
        self.options = HexahedraOptions(
            epsilon=float(epsilon),
            area_weight=float(area_weight),
            strengthening=float(strengthening),
            conditional=edge_lengths == "conditional",
            tolerance=float(tolerance),
            floor=float(floor),
            max_iterations=int(max_iterations),
            newton_steps=int(newton_steps),
        )
        self.family = _family_weights(family)
        self._workspaces: dict[tuple[int, ...], Workspace] = {}

    def regrid(self, previous: np.ndarray, boundary: np.ndarray) -> RegridResult:
        """The grid inside the six faces of `boundary`, near `previous`; both in m.

        Shapes (3, ni+1, nj+1, nk+1); of `boundary` the faces alone are read.  Raises BadInput for
        arrays that do not fit, RegridFailure, naming face and node, where there is no valid grid
        or none is found.
        """
        previous, boundary = check_grids_in_space(previous, boundary)
        weights = compute_family_weights(boundary) if self.family is None else self.family
        order = _order_axes(weights, previous.shape[1:])
        axes = (0, *(axis + 1 for axis in order))
        odd = order in ((0, 2, 1), (1, 0, 2), (2, 1, 0))
        mirrored = (compute_volume(previous) < 0.0) != odd
        old, faces = (
            np.ascontiguousarray(nodes.transpose(axes)[:: -1 if mirrored else 1])
            for nodes in (previous, boundary)
        )
        if faces.shape[3] - 1 > LONGEST:
            raise BadInput(f"regrid: a block in space has at most {LONGEST} cells a direction")
        cells = tuple(n - 1 for n in faces.shape[1:])
        if cells not in self._workspaces:
            self._workspaces[cells] = Workspace(cells)
        ordered = np.array([weights[axis] for axis in order])
        move = HexahedraMove(self.options, old, faces, ordered, self._workspaces[cells])
        if not (compute_volume(faces) > 0.0 and move.run()):
            raise explain_failure(faces, move.trial, order)
        back = (0, *(int(axis) + 1 for axis in np.argsort(order)))
        nodes = move.trial[:: -1 if mirrored else 1].transpose(back)
        return RegridResult(nodes.copy(order="C"), move.report())


def _order_axes(weights, shape: tuple[int, ...]) -> tuple[int, int, int]:
    """The indices by falling weight of their family; at a tie by rising number of nodes.

    A tie must not hang on rounding: long rows run fast, so they come last.
    """
    steps = np.round(np.asarray(weights) / EVEN)
    order = sorted(range(3), key=lambda axis: (-steps[axis], shape[axis], axis))
    first = order[0]
    second, third = sorted(order[1:], key=lambda axis: (shape[axis], axis))
    return first, second, third


def _family_weights(family) -> np.ndarray | None:
    if isinstance(family, str) and family == "auto":
        return None
    if isinstance(family, str) and family in ("i", "j", "k"):
        return np.array([float(family == name) for name in "ijk"])
    try:
        weights = np.array([float(k) for k in family])
    except (TypeError, ValueError):
        weights = np.zeros(0)
    if weights.size != 3 or not (weights >= 0.0).all() or not 0.0 < weights.sum() < np.inf:
        raise BadInput(
            f"barrier regridder: family {family!r} must be 'auto', 'i', 'j', 'k' or three "
            "weights >= 0"
        )
    return weights / weights.sum()
