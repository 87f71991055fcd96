"""The regridders of the suite: this project's own, plain formulas, and a peer where installed.

Each entry makes a callable `regrid(previous, boundary) -> nodes` for a march (its shape, its
start).  To add one: a function and a line in REGRIDDERS.
"""

from __future__ import annotations

import importlib.metadata
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.sparse import diags_array, eye_array, kron
from scipy.sparse.linalg import splu

from regrid_suite.harness import Regrid
from regrid_suite.marches import March, interpolate_faces
from shockgrid.regrid.errors import BadInput, suggest
from shockgrid.regrid.hexahedra.regridder import BarrierRegridder3D
from shockgrid.regrid.registry import make_regridder

OURS = "this project"


@dataclass(frozen=True)
class Entry:
    """A regridder of the suite: words, whose it is, in how many dimensions, and how it is made.

    `package` is what has to be installed; `plane_only`: marches in space are left out.
    """

    about: str
    source: str
    make: Callable[[March], Regrid]
    dims: tuple[int, ...] = (2,)
    package: str | None = None

    @property
    def version(self) -> str | None:
        """Version of what it stands on; None where that is not installed."""
        try:
            return importlib.metadata.version(self.package or "shockgrid")
        except importlib.metadata.PackageNotFoundError:
            return None if self.package else "source"


class Own:
    """A regridder of `regrid.registry` as a plain callable."""

    def __init__(self, march: March, name: str, **options):
        self.regridder = make_regridder(name, **options)
        self.sees_cost = bool(getattr(self.regridder, "sees_cost", False))
        self.sub_moves = 0  # of its own, within calls

    def __call__(self, previous, boundary, *sound):
        result = self.regridder.regrid(previous, boundary, *sound)
        self.sub_moves += result.report.sub_moves
        return result.nodes


class OwnInSpace:
    """The barrier for hexahedra as a plain callable."""

    def __init__(self, march: March):
        self.regridder = BarrierRegridder3D()
        self.sees_cost = False
        self.sub_moves = 0

    def __call__(self, previous, boundary):
        result = self.regridder.regrid(previous, boundary)
        self.sub_moves += result.report.sub_moves
        return result.nodes


def make_transfinite(march: March) -> Regrid:
    """Gordon and Hall's boolean sum, uniform in the indices, as mapped grids are often written."""
    if march.dim == 3:
        return lambda previous, boundary: interpolate_faces(np.nan_to_num(boundary))

    def regrid(previous, boundary):
        ni, nj = boundary.shape[1] - 1, boundary.shape[2] - 1
        u, v = np.linspace(0.0, 1.0, ni + 1)[:, None], np.linspace(0.0, 1.0, nj + 1)
        low, high = boundary[:, :, :1], boundary[:, :, -1:]
        left, right = boundary[:, :1], boundary[:, -1:]
        corners = (1 - u) * ((1 - v) * low[:, :1] + v * high[:, :1])
        corners = corners + u * ((1 - v) * low[:, -1:] + v * high[:, -1:])
        inside = (1 - v) * low + v * high + (1 - u) * left + u * right - corners
        nodes = boundary.copy()
        nodes[:, 1:-1, 1:-1] = inside[:, 1:-1, 1:-1]
        return nodes

    return regrid


def make_laplacian(march: March) -> Regrid:
    """Every inner node is the mean of its neighbours: one sparse factorisation for all steps."""
    inner = [n - 2 for n in march.start.shape[1:]]
    matrix = None
    for axis, n in enumerate(inner):
        line = diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(n, n))
        term = None
        for other, m in enumerate(inner):
            factor = line if other == axis else eye_array(m)
            term = factor if term is None else kron(term, factor)
        matrix = term if matrix is None else matrix + term
    solve = splu(matrix.tocsc()).solve
    middle = (slice(None), *(slice(1, -1),) * len(inner))

    def regrid(previous, boundary):
        nodes = boundary.copy()
        nodes[middle] = 0.0
        right = np.zeros((march.dim, *inner))
        for axis in range(1, march.dim + 1):
            for end, beside in ((0, 0), (-1, -1)):
                side = [slice(None), *(slice(1, -1),) * march.dim]
                side[axis] = slice(0, 1) if end == 0 else slice(-1, None)
                row = [slice(None)] * (march.dim + 1)
                row[axis] = slice(0, 1) if beside == 0 else slice(-1, None)
                right[tuple(row)] += boundary[tuple(side)]
        for k in range(march.dim):
            nodes[k][middle[1:]] = solve(right[k].ravel()).reshape(inner)
        return nodes

    return regrid


def make_tmop(march: March, **options) -> Regrid:
    """MFEM's target-matrix optimiser."""
    from regrid_suite.tmop import Tmop

    return Tmop(march, **options)


def own(name: str, **options) -> Callable[[March], Regrid]:
    """A regridder of the registry with these options."""
    return partial(Own, name=name, **options)


REGRIDDERS: dict[str, Entry] = {
    "barrier": Entry("one Newton step a step (theory R4)", OURS, own("barrier")),
    "barrier-3d": Entry("the barrier for hexahedra (theory R14)", OURS, OwnInSpace, (3,)),
    "barrier-no-cost": Entry(
        "the same without the term of the time step", OURS, own("barrier", cost_weight=0.0)
    ),
    "barrier-both": Entry("both families of straight lines", OURS, own("barrier-both")),
    "barrier-sweeps": Entry("sweeps over lines (R3)", OURS, own("barrier", method="sweeps")),
    "brackbill-saltzman": Entry(
        "smoothness, volume, orthogonality (R12.2)", OURS, own("brackbill-saltzman")
    ),
    "thompson": Entry("Winslow with the sides' steps (R12.4)", OURS, own("winslow")),
    "winslow": Entry("Winslow's smooth grid (R12.3)", OURS, own("winslow", control="none")),
    "displacement": Entry(
        "the sides' motion interpolated to the inside (R6.5)", OURS, own("displacement")
    ),
    "transfinite": Entry(
        "boolean sum in the indices, as in mapped grids of Clawpack",
        "formula, numpy",
        make_transfinite,
        (2, 3),
        "numpy",
    ),
    "laplacian": Entry(
        "inner nodes are the means of their neighbours",
        "sparse solve, scipy",
        make_laplacian,
        (2, 3),
        "scipy",
    ),
    "tmop-shape": Entry(
        "MFEM TMOP, shape metrics 2 and 302, ideal target",
        "MFEM",
        partial(make_tmop, target="shape"),
        (2, 3),
        "mfem",
    ),
    "tmop-size": Entry(
        "MFEM TMOP, shape and size metrics 7 and 321, targets of the start grid",
        "MFEM",
        partial(make_tmop, target="start"),
        (2, 3),
        "mfem",
    ),
}


def choose(names: list[str]) -> dict[str, Entry]:
    """The entries called so; raises BadInput, with the nearest name, where there is none."""
    for name in names:
        if name not in REGRIDDERS:
            raise BadInput(f"regridder: none is called '{name}'{suggest(name, REGRIDDERS)}")
    return {name: REGRIDDERS[name] for name in names or REGRIDDERS}
