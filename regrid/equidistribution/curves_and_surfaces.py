"""EDC and EDS: nodes along curves and over surfaces with weight times length, or area, constant.

EDC, a curve f(p) in the plane or in space:    ∂(w |f'(p)| ∂p/∂q)/∂q = 0          theory R10.7
EDS, a surface f(p1, p2):  ∂1(W g~22 ∂1 p) + ∂2(W g~11 ∂2 p) = 0,  W = w J/J~     theory R10.8

g~ and J~ are those of p(q), J is the area of a surface cell.  Both act on the parameters, so the
nodes stay on the curve or surface.  EDC is solved as w times chord, by Newton's method;
EDS is ED2 in the plane of the parameters, with W in place of w, and inherits its traps.

The trap: the print has W = w sqrt(g22 g33)/J~, which is J for grids with perpendicular lines only.
With the area itself a plane with Cartesian parameters has W = w on every grid: EDS is ED2 there,
term by term, as the paper says.

Source: [KhakimzyanovShokina1998] §4, §5.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from regrid.curves.spacing_laws import equalise_products, equidistribute
from regrid.equidistribution.areas import Equidistributed, iterate_ed2, weigh_points
from regrid.errors import BadInput
from regrid.measure.centres import compute_centres
from regrid.sides import SIDES


def solve_edc(
    curve: Callable[[np.ndarray], np.ndarray],
    weight,
    count: int,
    start: float = 0.0,
    end: float = 1.0,
) -> np.ndarray:
    """Parameters p (count,) with `w |x[j+1] - x[j]|` equal on all steps (theory R10.7).

    curve: p (n,) to points (2, n) or (3, n); weight: a positive number or a function of the
    coordinates, taken at the curve's points in the middle of the steps of p.  Raises RegridFailure
    where no such nodes are found.
    """
    if count < 2:
        raise BadInput(f"equidistribution: a curve needs at least 2 nodes, got {count}")

    def weigh(left, right):
        chord = np.sqrt(((curve(right) - curve(left)) ** 2).sum(axis=0))
        return weigh_points(weight, curve(0.5 * (left + right))) * chord / np.abs(right - left)

    fine = np.linspace(start, end, 20 * count + 1)
    return equalise_products(weigh, equidistribute(fine, weigh(fine[:-1], fine[1:]), count))


def compute_surface_areas(points: np.ndarray) -> np.ndarray:
    """Areas (ni, nj) of surface cells by their mid-lines; points (3, ni+1, nj+1)."""
    up, down = points[:, 1:, 1:] - points[:, :-1, :-1], points[:, 1:, :-1] - points[:, :-1, 1:]
    along, across = 0.5 * (up + down), 0.5 * (up - down)
    normal = np.cross(along, across, axis=0)
    return np.sqrt((normal**2).sum(axis=0))


def compute_parameter_areas(parameters: np.ndarray) -> np.ndarray:
    """Signed areas J~ (ni, nj) of the cells in the plane of the parameters (2, ni+1, nj+1)."""
    up = parameters[:, 1:, 1:] - parameters[:, :-1, :-1]
    down = parameters[:, 1:, :-1] - parameters[:, :-1, 1:]
    return 0.5 * (up[1] * down[0] - up[0] * down[1])


def weigh_surface(surface, weight, parameters: np.ndarray) -> np.ndarray:
    """W = w J/J~ at the cells (ni, nj): the weight of ED2 in the plane of the parameters.

    The weight is taken at the mean of a cell's four nodes in space.
    """
    points = surface(parameters)
    flat = np.abs(compute_parameter_areas(parameters))
    ratio = compute_surface_areas(points) / np.maximum(flat, 1e-12 * flat.mean())
    # A cell that has collapsed on the surface still needs a positive coefficient.
    return weigh_points(weight, compute_centres(points)) * np.maximum(ratio, 1e-12 * ratio.mean())


def solve_eds(
    surface: Callable[[np.ndarray], np.ndarray],
    parameters: np.ndarray,
    weight=1.0,
    iterations: int = 200,
    tolerance: float = 1e-10,
) -> Equidistributed:
    """Parameters of a grid on `surface` with weight times cell area constant.

    surface: p (2, ...) to points (3, ...); parameters (2, ni+1, nj+1): the first grid, whose sides
    stay; weight: a positive number or a function of x, y, z.  The result's nodes are parameters,
    its spreads those of w times area on the surface.
    """
    return iterate_ed2(
        parameters,
        lambda grid: weigh_surface(surface, weight, grid),
        iterations,
        tolerance,
    )


def equidistribute_edges(
    surface: Callable[[np.ndarray], np.ndarray], parameters: np.ndarray, weight=1.0
) -> np.ndarray:
    """A copy of `parameters` (2, ni+1, nj+1) with the nodes of its four sides placed by EDC.

    A side is the straight line between its two corners in the plane of the parameters.
    """
    distributed = np.array(parameters, dtype=np.float64, order="C")
    for side in SIDES:
        line = distributed[side]
        first, last = line[:, :1].copy(), line[:, -1:].copy()
        law = solve_edc(
            lambda s, a=first, b=last: surface(a + np.asarray(s) * (b - a)), weight, line.shape[1]
        )
        distributed[side][:, 1:-1] = (first + law * (last - first))[:, 1:-1]
    return distributed
