"""The convection solver's parts: operators, conservation, symmetry, transfer, bad input."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse

from convecting import solve_steady
from hydro.convection.box import (
    PERIODIC,
    Axis,
    Fluid,
    Wall,
    adiabatic,
    heated,
    isothermal,
    make_fluid,
    turn_gravity,
)
from hydro.convection.equations import Equations, Factors
from hydro.convection.march import March, compute_swept
from hydro.convection.measure import compute_mean_nusselt, find_maximum
from hydro.convection.steady import (
    GridControl,
    SteadySolver,
    compute_nodal_fields,
    expand_nodes,
    make_rest,
    transfer,
)
from regrid.errors import BadInput, RunFailure

RANDOM = np.random.default_rng(5)


def uneven(n: int, low: float = 0.0, high: float = 1.0, seed: int = 0) -> np.ndarray:
    steps = np.random.default_rng(seed).uniform(0.5, 1.5, n)
    x = low + (high - low) * np.append(0.0, np.cumsum(steps)) / steps.sum()
    x[-1] = high
    return x


def side_heated(flow: str = "no-slip") -> dict[str, Wall]:
    return {
        "i_min": isothermal(0.5, flow),
        "i_max": isothermal(-0.5, flow),
        "j_min": adiabatic(flow),
        "j_max": adiabatic(flow),
    }


def layer(flow: str = "no-slip") -> dict[str, Wall]:
    return {
        "i_min": PERIODIC,
        "i_max": PERIODIC,
        "j_min": isothermal(0.5, flow),
        "j_max": isothermal(-0.5, flow),
    }


def random_state(equations: Equations, size: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    return tuple(size * RANDOM.standard_normal(n) for n in equations.sizes)


@pytest.mark.parametrize("periodic", [False, True])
def test_operators_of_an_axis_are_exact_for_straight_lines(periodic):
    axis = Axis(uneven(9), periodic)
    inner = slice(1, axis.cells)
    line = 3.0 * axis.centres - 1.0
    assert np.allclose((axis.interpolate_to_nodes() @ line)[inner], 3.0 * axis.nodes[1:-1] - 1.0)
    slope = (axis.difference_to_nodes() @ line) / axis.distances
    assert np.allclose(slope[inner], 3.0)
    assert np.isclose(axis.distances.sum(), axis.length)
    here = axis.difference_to_cells().toarray()
    there = axis.difference_to_nodes().toarray()
    assert np.array_equal(here.T, -there), "difference and its adjoint, walls included"


@pytest.mark.parametrize("walls", [side_heated(), side_heated("free"), layer(), layer("free")])
def test_any_stream_function_conserves_mass(walls):
    equations = Equations(uneven(11), uneven(8, seed=3), walls)
    psi, _ = random_state(equations, 1e3)
    u, v = equations.compute_fluxes(psi)
    assert np.abs(equations.compute_divergence(psi)).max() <= 1e-15 * 8 * np.abs(u).max()
    assert not v[:, 0].any() and not v[:, -1].any(), "nothing through the walls"


def test_the_pressure_drops_out():
    """A gradient of any pressure, summed around the free nodes, is zero."""
    equations = Equations(uneven(7), uneven(9, seed=1), side_heated())
    pressure = RANDOM.standard_normal(equations.shape)
    push = np.zeros(equations.face_shapes[0]), np.zeros(equations.face_shapes[1])
    push[0][1:-1] = np.diff(pressure, axis=0) * equations.axes[1].widths
    push[1][:, 1:-1] = np.diff(pressure, axis=1) * equations.axes[0].widths[:, None]
    sums = equations.momentum.sum_around(np.concatenate([part.ravel() for part in push]))
    assert np.abs(sums).max() < 1e-13


@pytest.mark.parametrize("walls", [side_heated(), layer()])
def test_the_jacobian_is_the_derivative(walls):
    equations = Equations(uneven(6), uneven(5, seed=2), walls)
    fluid = make_fluid(1e3, 0.7, tilt=20.0)
    psi, temperature = random_state(equations)
    step = random_state(equations)
    jacobian = equations.compute_jacobian(fluid, psi, temperature)

    def residual(part: float) -> np.ndarray:
        return np.concatenate(
            equations.compute_residual(fluid, psi + part * step[0], temperature + part * step[1])
        )

    # quadratic equations: central differences are exact
    difference = 0.5 * (residual(1.0) - residual(-1.0))
    assert np.allclose(jacobian @ np.concatenate(step), difference, rtol=1e-10, atol=1e-9)


def test_convection_neither_makes_nor_takes_energy_on_an_even_grid():
    equations = Equations(np.linspace(0, 1, 9), np.linspace(0, 2, 8), side_heated())
    psi, temperature = random_state(equations)
    still = Fluid(1e-300, 1e-300, (0.0, 0.0))
    momentum, heat = equations.compute_residual(still, psi, temperature)
    assert abs(psi @ momentum) < 1e-11 * np.abs(psi * momentum).sum()
    assert abs(temperature @ heat) < 1e-11 * np.abs(temperature * heat).sum()


def test_friction_and_conduction_only_take():
    equations = Equations(uneven(9), uneven(8, seed=4), side_heated())
    for matrix in (equations.momentum.friction, equations.heat.conduction):
        dense = matrix.toarray()
        assert np.allclose(dense, dense.T, rtol=1e-12, atol=1e-12 * np.abs(dense).max())
        assert np.linalg.eigvalsh(dense).max() < 0.0


def test_heat_through_walls_is_exact_in_a_fluid_at_rest():
    x, y = uneven(8), uneven(6, seed=7)
    walls = side_heated() | {"i_min": heated(2.0), "i_max": isothermal(1.0)}
    solver = solve_steady(x, y, walls, make_fluid(0.0, 0.71))
    equations = solver.equations
    exact = 1.0 + 2.0 * (1.0 - equations.axes[0].centres)
    assert np.allclose(solver.temperature.reshape(equations.shape), exact[:, None], atol=1e-12)
    assert not solver.psi.any()
    right = compute_mean_nusselt(equations, solver.target, solver.temperature, "i_max")
    assert right == pytest.approx(-2.0, abs=1e-12)


def test_heat_in_is_heat_out_and_the_flow_is_its_own_half_turn():
    solver = solve_steady(*2 * [np.linspace(0, 1, 21)], side_heated(), make_fluid(1e5, 0.71))
    state = (solver.equations, solver.target, solver.temperature)
    assert compute_mean_nusselt(*state, "i_min") == pytest.approx(
        -compute_mean_nusselt(*state, "i_max"), rel=1e-12
    )
    for side in ("j_min", "j_max"):
        assert compute_mean_nusselt(*state, side) == 0.0
    psi = expand_nodes(solver.equations, solver.psi)
    assert np.abs(psi - psi[::-1, ::-1]).max() < 1e-11 * np.abs(psi).max()
    heat = solver.temperature.reshape(solver.equations.shape)
    assert np.abs(heat + heat[::-1, ::-1]).max() < 1e-11


def test_a_turned_box_is_the_same_box():
    """Hot left side and gravity down; hot floor and gravity in +x: transposed."""
    x, y = uneven(14), uneven(17, 0.0, 1.5, seed=8)
    one = solve_steady(x, y, side_heated(), make_fluid(3e4, 0.71))
    walls = side_heated()
    turned = {
        "j_min": walls["i_min"],
        "j_max": walls["i_max"],
        "i_min": adiabatic(),
        "i_max": adiabatic(),
    }
    # reflected in the diagonal, down becomes left
    other = solve_steady(y, x, turned, make_fluid(3e4, 0.71, gravity=(-1.0, 0.0)))
    heat = one.temperature.reshape(one.equations.shape)
    assert np.abs(heat - other.temperature.reshape(other.equations.shape).T).max() < 1e-11
    psi = expand_nodes(one.equations, one.psi)
    assert np.abs(psi + expand_nodes(other.equations, other.psi).T).max() < 1e-10


def test_gravity_turns_exactly_by_right_angles():
    found = [turn_gravity(angle) for angle in (0.0, 90.0, 180.0, -90.0)]
    assert found == [(0.0, -1.0), (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0)]
    assert np.allclose(turn_gravity(30.0), (0.5, -np.sqrt(0.75)))


@pytest.mark.parametrize("walls", [side_heated(), layer()])
def test_transfer_keeps_mass_and_heat(walls):
    old = Equations(uneven(14), uneven(12, seed=1), walls)
    new = Equations(uneven(14, seed=5), uneven(12, seed=6), walls)
    psi, temperature = random_state(old)
    moved = transfer(old, new, psi, temperature)
    assert new.areas @ moved[1] == pytest.approx(old.areas @ temperature, abs=1e-12)
    assert np.abs(new.compute_divergence(moved[0])).max() < 1e-13
    same = transfer(old, old, psi, temperature)
    assert np.allclose(same[0], psi, atol=1e-12) and np.allclose(same[1], temperature, atol=1e-11)


def test_transfer_and_nodes_are_exact_for_polynomials():
    old, new = (Equations(uneven(9, seed=k), uneven(8, seed=k + 1), side_heated()) for k in (0, 4))
    x, y = (axis.nodes for axis in old.axes)
    areas = np.outer(np.diff(x**2), np.diff(y**2))  # of the field 4 x y
    _, moved = transfer(old, new, np.zeros(old.sizes[0]), areas.ravel() / old.areas)
    x, y = (axis.nodes for axis in new.axes)
    assert np.allclose(moved * new.areas, np.outer(np.diff(x**2), np.diff(y**2)).ravel())
    heat = new.axes[1].centres * np.ones(new.shape)
    nodal = compute_nodal_fields(new, np.zeros(new.sizes[0]), heat.ravel())[2]
    assert np.allclose(nodal[1:-1, 1:-1], y[1:-1])
    assert np.allclose(nodal[0], 0.5) and np.allclose(nodal[-1], -0.5)


def test_swept_areas_are_what_the_cells_grow_by():
    old = Equations(uneven(7), uneven(6, seed=1), side_heated())
    new = Equations(uneven(7, seed=2), uneven(6, seed=3), side_heated())
    grown = new.heat.balance @ compute_swept(old, new)
    assert np.abs(grown - (new.areas - old.areas)).max() < 1e-16


def test_uniform_flow_and_heat_stay_uniform_on_a_moving_grid():
    """The geometric conservation law, with steps of different lengths."""
    walls = {
        "i_min": PERIODIC,
        "i_max": PERIODIC,
        "j_min": adiabatic("free"),
        "j_max": adiabatic("free"),
    }

    x, y = uneven(9), uneven(8, seed=7)

    def place(k: int):
        sway = 0.05 * np.sin(0.8 * k)  # larger: motion, being explicit, lets round-off grow
        return x + sway * np.sin(3.0 * np.pi * x), y - sway * np.sin(2.0 * np.pi * y)

    equations = Equations(*place(0), walls)
    march = March(equations, Fluid(0.5, 0.3, (0.0, 0.0)), *uniform(equations, 2.0), longest=1.0)
    for k in range(1, 30):
        march.advance(0.004 * (1.0 + 0.5 * np.sin(k)), place(k))
    u, v = march.equations.compute_velocities(march.level.psi)
    assert np.abs(u - 2.0).max() < 1e-11 and np.abs(v).max() < 1e-11
    assert np.abs(march.level.temperature - 3.0).max() < 1e-12


def uniform(equations: Equations, speed: float) -> tuple[np.ndarray, np.ndarray]:
    y = equations.axes[1].nodes
    psi = speed * np.append(np.tile(y[1:-1], equations.axes[0].cells), y[-1])
    return psi, np.full(equations.sizes[1], 3.0)


def test_heat_of_a_march_is_what_came_in():
    walls = side_heated() | {"j_min": heated(0.7)}
    x = np.linspace(0.0, 1.0, 13)
    equations = Equations(x, x, walls)
    march = March(equations, make_fluid(2e4, 0.71), *random_state(equations, 0.1), longest=2e-3)
    start = march.level.heat.sum()
    for k in range(25):
        shift = 0.02 * np.sin(np.pi * x) * np.sin(0.3 * (k + 1))
        march.advance(march.choose_step(), (x + shift, x - shift))
    assert abs(march.level.heat.sum() - start) > 1e-3
    assert march.level.heat.sum() - start == pytest.approx(march.level.entered, abs=1e-13)
    assert np.abs(march.equations.compute_divergence(march.level.psi)).max() < 1e-13


def test_a_march_ends_in_the_steady_state():
    x = np.linspace(0.0, 1.0, 17)
    solver = solve_steady(x, x, side_heated(), make_fluid(1e4, 0.71))
    equations = solver.equations
    still = (np.zeros(equations.sizes[0]), np.zeros(equations.sizes[1]))
    march = March(equations, solver.target, *still, longest=2e-3)
    for _ in range(800):
        march.advance(march.choose_step())
    assert np.abs(march.level.psi - solver.psi).max() < 1e-8 * np.abs(solver.psi).max()
    assert np.abs(march.level.temperature - solver.temperature).max() < 1e-8


def test_steps_follow_the_flow_and_end_on_time():
    x = np.linspace(0.0, 1.0, 17)
    equations = Equations(x, x, side_heated())
    psi = 10.0 * np.ones(equations.sizes[0])
    march = March(equations, make_fluid(1e4, 0.71), psi, np.zeros(256), cfl=0.4, longest=1.0)
    dt = march.choose_step()
    fluxes = np.abs(np.concatenate([part.ravel() for part in equations.compute_fluxes(psi)]))
    assert 0.0 < dt <= 0.4 / (fluxes.max() / equations.areas[0])
    assert march.limit == "flow"
    assert march.choose_step(1.5 * dt) == 0.75 * dt, "no crumb at the end"
    assert march.choose_step(0.5 * dt) == 0.5 * dt and march.limit == "end"


def test_small_pivots_are_found_out():
    """Zeros on the diagonal: factorised again with rows exchanged."""
    matrix = sparse.csc_matrix(np.array([[1e-20, 1.0, 0.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1e-20]]))
    matrix = matrix + sparse.csc_matrix(np.diag([0.0, 0.0, 2.0]))
    factors = Factors(matrix)
    right = np.array([1.0, 2.0, 3.0])
    assert np.allclose(matrix @ factors.solve(right), right) and factors.exchanged
    with pytest.raises(RunFailure, match="singular"):
        Factors(sparse.csc_matrix(np.ones((3, 3))), "test's matrix").solve(right)


def test_stages_are_taken_back_and_shortened():
    """A start from which Newton's iteration fails at full buoyancy still ends in the same state."""
    x = np.linspace(0.0, 1.0, 13)
    usual = solve_steady(x, x, side_heated(), make_fluid(1e5, 0.71))
    solver = SteadySolver(Equations(x, x, side_heated()), make_fluid(1e5, 0.71))
    psi, temperature = solver.psi, solver.temperature
    solver.exponent, solver.good = 0.0, (-2.0, psi, temperature)
    solver.psi = 1e9 * RANDOM.standard_normal(psi.size)
    solver.change = np.nan
    solver.judge_stage()
    assert solver.exponent == -1.0 and solver.factor == 1.0
    solver.solve()
    assert np.allclose(solver.psi, usual.psi, rtol=1e-8, atol=1e-8 * np.abs(usual.psi).max())


def test_the_maximum_of_a_spline():
    x = np.linspace(0.0, 1.0, 30)
    value, place = find_maximum(x, np.sin(2.0 * x + 0.3))
    assert value == pytest.approx(1.0, abs=1e-6)
    assert place == pytest.approx(0.5 * (np.pi / 2 - 0.3), abs=1e-5)
    assert find_maximum(x, x**2) == (pytest.approx(1.0), 1.0)


BAD_WALLS = {
    "missing": ({"i_min": adiabatic()}, "has the sides i_min, i_max, j_min, j_max"),
    "flow": (layer() | {"j_min": Wall("sticky")}, "side j_min: flow 'sticky' is not known"),
    "both": (layer() | {"j_min": Wall(temperature=1.0, flux=2.0)}, "both a temperature and a flux"),
    "periodic heat": (layer() | {"i_min": Wall("periodic", flux=1.0)}, "i_min is periodic and so"),
    "half periodic": (side_heated() | {"i_max": PERIODIC}, "i_max is periodic but i_min is a wall"),
    "torus": (dict.fromkeys(layer(), PERIODIC), "cannot be periodic both ways"),
}


@pytest.mark.parametrize("name", BAD_WALLS)
def test_contradictory_walls(name):
    walls, words = BAD_WALLS[name]
    with pytest.raises(BadInput, match=words):
        Equations(np.linspace(0, 1, 5), np.linspace(0, 1, 5), walls)


def test_steady_states_that_cannot_be():
    x = np.linspace(0.0, 1.0, 5)
    walls = dict.fromkeys(side_heated(), adiabatic())
    with pytest.raises(BadInput, match="fixed nowhere"):
        solve_steady(x, x, walls, make_fluid(1e3, 1.0))
    with pytest.raises(BadInput, match="which no steady state can"):
        solve_steady(x, x, walls | {"i_min": heated(1.0)}, make_fluid(1e3, 1.0))


def test_bad_grids():
    with pytest.raises(BadInput, match=r"has 2 cells in x; it needs at least 3"):
        Equations(np.linspace(0, 1, 3), np.linspace(0, 1, 9), side_heated())
    with pytest.raises(BadInput, match="do not rise in y"):
        Equations(np.linspace(0, 1, 5), np.array([0.0, 0.5, 0.4, 1.0]), side_heated())
    with pytest.raises(BadInput, match="every 0 iterations"):
        GridControl(every=0)
    with pytest.raises(BadInput, match="did you mean 'polevikov'"):
        GridControl("polevikoff")


BAD_FLUIDS = {
    "Ra < 0": ({"rayleigh": -1.0, "prandtl": 1.0}, "Ra = -1 is negative"),
    "Ra nan": ({"rayleigh": np.nan, "prandtl": 1.0}, "Ra = nan is no number"),
    "Pr": ({"rayleigh": 1.0, "prandtl": 0.0}, "Pr = 0 must be positive"),
    "tilt": ({"rayleigh": 1.0, "prandtl": 1.0, "tilt": np.inf}, "is no angle"),
    "no gravity": (
        {"rayleigh": 1e5, "prandtl": 1.0, "gravity": (0.0, 0.0)},
        r"gravity is zero but Ra = 100000 asks for buoyancy",
    ),
}


@pytest.mark.parametrize("name", BAD_FLUIDS)
def test_bad_fluids(name):
    numbers, words = BAD_FLUIDS[name]
    with pytest.raises(BadInput, match=words):
        make_fluid(**numbers)


def test_bad_material_and_march():
    with pytest.raises(BadInput, match="viscosity is -1; it must be positive"):
        Fluid(-1.0, 1.0, (0.0, 0.0))
    assert make_fluid(0.0, 1.0, gravity=(0.0, 0.0)).buoyancy == (0.0, 0.0)
    with pytest.raises(BadInput, match="cannot be changed"):
        make_fluid(0.0, 1.0).at_rayleigh(5.0)
    equations = Equations(np.linspace(0, 1, 5), np.linspace(0, 1, 5), side_heated())
    state = [np.zeros(n) for n in equations.sizes]
    with pytest.raises(BadInput, match="cfl = 2"):
        March(equations, make_fluid(1.0, 1.0), *state, cfl=2.0)
    with pytest.raises(BadInput, match="at rest and no longest step"):
        March(equations, make_fluid(1.0, 1.0), *state).choose_step()


def test_heated_from_below_the_fluid_stays_at_rest_unless_pushed():
    x = np.linspace(0.0, 1.0, 13)
    walls = {"i_min": adiabatic(), "i_max": adiabatic()}
    walls |= {"j_min": isothermal(0.5), "j_max": isothermal(-0.5)}
    fluid = make_fluid(2e4, 0.71)
    rest = solve_steady(x, x, walls, fluid)
    assert np.abs(rest.psi).max() < 1e-9
    tilted = solve_steady(x, x, walls, make_fluid(2e4, 0.71, tilt=30.0))
    rolls = solve_steady(x, x, walls, fluid, start=(tilted.psi, tilted.temperature))
    assert np.abs(rolls.psi).max() > 3.0
    state = (rolls.equations, fluid, rolls.temperature)
    assert compute_mean_nusselt(*state, "j_min") > 2.0


def test_one_step_conducts_heat_into_a_box_without_isothermal_walls():
    walls = dict.fromkeys(side_heated(), adiabatic()) | {"i_min": heated(1.0)}
    x = np.linspace(0.0, 1.0, 9)
    equations = Equations(x, x, walls)
    march = March(equations, make_fluid(1e3, 0.71), *make_rest(equations), longest=1e-2)
    for _ in range(30):
        march.advance(march.choose_step())
    assert march.level.heat.sum() == pytest.approx(march.t, rel=1e-12)
