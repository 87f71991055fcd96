"""Equations of state by kind: a new one is one file and one line here.

May import: `regrid`, `hydro.formulas`.
"""

from hydro.eos.base import EquationOfState
from hydro.eos.ideal_gas import IdealGas
from hydro.eos.jwl import JWL
from hydro.eos.mie_gruneisen import MieGruneisen
from hydro.eos.phase_transition import PhaseTransition
from hydro.eos.stiffened_gas import StiffenedGas
from hydro.eos.tabular import Tabular

EQUATIONS_OF_STATE: dict[str, type[EquationOfState]] = {
    "ideal-gas": IdealGas,
    "stiffened-gas": StiffenedGas,
    "mie-gruneisen": MieGruneisen,
    "jwl": JWL,
    "phase-transition": PhaseTransition,
    "tabular": Tabular,
}

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
