"""Laws of strength by kind: shear modulus and flow stress.  A new one is a file and a line here.

May import: `regrid`.
"""

from hydro.strength.laws.base import StrengthLaw
from hydro.strength.laws.perfect import Perfect

STRENGTH_LAWS: dict[str, type[StrengthLaw]] = {law.kind: law for law in (Perfect,)}

__all__ = ["STRENGTH_LAWS", "Perfect", "StrengthLaw"]
