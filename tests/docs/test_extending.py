"""Every example of docs/extending.md, run from the page, does what physics or geometry asks."""

from __future__ import annotations

import importlib
import re
import sys
import tomllib

import numpy as np
import pytest

from builders import ROOT, march
from shockgrid.hydro import eos as eos_registry
from shockgrid.hydro import history
from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import SEGMENTS, put
from shockgrid.hydro.eos import IdealGas
from shockgrid.hydro.eos.materials import find_material
from shockgrid.hydro.simulation import Simulation
from shockgrid.hydro.strength.laws import STRENGTH_LAWS
from shockgrid.problems import registry as problem_registry
from shockgrid.problems.initial_states import make_plane_grid
from shockgrid.regrid import registry as regridder_registry
from shockgrid.regrid.domains import make_domain
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.measure.quality import find_bad_cells
from shockgrid.regrid.plug_ins import GROUPS
from shockgrid.regrid.registry import make_regridder
from shockgrid.runs.cli.main import main
from shockgrid.runs.store.history import read_history
from shockgrid.testing import (
    check_boundary,
    check_eos,
    check_problem,
    check_regridder,
    check_strength,
)

PAGE = ROOT / "docs" / "extending.md"
REGISTRIES = {
    "PROBLEMS": problem_registry.PROBLEMS,
    "EQUATIONS_OF_STATE": eos_registry.EQUATIONS_OF_STATE,
    "STRENGTH_LAWS": STRENGTH_LAWS,
    "REGRIDDERS": regridder_registry.REGRIDDERS,
    "SEGMENTS": SEGMENTS,
    "COLUMNS": history.COLUMNS,
}


def read_examples() -> dict[str, tuple[str, str]]:
    """File name -> its text and the registry line after it, in the order of the page."""
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    return {
        file.partition("\n")[0].removeprefix("# "): (file, line)
        for file, line in zip(blocks[::2], blocks[1::2], strict=True)
    }


EXAMPLES = read_examples()


@pytest.fixture
def add(tmp_path, monkeypatch):
    """Write an example of the page to a folder on the path, register it, return its module."""

    def add_example(file: str):
        text, line = EXAMPLES[file]
        (tmp_path / file).write_text(text, encoding="utf-8")
        monkeypatch.syspath_prepend(tmp_path)
        module = importlib.import_module(file.removesuffix(".py"))
        monkeypatch.delitem(sys.modules, module.__name__)
        monkeypatch.setitem(sys.modules, module.__name__, module)
        registry, key = re.match(r'(\w+)\["(.+?)"\]', line).groups()
        monkeypatch.setitem(REGISTRIES[registry], key, None)
        exec(line, {**REGISTRIES, **vars(module)})
        return module

    return add_example


def make_tube(eos, length, cells, rho, p, **sides):
    """A tube along x of one gas at rest; `sides`: kind and options of i_min and i_max."""
    x = np.linspace(0.0, length, cells + 1)
    block = Block("gas", eos, make_plane_grid(x, x[:5]), rho, 0.0, 0.0, p)
    for side in ("i_min", "i_max", "j_min", "j_max"):
        kind, options = sides.get(side, ("wall", {}))
        put(block, side, kind, **options)
    return block


def run_block(block, t_end, mesh="fixed"):
    simulation = Simulation([block], [], t_end=t_end, cfl=0.8, mesh=mesh)
    march(simulation)
    return simulation


def run(name, folder, *settings):
    """History of a run of the command line."""
    assert main(["run", name, "-o", str(folder), "--quiet", *settings]) == 0
    return read_history(folder / "history.csv")


def test_problem_standing_sound_has_its_period(add, tmp_path, capsys):
    add("standing_sound.py")
    history = run("standing-sound", tmp_path / "out")
    t = history["t"]
    amplitude = history["amplitude"]
    assert np.abs(amplitude - 1e-3 * np.cos(np.pi * t)).max() < 2e-5
    assert "amplitude" in (tmp_path / "out" / "summary.txt").read_text()
    assert main(["list", "standing-sound"]) == 0
    assert "closed tube" in capsys.readouterr().out


@pytest.mark.slow  # compiles kernels of its own
def test_equation_of_state_shock_obeys_hugoniot(add):
    gas = add("noble_abel.py").NobleAbel(gamma=1.4, b=0.2)
    assert gas.pressure(1.5, gas.energy(1.5, 2.0)) == pytest.approx(2.0, rel=1e-14)
    push = 2.0
    t = 0.15
    tube = make_tube(gas, 1.0, 200, 1.0, 1.0, i_min=("piston", {"velocity": (push, 0.0)}))

    def follow(name, time):
        return make_plane_grid(np.linspace(push * time, 1.0, 201), np.linspace(0.0, 0.02, 5))

    run_block(tube, t, follow)
    rho, p = (float(tube.cell_fields[name][20:40].mean()) for name in ("rho", "p"))
    speed = rho * push / (rho - 1.0)  # mass through the shock
    assert p == pytest.approx(1.0 + speed * push, rel=2e-3)  # momentum
    jump = gas.energy(rho, p) - gas.energy(1.0, 1.0)
    assert jump == pytest.approx(0.5 * (p + 1.0) * (1.0 - 1.0 / rho), rel=4e-3)  # energy
    assert rho < 0.98 * 6.0 / (1.0 + 5.0 * 0.2)  # below the limit of strong shocks


def test_equation_of_state_is_known_to_material_files(add, tmp_path):
    add("noble_abel.py")
    file = tmp_path / "own.toml"
    file.write_text(
        '[gas]\neos = "noble-abel"\ngamma = 1.3\nb = 2e-3\nrho0 = 1.2\nsource = "here"\n'
    )
    found = find_material(f"{file}:gas")
    assert (found.eos.gamma, found.eos.b, found.rho0) == (1.3, 2e-3, 1.2)
    file.with_name("bad.toml").write_text(file.read_text().replace("1.3", '"x"'))
    with pytest.raises(BadInput, match=r"gamma is 'x'; it must be a number"):
        find_material(f"{file.with_name('bad.toml')}:gas")


def test_regridder_keeps_sides_and_convexity(add):
    add("averaged.py")
    moving = make_domain("valley", 24, 18)
    nodes = moving.start
    boundary = moving.boundary(0.1)
    found = make_regridder("averaged", sweeps=40).regrid(nodes, boundary)
    assert len(find_bad_cells(found.nodes)) == 0
    for side in (np.s_[:, 0], np.s_[:, -1], np.s_[:, :, 0], np.s_[:, :, -1]):
        assert np.array_equal(found.nodes[side], boundary[side])

    def measure_roughness(grid):  # how far nodes are from the mean of their neighbours
        means = 0.25 * (
            grid[:, 2:, 1:-1] + grid[:, :-2, 1:-1] + grid[:, 1:-1, 2:] + grid[:, 1:-1, :-2]
        )
        return np.abs(means - grid[:, 1:-1, 1:-1]).max()

    few = make_regridder("averaged", sweeps=0).regrid(nodes, boundary)
    assert measure_roughness(found.nodes) < 0.5 * measure_roughness(few.nodes)


def test_boundary_kind_gives_the_speed_of_a_rarefaction(add):
    add("pressure_outlet.py")
    outlet = {"pressure": 0.8}
    tube = make_tube(IdealGas(1.4), 1.0, 100, 1.4, 1.0, i_max=("pressure-outlet", outlet))
    run_block(tube, 0.5)
    behind = tube.cell_fields["u"][90:, :]
    theory = 5.0 * (1.0 - 0.8 ** (1.0 / 7.0))  # 2 c / (gamma - 1) (1 - (p / p0)^(1/7)), c = 1
    assert behind == pytest.approx(theory, rel=0.01)
    assert tube.cell_fields["p"][90:, :] == pytest.approx(0.8, rel=0.01)


def test_boundary_kind_lets_material_flow_back_in(add):
    """A higher pressure outside drives in what a piston's shock of that pressure would."""
    add("pressure_outlet.py")
    outlet = {"pressure": 1.2}
    tube = make_tube(IdealGas(1.4), 1.0, 100, 1.4, 1.0, i_max=("pressure-outlet", outlet))
    run_block(tube, 0.5)
    theory = -0.2 / np.sqrt(1.4 * (1.2 * 1.2 + 0.2 * 1.0))  # speed behind a shock to p = 1.2
    assert tube.cell_fields["u"][80:98, :] == pytest.approx(theory, rel=0.02)
    # it is as dense as behind the shock, not emptied
    assert tube.cell_fields["rho"][80:98, :].min() > 1.4 * 1.1


def test_history_column_is_the_energy_of_the_shocked_gas(add):
    add("kinetic_energy.py")
    piston = {"velocity": (1.0, 0.0)}
    tube = make_tube(IdealGas(1.4), 1.0, 100, 1.4, 1.0, i_min=("piston", piston))
    simulation = Simulation([tube], [], t_end=0.5)
    row = march(simulation)[-1]
    speed = 0.6 + np.sqrt(0.36 + 1.0)  # of the shock ahead of the piston, c = 1
    mass = 1.4 * speed * 0.5 * 0.04
    assert row["kinetic_energy_gas"] == pytest.approx(0.5 * mass, rel=0.01)


def test_law_of_strength_is_that_of_a_material(add, tmp_path):
    add("voce.py")
    strength = "law = 'voce', shear_modulus = 27.6e9, yield_strength = 0.2e9, greatest = 0.5e9"
    (tmp_path / "own.toml").write_text(
        "[mine]\neos = 'mie-gruneisen'\nsource = 'a test'\nrho0 = 2703.0\nc0 = 5240.0\ns = 1.4\n"
        "gruneisen = 1.97\nstrength = 1e9\n"
        f"strength_law = {{ {strength}, strain_scale = 0.1 }}\n"
    )
    law = find_material(f"{tmp_path / 'own.toml'}:mine").strength
    strain = np.array([0.0, 0.1, 10.0])
    at_rest = np.full((2, 3), 1.0)
    found = law.flow_stress(strain, *at_rest, at_rest[0], None)
    assert found == pytest.approx([0.2e9, 0.5e9 - 0.3e9 / np.e, 0.5e9])


def test_examples_keep_the_promises(add):
    check_strength(add("voce.py").Voce(27.6e9, 0.2e9, 0.5e9, 0.1))
    check_eos(add("noble_abel.py").NobleAbel(), rho=[1.0, 50.0, 200.0], p=[1e5, 1e8])
    check_regridder(add("averaged.py").AveragedRegridder)
    check_boundary(add("pressure_outlet.py").PressureOutlet, {"pressure": 0.9})
    check_problem(add("standing_sound.py").StandingSound)


def test_entry_points_of_the_page_are_those_of_its_examples(add):
    (text,) = re.findall(
        r"```toml\n(# pyproject.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL
    )
    groups = tomllib.loads(text)["project"]["entry-points"]
    assert set(groups) == set(GROUPS)
    for entries in groups.values():
        for value in entries.values():
            module, _, name = value.partition(":")
            assert callable(getattr(add(f"{module}.py"), name))
