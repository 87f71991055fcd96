"""Laws of strength by kind: shear modulus and flow stress.  A new one is a file and a line here.

May import: `regrid`.
"""

from collections import ChainMap

from shockgrid.hydro.strength.laws.base import StrengthLaw
from shockgrid.hydro.strength.laws.johnson_cook import JohnsonCook
from shockgrid.hydro.strength.laws.linear_hardening import LinearHardening
from shockgrid.hydro.strength.laws.perfect import Perfect
from shockgrid.hydro.strength.laws.steinberg_cochran_guinan import SteinbergCochranGuinan
from shockgrid.hydro.strength.laws.zerilli_armstrong import ZerilliArmstrongBCC, ZerilliArmstrongFCC
from shockgrid.regrid.plug_ins import PlugIns

OWN: dict[str, type[StrengthLaw]] = {
    law.kind: law
    for law in (
        Perfect,
        LinearHardening,
        JohnsonCook,
        SteinbergCochranGuinan,
        ZerilliArmstrongFCC,
        ZerilliArmstrongBCC,
    )
}
STRENGTH_LAWS: ChainMap[str, type[StrengthLaw]] = ChainMap(OWN, PlugIns("shockgrid.strength"))  # type: ignore

__all__ = [
    "STRENGTH_LAWS",
    "JohnsonCook",
    "LinearHardening",
    "Perfect",
    "SteinbergCochranGuinan",
    "StrengthLaw",
    "ZerilliArmstrongBCC",
    "ZerilliArmstrongFCC",
]
