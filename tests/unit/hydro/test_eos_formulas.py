"""Formulas of an equation of state that disagree are refused before the first step."""

from dataclasses import dataclass

import pytest

from builders import box
from hydro.block import Block
from hydro.eos import IdealGas
from regrid.errors import BadInput
from regrid.jit import inlined

STIFFNESS, EXPONENT = 3e8, 7.0


@inlined
def tait_pressure(rho, e, parameters):
    return STIFFNESS * ((rho / 1000.0) ** EXPONENT - 1.0) + 0.0 * e


@inlined
def tait_energy(rho, p, parameters):
    return (p + STIFFNESS) / rho


@inlined
def tait_square(rho, p, parameters):
    return EXPONENT * STIFFNESS * (rho / 1000.0) ** EXPONENT / rho


@inlined
def tenfold_square(rho, p, parameters):
    return 10.0 * parameters[0] * p / rho


@inlined
def other_energy(rho, p, parameters):
    return p / (0.39 * rho)


@dataclass(frozen=True)
class Tait(IdealGas):
    pressure_part = staticmethod(tait_pressure)
    energy_part = staticmethod(tait_energy)
    sound_speed_squared_part = staticmethod(tait_square)


@dataclass(frozen=True)
class TenfoldSquare(IdealGas):
    sound_speed_squared_part = staticmethod(tenfold_square)


@dataclass(frozen=True)
class OtherEnergy(IdealGas):
    energy_part = staticmethod(other_energy)


@pytest.mark.parametrize(
    ("eos", "rho", "p", "words"),
    [
        (Tait(1.4), 1000.0, 0.0, r"not inverse.*p has to depend on e"),  # p is right, by chance
        (OtherEnergy(1.4), 1.2, 1e5, "energy and pressure are not inverse: at rho = 1.2, p = 1000"),
        (TenfoldSquare(1.4), 1.2, 1e5, r"not the slope of the isentrope.*1.16667e\+06"),
    ],
)
def test_a_block_refuses_formulas_that_disagree(eos, rho, p, words):
    with pytest.raises(BadInput, match=f"block 'gas': equation of state ideal-gas: .*{words}"):
        Block("gas", eos, box((0, 0), (1, 1), (300, 300)), rho, 0.0, 0.0, p)
