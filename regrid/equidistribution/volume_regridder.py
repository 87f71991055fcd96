"""The ED3 grid as a regridder: weight times cell volume constant, inside six moving faces.

The trap is that of the plane one: a weight of position makes another grid in the first step.  The
default "sides" is the density of nodes that the faces ask for (theory R10.10, with three lengths).

Source: [KhakimzyanovShokina1998] §3; theory R10.5.
"""

from __future__ import annotations

import numpy as np

from regrid.equidistribution.volumes import interpolate_faces, is_valid, solve_ed3
from regrid.errors import BadInput, RegridFailure
from regrid.hexahedra.carrying import carry_faces, copy_faces
from regrid.hexahedra.face_laws import compute_face_density, compute_volume
from regrid.hexahedra.given_grids import check_grids_in_space
from regrid.measure.hexahedra import compute_corner_ratio
from regrid.report import RegridReport, RegridResult


class EquidistributionRegridder3D:
    """`weight`: "sides", a positive number, cells' values (ni, nj, nk), or a function of x, y, z.

    `iterations` and `tolerance` (of the residual over the fluxes) end the iteration.
    """

    def __init__(self, weight="sides", iterations: int = 40, tolerance: float = 1e-8):
        if isinstance(weight, str) and weight != "sides":
            raise BadInput(
                f"equidistribution: weight '{weight}' in space must be 'sides', a number, an "
                "array of the cells or a function of x, y, z"
            )
        self.weight = weight
        self.iterations, self.tolerance = int(iterations), float(tolerance)

    def regrid(self, previous: np.ndarray, boundary: np.ndarray) -> RegridResult:
        """Grid inside the six faces of `boundary`; both (3, ni+1, nj+1, nk+1) in m.

        Raises BadInput for arrays that do not fit, RegridFailure, naming cells, where no iterate
        has positive corners.
        """
        previous, boundary = check_grids_in_space(previous, boundary)
        sign = 1.0 if compute_volume(previous) >= 0.0 else -1.0
        nodes, start = np.empty_like(previous), "displacement"
        carry_faces(previous, boundary, nodes)
        if not is_valid(nodes, sign):
            copy_faces(boundary, nodes)
            nodes, start = interpolate_faces(nodes), "transfinite"
        if min(nodes.shape[1:]) < 3:
            if not is_valid(nodes, sign):
                raise RegridFailure("the faces of a block one cell wide fold it")
            return RegridResult(nodes, self._report(0, 0.0, previous, nodes, start))
        weight = self.weight
        if isinstance(weight, str):
            weight = compute_face_density(boundary if sign > 0.0 else boundary[::-1])
        found = solve_ed3(nodes, weight, self.iterations, self.tolerance)
        done = found.residuals.size - 1
        residual = float(found.residuals[found.best])
        return RegridResult(found.nodes, self._report(done, residual, previous, found.nodes, start))

    @staticmethod
    def _report(done: int, residual: float, previous, nodes, start: str) -> RegridReport:
        inner = int(np.prod([n - 2 for n in nodes.shape[1:]]))
        return RegridReport(
            iterations=done,
            node_iterations=done * inner,
            sub_moves=0,
            rescues=0,
            least_corner_ratio=compute_corner_ratio(nodes, previous),
            residual=residual,
            start=start,
        )
