"""Equations of state by kind: a new one is one file and one line here."""

from hydro.eos.base import EquationOfState
from hydro.eos.ideal_gas import IdealGas
from hydro.eos.mie_gruneisen import MieGruneisen
from hydro.eos.stiffened_gas import StiffenedGas

EQUATIONS_OF_STATE: dict[str, type[EquationOfState]] = {
    "ideal-gas": IdealGas,
    "stiffened-gas": StiffenedGas,
    "mie-gruneisen": MieGruneisen,
}

__all__ = ["EQUATIONS_OF_STATE", "EquationOfState", "IdealGas", "MieGruneisen", "StiffenedGas"]
