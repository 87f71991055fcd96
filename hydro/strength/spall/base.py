"""What a law of spall offers: fields that cells carry, and the tension that they still bear.

After each step a law gets the cells as they would be whole, advances its fields, and gives their
pressures.  Where that is above the pressure of whole material, voids hold the difference: energy is
kept, and the material bears no shear (theory F4.10).  Broken material bears neither tension nor
shear, also where it is pressed together.  Theory F21.

Note: the tension of the equation of state, its `strength`, acts first; it has to be above that of
the law.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

import numpy as np

from shockgrid.hydro.carried.fields import CarriedField
from shockgrid.hydro.strength.laws.base import check_parameters

NO_EQUIVALENT_STRESS = 1e-300  # [Pa]: keeps 0/0 of a cell without stress from being a NaN


class SolidCells(NamedTuple):
    """Cells after a step, arrays of one shape: density [kg/m³]; pressure [Pa] that whole material
    would have; energy e [J/kg]; sound speed [m/s]; stress (s_xx, s_yy, s_xy) [Pa]; increase of the
    plastic strain and strain rate [1/s] in the step; temperature [K] or None; shorter extent [m].
    """

    eos: Any
    density: np.ndarray
    pressure: np.ndarray
    energy: np.ndarray
    sound: np.ndarray
    stress: np.ndarray
    strained: np.ndarray
    strain_rate: np.ndarray
    temperature: np.ndarray | None
    extent: np.ndarray


def compute_equivalent_stress(stress: np.ndarray) -> np.ndarray:
    """(3/2 s:s)^(1/2) [Pa] of deviators (3, ...)."""
    s_xx, s_yy, s_xy = stress
    return np.sqrt(3.0 * (s_xx * s_xx + s_yy * s_yy + s_xx * s_yy + s_xy * s_xy))


def compute_greatest_tension(cells: SolidCells) -> np.ndarray:
    """The greatest principal stress [Pa], tension positive, in the plane or across it."""
    s_xx, s_yy, s_xy = cells.stress
    middle = 0.5 * (s_xx + s_yy)
    radius = np.sqrt(0.25 * (s_xx - s_yy) ** 2 + s_xy * s_xy)
    return np.maximum(middle + radius, -(s_xx + s_yy)) - cells.pressure


@dataclass(frozen=True)
class SpallLaw:
    """How a solid opens under tension.

    Class attributes: `kind`, its name in decks; `positive`, parameters that must be greater than 0;
    `not_negative`, 0 or more;
    `keys`, names of parameters in decks where they differ from the fields'; `fields`, what cells
    carry; `needs_temperature`.
    """

    kind: ClassVar[str]
    positive: ClassVar[tuple[str, ...]] = ()
    not_negative: ClassVar[tuple[str, ...]] = ()
    fields: ClassVar[tuple[CarriedField, ...]] = ()
    keys: ClassVar[Mapping[str, str]] = MappingProxyType({})
    needs_temperature: ClassVar[bool] = False

    def __post_init__(self):
        check_parameters(self, "spall")

    def relax(self, values: np.ndarray, cells: SolidCells, dt: float) -> np.ndarray:
        """Advance the fields `values` (n, ...) over `dt` [s] in place; returns pressures [Pa]."""
        raise NotImplementedError

    def find_broken(self, values: np.ndarray) -> np.ndarray:
        """Which cells are broken, of their fields (n, ...)."""
        raise NotImplementedError
