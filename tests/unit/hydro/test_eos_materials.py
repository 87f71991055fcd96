"""Materials and tables from files."""

import re

import h5py
import numpy as np
import pytest

from builders import SIDES, box, march, wall_off
from shockgrid.hydro.block import Block
from shockgrid.hydro.eos import IdealGas, Tabular
from shockgrid.hydro.eos.materials import LIBRARY, find_material, find_name, read_materials
from shockgrid.hydro.simulation import Simulation
from shockgrid.regrid.errors import BadInput

# initials and a name, and after them a year in brackets or the like
SOURCE = re.compile(r"[A-Z]\. (?:[A-Z]\. )*[A-Z][a-z]+\b.*\b(?:19|20)\d\d\b", re.DOTALL)
VAGUE = re.compile(r"second-hand|memory|usual choice|public tables")

GOOD = """
[Ti]
eos = "mie-gruneisen"
source = "a report"
rho0 = 4528
c0 = 5220.0
s = 0.767
gruneisen = 1.09
strength = 3.0e9
"""


@pytest.fixture
def write(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def make(text):
        (tmp_path / "mine.toml").write_text(text)
        return "mine.toml:Ti"

    return make


def test_every_material_says_where_its_numbers_come_from():
    for name, material in read_materials(LIBRARY).items():
        assert SOURCE.search(material.source), f"{name}: no author with a year in its source"
        assert not VAGUE.search(material.source), name
        assert material.eos.sound_speed(material.rho0, 1e5) > 0.0, name


def test_a_material_of_one_s_own(write):
    material = find_material(write(GOOD))
    assert (material.rho0, material.eos.c0, material.source) == (4528.0, 5220.0, "a report")


@pytest.mark.parametrize(
    ("name", "listed"),
    [
        ("copper", "Cu"), ("cu", "Cu"), ("Steel", "SS304"), ("aluminum", "Al1100"),
        ("aluminium", "Al1100"), ("WATER", "water"), ("tnt", "TNT"), ("w", "W"), ("iron", "Fe"),
    ],
)  # fmt: skip
def test_other_names_are_those_of_one_material(name, listed):
    assert find_name(name) == listed
    assert find_material(name) == find_material(listed)
    every = [
        one.lower()
        for name, material in read_materials(LIBRARY).items()
        for one in {name.lower(), *map(str.lower, material.names)}
    ]
    assert len(every) == len(set(every)), "a name of two materials is none"


def test_a_name_of_two_materials_is_refused(write):
    two = GOOD + GOOD.replace("[Ti]", "[VT6]")
    file = write(two.replace("eos =", 'names = ["alloy"]\neos =')).rpartition(":")[0]
    with pytest.raises(BadInput, match="there is no material"):
        find_material(f"{file}:alloy")
    assert find_material(f"{file}:vt6").names == ("alloy",)


@pytest.mark.parametrize(
    "old, new, words",
    [
        ('"mie-gruneisen"', '"mie-grueneisen"', "did you mean 'mie-gruneisen'"),
        ('source = "a report"', "", "say where its numbers come from"),
        ("c0 = 5220.0", "c1 = 5220.0", "has no parameter 'c1' .it has: rho0, c0"),
        ("c0 = 5220.0", "", "c0 is missing"),
        ("c0 = 5220.0", 'c0 = "5 km/s"', "it must be a number in SI units"),
        ("c0 = 5220.0", "c0 = -1", "c0 is -1"),
        ("c0 = 5220.0", "c0 = ", "cannot be read"),
        ("c0 = 5220.0", "c0 = 5220.0\nnames = 3", "must be a list of names"),
        ("[Ti]", "[V]", "there is no material 'mine.toml:Ti'"),
    ],
)
def test_mistakes_are_named(write, old, new, words):
    name = write(GOOD.replace(old, new))
    with pytest.raises(BadInput, match=words):
        find_material(name)


@pytest.fixture
def write_of_tabular(tmp_path):
    def make(rho=None, e=None, p=None):
        rho = np.geomspace(0.05, 8.0, 40) if rho is None else np.asarray(rho, float)
        e = np.geomspace(0.2, 20.0, 50) if e is None else np.asarray(e, float)
        path = tmp_path / "table.h5"
        with h5py.File(path, "w") as file:
            file["rho"] = rho
            file["e"] = e
            file["p"] = 0.4 * rho[:, None] * e if p is None else p
        return str(path)

    return make


def test_a_table_of_an_ideal_gas_is_that_gas(write_of_tabular):
    table = Tabular(write_of_tabular())
    gas = IdealGas(1.4)
    rho, e = np.meshgrid([0.06, 0.9, 5.1], [0.3, 2.5, 11.0])
    p = gas.pressure(rho, e)
    assert table.pressure(rho, e) == pytest.approx(p, rel=1e-13)
    assert table.energy(rho, p) == pytest.approx(e, rel=1e-13)
    assert table.sound_speed(rho, p) == pytest.approx(gas.sound_speed(rho, p), rel=1e-12)


def test_energy_inverts_pressure_and_sound_is_the_surface_s_slope(write_of_tabular):
    rho = np.linspace(1.0, 3.0, 9)
    e = np.linspace(0.0, 4.0, 11)
    table = Tabular(write_of_tabular(rho, e, rho[:, None] ** 2 + np.sinh(e) * rho[:, None]))
    random = np.random.default_rng(7)
    for r, q in random.uniform([1.01, 0.01], [2.99, 3.99], (50, 2)):
        p = float(table.pressure(r, q))
        assert float(table.energy(r, p)) == pytest.approx(q, abs=1e-13)
        step = 1e-6
        by_rho = float(table.pressure(r + step, q) - table.pressure(r - step, q)) / (2 * step)
        by_e = float(table.pressure(r, q + step) - table.pressure(r, q - step)) / (2 * step)
        if min(abs(rho - r)) > 2 * step and min(abs(e - q)) > 2 * step:
            c2 = float(table.sound_speed(r, p)) ** 2
            assert c2 == pytest.approx(by_rho + p / r**2 * by_e, rel=1e-7)


def run_tube(eos):
    nodes = box((0, 0), (1, 0.1), (40, 4))
    left = (np.arange(40) < 20)[:, None]
    block = Block("tube", eos, nodes, np.where(left, 1.0, 0.25), 0.0, 0.0, np.where(left, 1, 0.2))
    wall_off(block, *SIDES)
    simulation = Simulation([block], [], t_end=0.15, mesh="fixed")
    row = march(simulation)[-1]
    return block.state[:, 1:-1, 1:-1], row


@pytest.mark.slow  # compiles kernels of its own
def test_a_shock_tube_of_the_table_is_that_of_the_gas(write_of_tabular):
    state, _ = run_tube(Tabular(write_of_tabular()))
    other, _ = run_tube(IdealGas(1.4))
    assert state == pytest.approx(other, rel=1e-10, abs=1e-10)


def test_bad_tables_are_refused(write_of_tabular, tmp_path):
    with pytest.raises(BadInput, match="there is no file"):
        Tabular(str(tmp_path / "none.h5"))
    (tmp_path / "text.h5").write_text("no table")
    with pytest.raises(BadInput, match="datasets rho, e and p"):
        Tabular(str(tmp_path / "text.h5"))
    with pytest.raises(BadInput, match=r"rho must rise; it does not after entry \(1,\)"):
        Tabular(write_of_tabular([1.0, 2.0, 2.0], [1.0, 2.0]))
    with pytest.raises(BadInput, match="p must rise along e"):
        Tabular(write_of_tabular([1.0, 2.0], [1.0, 2.0], [[1.0, 0.5], [2.0, 3.0]]))
    with pytest.raises(BadInput, match=r"must be \(n,\), \(m,\) and \(n, m\)"):
        Tabular(write_of_tabular([1.0, 2.0], [1.0, 2.0], np.ones((3, 3))))
    table = Tabular(write_of_tabular())
    with pytest.raises(BadInput, match="the state rho = 9 kg/m3, e = 1 J/kg is outside the table"):
        table.pressure(9.0, 1.0)


def test_a_first_state_outside_a_table_is_told_with_what_the_table_has(write_of_tabular):
    table = Tabular(write_of_tabular())
    nodes = np.array(np.meshgrid([0.0, 1.0, 2.0], [0.0, 1.0, 2.0], indexing="ij"))
    with pytest.raises(
        BadInput, match=r"rho 0\.05 to 8 kg/m3 and e 0\.2 to 20 J/kg, p 0\.004 to 64 Pa"
    ):
        Block("gas", table, nodes, 1.2, 0.0, 0.0, 1e5)
