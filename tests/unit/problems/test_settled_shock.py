"""A shock run in before the start: its place, what is around it, and how it is laid on grids."""

from __future__ import annotations

import functools

import numpy as np
import pytest

import shockgrid as sg
from builders import march, wall_off
from shockgrid.hydro.eos import IdealGas, StiffenedGas
from shockgrid.hydro.eos.materials import find_material
from shockgrid.problems import initial_states
from shockgrid.problems.initial_states import (
    KEPT_CELLS_BEHIND,
    Front,
    SettledShock,
    settle_front,
    settle_shock,
)
from shockgrid.problems.references.hugoniot import Shock, shock_to_pressure, shock_with_mach
from shockgrid.regrid.compilation import kept_files

CFL = 0.8
LIMITER = "monotonised-central"
X = np.linspace(0.0, 2.0, 129)
CELL = X[1] - X[0]
POSITION = 1.003  # in the first half of a cell


def make_shock(name: str):
    """A material and a shock in it."""
    if name == "metal":
        metal = find_material("Al1100")
        return metal.eos, shock_to_pressure(metal.eos, metal.rho0, 0.0, 10e9)
    if name == "stiffened gas":
        eos = StiffenedGas(4.4, 6e8)
        return eos, shock_with_mach(eos, 1000.0, 1e5, 2.0)
    eos = IdealGas(1.4)
    return eos, shock_with_mach(eos, 1.0, 1.0, float(name.split()[-1]))


# cells by which mass and momentum may put it ahead of its place
AHEAD = {
    "gas at Mach 1.5": (0.18, 0.03),
    "gas at Mach 5": (0.32, 0.2),
    "gas at Mach 20": (0.34, 0.22),
    "stiffened gas": (0.45, 0.35),
    "metal": (0.11, 0.025),
}
MATERIALS = list(AHEAD)


def cut(line: SettledShock) -> SettledShock:
    """The line without the cells that go on beyond X."""
    n = X.size - 1
    return SettledShock(line.eos, line.x[: n + 1], line.rho[:n], line.u[:n], line.p[:n])


@functools.cache
def settle(name: str, position: float = POSITION) -> tuple[SettledShock, Shock]:
    eos, shock = make_shock(name)
    return cut(settle_shock(eos, X, position, shock, cfl=CFL, limiter=LIMITER)), shock


def find_by(density: np.ndarray, behind: float, ahead: float) -> float:
    """Place of the jump from `behind` to `ahead` that holds as much as the cells of X do."""
    return X[0] + ((density * np.diff(X)).sum() - ahead * (X[-1] - X[0])) / (behind - ahead)


@pytest.mark.parametrize("name", MATERIALS)
def test_exact_states_far_from_it(name):
    line, shock = settle(name)
    cell = np.searchsorted(X, POSITION) - 1
    far = slice(0, cell - KEPT_CELLS_BEHIND)
    assert (line.rho[far] == shock.rho).all() and (line.p[far] == shock.p).all()
    assert (line.u[far] == shock.particle_speed).all()
    ahead = slice(cell + 16, None)
    rise = shock.p - shock.p_ahead
    assert np.abs(line.p[ahead] - shock.p_ahead).max() < 1e-12 * rise
    assert np.abs(line.u[ahead]).max() < 1e-12 * shock.particle_speed
    assert line.rho[ahead] == pytest.approx(shock.rho_ahead, rel=1e-12)
    # the seam where the exact state begins is a step no larger than what the shock sends back
    assert np.abs(line.p[cell - KEPT_CELLS_BEHIND] - shock.p) < 2e-3 * rise


@pytest.mark.parametrize("name", MATERIALS)
@pytest.mark.parametrize("part", [0.0, 0.2, 0.5, 0.77])
def test_a_profile_of_few_cells_at_its_place(name, part):
    position = 1.0 + part * CELL
    line, shock = settle(name, position)
    masses = (find_by(line.rho, shock.rho, shock.rho_ahead) - position) / CELL
    momenta = (find_by(line.rho * line.u, shock.rho * shock.particle_speed, 0.0) - position) / CELL
    assert 0.0 < masses < AHEAD[name][0] and 0.0 < momenta < AHEAD[name][1]
    other, _ = settle(name)
    assert masses == pytest.approx(
        (find_by(other.rho, shock.rho, shock.rho_ahead) - POSITION) / CELL, abs=0.01
    )
    level = (line.p - shock.p_ahead) / (shock.p - shock.p_ahead)
    assert np.count_nonzero((level > 0.02) & (level < 0.98)) <= 5
    assert level.max() < 1.03 and level.min() > -1e-6
    first = np.flatnonzero(level < 0.9)[0]
    assert (np.diff(level[first:]) < 1e-6).all(), "falls all the way ahead of it"


def push(shock, state, nodes):
    """The density of a row of cells after a shock in a tube has gone 0.2 on, pushed by a piston."""
    gas = sg.Block("gas", shock.eos, nodes, *state)
    sg.put(gas, "i_min", "piston", velocity=(shock.particle_speed, 0.0))
    wall_off(gas)
    tube = sg.Simulation([gas], [], t_end=0.2 / shock.shock_speed)
    march(tube)
    x = 0.5 * (gas.nodes[0, 1:, 0] + gas.nodes[0, :-1, 0])
    return gas.state[0, 1:-1, 1][x < 0.64]  # the shock is at 0.7, its foot some cells wide


def test_a_shock_that_starts_settled_leaves_no_spot_behind():
    shock = sg.shock(IdealGas(1.4), (1.2, 1e5), 3.0)
    nodes = np.array(np.meshgrid(np.linspace(0.0, 1.0, 101), [0.0, 0.01, 0.02], indexing="ij"))
    settled = push(shock, shock.start(nodes, 0.5), nodes)
    behind = np.linspace(0.005, 0.995, 100)[:, None] < 0.5 + np.zeros((1, 2))
    jump = [
        np.where(behind, shock.rho, 1.2), np.where(behind, shock.particle_speed, 0.0), 0.0,
        np.where(behind, shock.p, 1e5),
    ]  # fmt: skip
    plain = push(shock, jump, nodes)
    off, spot = (float(np.abs(rho / shock.rho - 1.0).max()) for rho in (settled, plain))
    assert off < 5e-3 and spot > 4.0 * off


def test_a_settled_front_from_the_cache_is_the_one_that_was_computed(tmp_path, monkeypatch):
    monkeypatch.setattr(kept_files, "find_kept", lambda *words: tmp_path / "settled")
    speed = 2.0 * 1.4**0.5  # Mach 2
    ahead = (1.0, 0.0, 1.0)
    behind = (8.0 / 3.0, 0.625 * speed, 4.5)
    front = Front(IdealGas(1.4), behind, ahead, speed, 0.02 * np.arange(101.0), 80, behind[1])
    found = [settle_front(front, cfl=CFL, limiter=LIMITER) for _ in range(2)]
    assert (tmp_path / "settled").exists() and found[0][0] == found[1][0]
    np.testing.assert_array_equal(found[0][1], found[1][1])
    assert found[0][1][0, :4] == pytest.approx(behind[0], rel=1e-3)


def test_a_settled_front_is_found_again_whatever_its_material_was_used_for(tmp_path, monkeypatch):
    monkeypatch.setenv("SHOCKGRID_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(initial_states, "_settle", lambda *_: (0, np.ones((3, 4))))

    def make_front(gas):
        return Front(gas, (2.0, 1.0, 4.0), (1.0, 0.0, 1.0), 2.0, np.arange(9.0), 6, 1.0)

    settle_front(make_front(IdealGas(1.4)), cfl=CFL, limiter=LIMITER)
    used = IdealGas(1.4)
    used.sound_speed(1.0, 1.0)
    for gas, files in ((used, 1), (IdealGas(1.5), 2), (StiffenedGas(1.4, 0.0), 3)):
        settle_front(make_front(gas), cfl=CFL, limiter=LIMITER)
        assert len(list(tmp_path.rglob("settled-*"))) == files


@pytest.mark.parametrize(
    "ahead, mach", [((-1.2, 1e5), 2.0), ((1.2, -1e5), 2.0), ((1.2, 1e5), np.nan)]
)
def test_no_shock_of_numbers_that_are_no_state(ahead, mach):
    with pytest.raises(sg.BadInput, match=r"no sound runs there|give one of at least 1"):
        sg.shock(IdealGas(1.4), ahead, mach)


@pytest.mark.parametrize("position", [-0.1, 1.0, np.nan])
def test_no_shock_outside_its_block(position):
    nodes = np.array(np.meshgrid(np.linspace(0.0, 1.0, 11), [0.0, 0.1, 0.2], indexing="ij"))
    with pytest.raises(sg.BadInput, match="the block is at 0 to 1"):
        sg.shock(IdealGas(1.4), (1.2, 1e5), 2.0).start(nodes, position)
