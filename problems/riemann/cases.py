"""Named Riemann problems: two states, where the contact starts, how long to march.

The gas dynamics cases are those of Toro's book, the others come from this project's own tables of
exact solutions.  A case gives nothing but states and lengths; its exact solution is computed.
"""

from __future__ import annotations

from dataclasses import dataclass

from hydro.eos import EquationOfState, IdealGas, StiffenedGas
from hydro.eos.materials import find_material
from hydro.formulas.reconstruction import DEFAULT_LIMITER


@dataclass(frozen=True)
class Case:
    """States (rho, u, p) left and right with their materials.

    `lengths` of the two sides [m], None: by the waves; `t_end` [s], None: when the faster wave is
    0.8 of the way to its end of the domain.  `grading`: growth of cells off a contact on a line;
    small cells there keep the error that the start leaves at the contact out of narrow plateaus.
    Gradings and limiters are chosen for 200 cells; without them the 123 problem is 2.2 % off, Toro
    3 0.12 %.
    """

    left_eos: EquationOfState
    left: tuple[float, float, float]
    right_eos: EquationOfState
    right: tuple[float, float, float]
    lengths: tuple[float, float] | None = (0.5, 0.5)
    t_end: float | None = None
    grading: float = 1.0
    limiter: str = DEFAULT_LIMITER


def _impact(flyer: str, target: str, speed: float) -> Case:
    """A flyer plate at `speed` [m/s] hits a target at rest, both without pressure."""
    one, two = find_material(flyer), find_material(target)
    return Case(
        one.eos, (one.rho0, speed, 0.0), two.eos, (two.rho0, 0.0, 0.0), lengths=(0.01, 0.01)
    )


_AIR = IdealGas(1.4)
_MONATOMIC = IdealGas(5.0 / 3.0)

CASES: dict[str, Case] = {
    "sod": Case(_AIR, (1.0, 0.0, 1.0), _AIR, (0.125, 0.0, 0.1), t_end=0.2),
    "123": Case(_AIR, (1.0, -2.0, 0.4), _AIR, (1.0, 2.0, 0.4), grading=1.036, limiter="van-leer"),
    "toro3": Case(
        _AIR,
        (1.0, 0.0, 1000.0),
        _AIR,
        (1.0, 0.0, 0.01),
        t_end=0.012,
        grading=1.016,
        limiter="minmod",
    ),
    "toro4": Case(
        _AIR, (5.99924, 19.5975, 460.894), _AIR, (5.99242, -6.19633, 46.0950), lengths=None
    ),
    "toro5": Case(_AIR, (1.0, -19.59745, 1000.0), _AIR, (1.0, -19.59745, 0.01), lengths=None),
    "leblanc": Case(
        _MONATOMIC,
        (1.0, 0.0, 0.2 / 3.0),
        _MONATOMIC,
        (1e-3, 0.0, 2e-10 / 3.0),
        lengths=(3.0, 6.0),
        t_end=6.0,
        grading=1.03,
    ),
    "two-gammas": Case(_AIR, (1.0, 0.0, 1e5), IdealGas(1.2), (0.125, 0.0, 1e4)),
    "water-gas": Case(
        StiffenedGas(4.4, 6e8),
        (1000.0, 0.0, 1e9),
        _AIR,
        (50.0, 0.0, 1e5),
        lengths=(0.8, 0.2),
        grading=1.015,
    ),
    "triple-bottom": Case(IdealGas(1.5), (1.0, 0.0, 1.0), _AIR, (1.0, 0.0, 0.1), grading=1.015),
    "triple-top": Case(IdealGas(1.5), (1.0, 0.0, 1.0), IdealGas(1.5), (0.125, 0.0, 0.1)),
    "al-ss304": _impact("Al1100", "SS304", 2000.0),
    "al-ss304-4": _impact("Al1100", "SS304", 4000.0),
    "al-al": _impact("Al1100", "Al1100", 2000.0),
    "al-pb": _impact("Al1100", "Pb", 2000.0),
    "ss304-pb": _impact("SS304", "Pb", 2000.0),
}
