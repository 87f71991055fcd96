"""What the four sides of a convection cell do: to the flow, and to the heat.

A side is a wall (no-slip or free) that is isothermal, adiabatic or has a given flux, or it is
periodic, together with the side opposite.  Temperatures and fluxes may be functions of the
coordinate along the wall (conducting walls, a heated strip).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from regrid.errors import BadInput

SIDES = ("i_min", "i_max", "j_min", "j_max")
PAIRS = (("i_min", "i_max"), ("j_min", "j_max"))
Along = float | Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Wall:
    """One side.

    `flow`: "no-slip", "free" (no shear stress) or "periodic".  `temperature` [K] makes it
    isothermal; `flux` [K m/s] is the heat that enters through it over rho cp; neither: adiabatic.
    Both are numbers or functions of the coordinate along the wall.
    """

    flow: str = "no-slip"
    temperature: Along | None = None
    flux: Along | None = None

    def sample(self, along: np.ndarray) -> tuple[np.ndarray | None, np.ndarray]:
        """(temperature or None, flux) at the places `along` (n,)."""

        def values(given: Along) -> np.ndarray:
            found = given(along) if callable(given) else given
            return np.broadcast_to(np.asarray(found, dtype=np.float64), along.shape)

        if self.temperature is not None:
            return values(self.temperature), np.zeros_like(along)
        return None, values(0.0 if self.flux is None else self.flux)


def isothermal(temperature: Along, flow: str = "no-slip") -> Wall:
    """A wall of given temperature."""
    return Wall(flow, temperature=temperature)


def adiabatic(flow: str = "no-slip") -> Wall:
    """A wall that no heat passes."""
    return Wall(flow)


def heated(flux: Along, flow: str = "no-slip") -> Wall:
    """A wall through which heat of given flux enters."""
    return Wall(flow, flux=flux)


PERIODIC = Wall("periodic")


def check_walls(walls: Mapping[str, Wall]) -> None:
    """Raise BadInput for walls that are missing, unknown, or contradict each other."""
    if set(walls) != set(SIDES):
        wrong = sorted(set(walls) ^ set(SIDES))
        raise BadInput(f"a convection cell has the sides {', '.join(SIDES)}; look at {wrong[0]!r}")
    for side in SIDES:
        wall = walls[side]
        if wall.flow not in ("no-slip", "free", "periodic"):
            raise BadInput(
                f"side {side}: flow {wall.flow!r} is not known; no-slip, free, periodic are"
            )
        if wall.temperature is not None and wall.flux is not None:
            raise BadInput(
                f"side {side} has both a temperature and a flux, which contradict; give one"
            )
        if wall.flow == "periodic" and (wall.temperature is not None or wall.flux is not None):
            raise BadInput(f"side {side} is periodic and so has no temperature or flux of its own")
    for low, high in PAIRS:
        if (walls[low].flow == "periodic") != (walls[high].flow == "periodic"):
            lonely = low if walls[low].flow == "periodic" else high
            other = high if lonely == low else low
            raise BadInput(
                f"side {lonely} is periodic but {other} is a wall; they must both be periodic"
            )
    if all(wall.flow == "periodic" for wall in walls.values()):
        raise BadInput("a convection cell cannot be periodic both ways; give it two walls")


def fixes_temperature(walls: Mapping[str, Wall]) -> bool:
    """Whether any side is isothermal."""
    return any(wall.temperature is not None for wall in walls.values())
