"""Formulas of an equation of state that disagree are refused before the first step."""

from dataclasses import dataclass

import h5py
import numpy as np
import pytest

from builders import box
from hydro.block import Block
from hydro.eos import IdealGas, StiffenedGas, Tabular
from hydro.eos.base import MOST_MISS, MOST_SLOPE, find_disagreement
from hydro.eos.materials import LIBRARY, read_materials
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


def test_one_cell_of_many_is_enough():
    p = np.full((300, 300), 1e5)
    p[211, 97] = 3e9
    eos = StiffenedGas(4.4, 6e8)

    @inlined
    def square(rho, p, parameters):
        return parameters[0] * (p + parameters[1]) / rho * (1.0 + 1.0 * (p > 2e9))

    wrong = type("Wrong", (StiffenedGas,), {"sound_speed_squared_part": staticmethod(square)})
    nodes = box((0, 0), (1, 1), (300, 300))
    Block("water", eos, nodes, 1000.0, 0.0, 0.0, p)
    with pytest.raises(BadInput, match=r"p = 3e\+09 c² is"):
        Block("water", wrong(4.4, 6e8), nodes, 1000.0, 0.0, 0.0, p)


@pytest.mark.parametrize("name", read_materials(LIBRARY))
def test_materials_pass_with_margin(name, monkeypatch):
    monkeypatch.setattr("hydro.eos.base.MOST_MISS", 1e-4 * MOST_MISS)
    monkeypatch.setattr("hydro.eos.base.MOST_SLOPE", 1e-2 * MOST_SLOPE)
    material = read_materials(LIBRARY)[name]
    pressures = [-1e7, 0.0, 1e5, 1e8, 1e10, 5e10]
    pairs = np.meshgrid(material.rho0 * np.linspace(0.3, 1.6, 27), pressures)
    rho, p = (field.ravel() for field in pairs)
    with np.errstate(all="ignore"):
        good = material.eos.sound_speed(rho, p) > 0.0
        assert good.sum() > 20
        assert find_disagreement(material.eos, rho[good], p[good]) is None


def test_a_table_passes_at_its_points_and_edges(tmp_path):
    rho, e = np.geomspace(0.05, 8.0, 12), np.geomspace(0.2, 20.0, 9)  # coarse: slopes jump
    with h5py.File(tmp_path / "table.h5", "w") as file:
        file["rho"], file["e"], file["p"] = rho, e, 0.4 * rho[:, None] ** 1.5 * e
    table = Tabular(str(tmp_path / "table.h5"))
    for k in ((5, 4), (5, -1), (0, 4), (-1, 4)):
        at = np.array([rho[k[0]]]), np.array([e[k[1]]])
        assert find_disagreement(table, at[0], table.pressure(*at)) is None
