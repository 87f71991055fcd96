"""Laws of spall by kind: how solids open under tension, and break.  A new one is a file and a line.

May import: `regrid`, `hydro.carried`, `hydro.strength.laws`.
"""

from shockgrid.hydro.strength.spall.base import SolidCells, SpallLaw
from shockgrid.hydro.strength.spall.cochran_banner import CochranBanner
from shockgrid.hydro.strength.spall.constant import ConstantSpall
from shockgrid.hydro.strength.spall.ductile_voids import DuctileVoids
from shockgrid.hydro.strength.spall.johnson_cook_damage import JohnsonCookDamage

SPALL_LAWS: dict[str, type[SpallLaw]] = {
    law.kind: law for law in (ConstantSpall, CochranBanner, DuctileVoids, JohnsonCookDamage)
}

__all__ = [
    "SPALL_LAWS",
    "CochranBanner",
    "ConstantSpall",
    "DuctileVoids",
    "JohnsonCookDamage",
    "SolidCells",
    "SpallLaw",
]
