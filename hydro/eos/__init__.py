"""Equations of state by kind: a new one is one file and one line here.

May import: `regrid`, `hydro.formulas`.
"""

from collections import ChainMap

from shockgrid.hydro.eos.base import EquationOfState
from shockgrid.hydro.eos.gases import IdealGas, StiffenedGas
from shockgrid.hydro.eos.jwl import JWL
from shockgrid.hydro.eos.mie_gruneisen import MieGruneisen
from shockgrid.hydro.eos.phase_transition import PhaseTransition
from shockgrid.hydro.eos.tabular import Tabular
from shockgrid.regrid.plug_ins import PlugIns

OWN: dict[str, type[EquationOfState]] = {
    eos.kind: eos for eos in (IdealGas, StiffenedGas, MieGruneisen, JWL, PhaseTransition, Tabular)
}
EQUATIONS_OF_STATE: ChainMap[str, type[EquationOfState]] = ChainMap(OWN, PlugIns("shockgrid.eos"))  # type: ignore

__all__ = [
    "EQUATIONS_OF_STATE",
    "JWL",
    "EquationOfState",
    "IdealGas",
    "MieGruneisen",
    "PhaseTransition",
    "StiffenedGas",
    "Tabular",
]
