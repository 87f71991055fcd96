"""The convection solver's parts: operators, conservation, symmetry, transfer."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse

from shockgrid.hydro.convection.box import (
    PERIODIC,
    Fluid,
    Wall,
    adiabatic,
    heated,
    isothermal,
    make_fluid,
)
from shockgrid.hydro.convection.equations import Equations, Factors
from shockgrid.hydro.convection.march import March
from shockgrid.hydro.convection.measure import compute_mean_nusselt
from shockgrid.hydro.convection.steady import SteadySolver, expand_nodes

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


def solve_steady(x, y, walls, fluid, **options) -> SteadySolver:
    """The steady state on nodes x, y [m]."""
    solver = SteadySolver(Equations(x, y, walls), fluid, **options)
    solver.solve()
    return solver


def random_state(equations: Equations, size: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    return tuple(size * RANDOM.standard_normal(n) for n in equations.sizes)


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


def test_uniform_flow_and_heat_stay_uniform_on_a_moving_grid():
    walls = layer() | {"j_min": adiabatic("free"), "j_max": adiabatic("free")}
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


def test_heated_from_below_the_fluid_stays_at_rest_unless_pushed():
    x = np.linspace(0.0, 1.0, 13)
    walls = layer() | {"i_min": adiabatic(), "i_max": adiabatic()}
    fluid = make_fluid(2e4, 0.71)
    rest = solve_steady(x, x, walls, fluid)
    assert np.abs(rest.psi).max() < 1e-9
    tilted = solve_steady(x, x, walls, make_fluid(2e4, 0.71, tilt=30.0))
    rolls = solve_steady(x, x, walls, fluid, start=(tilted.psi, tilted.temperature))
    assert np.abs(rolls.psi).max() > 3.0
    state = (rolls.equations, fluid, rolls.temperature)
    assert compute_mean_nusselt(*state, "j_min") > 2.0


def test_factors_too_large_for_the_solver_are_out_of_memory(monkeypatch):
    def fail(*_, **__):
        raise SystemError("gstrf was called with invalid arguments")

    monkeypatch.setattr("shockgrid.hydro.convection.equations.splu", fail)
    with pytest.raises(MemoryError):
        Factors(sparse.identity(3, format="csc"))
