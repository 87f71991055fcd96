"""Voids that close: found, measured, filled with gas, gone; the collapse of a cylindrical one."""

import numpy as np
import pytest
from plates import advance, make_plate, make_stack
from scipy.integrate import solve_ivp

from builders import check_budget, wall_off
from hydro.block import Block
from hydro.boundary import put
from hydro.eos import StiffenedGas
from regrid.errors import BadInput

WATER = StiffenedGas(4.4, 6e8), 1000.0
INNER, OUTER = 1e-3, 5e-3


def make_quarter(cells, speed, t_end, layers=32, **options):
    """A quarter of a ring of water between two walls, going in with speed x INNER / r."""
    angle = np.linspace(0.5 * np.pi, 0.0, cells + 1)[:, None]
    radius = INNER * (OUTER / INNER) ** np.linspace(0.0, 1.0, layers + 1)
    nodes = np.array([radius * np.cos(angle), radius * np.sin(angle)])
    nodes[0][np.isclose(angle[:, 0], 0.5 * np.pi)] = 0.0
    nodes[1][-1] = 0.0
    block = Block("water", WATER[0], nodes, WATER[1], 0.0, 0.0, 0.0)
    x, y = (0.25 * (q[1:, 1:] + q[:-1, 1:] + q[1:, :-1] + q[:-1, :-1]) for q in nodes)
    square = x * x + y * y
    block.state[1, 1:-1, 1:-1] = -speed * INNER * x / square
    block.state[2, 1:-1, 1:-1] = -speed * INNER * y / square
    for side in ("j_min", "j_max"):
        put(block, side, "free-surface")
    wall_off(block)
    return block, make_stack([block], t_end, **options)


def find_radii(speed, times):
    """Inner radius by (R R'' + R'^2) ln(Ro / R) + R'^2 (R^2 / Ro^2 - 1) / 2 = 0."""

    def slope(t, state):
        r, u = state
        square = r * r + OUTER**2 - INNER**2
        rest = 0.5 * u * u * (r * r / square - 1.0) / (0.5 * np.log(square / r**2))
        return [u, (-rest - u * u) / r]

    found = solve_ivp(slope, (0.0, times[-1]), [INNER, -speed], t_eval=times, rtol=1e-10)
    return found.y[0]


@pytest.mark.parametrize(
    ("cells", "layers"), [(8, 24), pytest.param(24, 96, marks=pytest.mark.slow)]
)
def test_a_cylindrical_void_collapses(cells, layers):
    """As an incompressible one until .2 of its radius, 1 % of the first one; symmetric through its
    closing, 1e-10."""
    speed = 50.0
    block, simulation = make_quarter(cells, speed, 1.25e-5, layers)
    rows, radii = [simulation.start_row() | {"t": 0.0}], [INNER]
    while not simulation.finished:
        rows.append(simulation.advance())
        radii.append(float(block.nodes[0, -1, 0]))
    assert rows[-1]["voids"] == 1
    t, radii = np.array([row["t"] for row in rows]), np.array(radii)
    wanted = find_radii(speed, t[t < 1.09e-5])
    late = wanted > 0.2 * INNER
    assert np.abs(radii[: wanted.size] - wanted)[late].max() < 1e-2 * INNER
    areas = np.array([row["void_area"] for row in rows[1:]])
    assert areas[0] == pytest.approx(0.25 * np.pi * INNER**2, rel=2e-2)
    mirrored = block.nodes[::-1, ::-1]
    assert np.abs(block.nodes - mirrored).max() < 1e-10 * INNER
    assert max(row["cells_not_convex"] for row in rows[1:]) == 0
    assert wanted.min() < 0.2 * INNER and radii.min() < 0.05 * INNER and areas.min() > 0.0
    check_budget(rows, names=("momentum_x", "momentum_y", "energy"), limit=1e-11)


def test_gas_between_plates_is_squeezed():
    """Two plates close off a gap between walls: its gas has p V^gamma; it throws them back."""
    plates = [
        make_plate("left", WATER, (0.0, 1e-3), 10, 100.0),
        make_plate("right", WATER, (2e-3, 3e-3), 10, -100.0),
    ]
    gap, p, gamma = 1e-3, 2.5e6, 1.4
    simulation = make_stack(plates, 1.6e-5, void_fill=(p, gamma))
    rows = advance(simulation)
    areas = np.array([row["void_area"] for row in rows[1:]])
    assert areas[0] == pytest.approx(gap * 1e-3, rel=1e-2) and rows[-1]["voids"] == 1
    kinetic = 1000.0 * 1e-6 * 100.0**2  # of both, per depth
    lost = -np.array([row["boundary_energy"] for row in rows[1:]])
    work = p * areas[0] / (gamma - 1.0) * ((areas[0] / areas) ** (gamma - 1.0) - 1.0)
    assert np.abs(lost[:-1] - work[1:]).max() < 2e-3 * kinetic  # areas are those before the step
    assert work.max() > 0.9 * kinetic
    assert rows[-1]["total_momentum_x"] == pytest.approx(0.0, abs=1e-12 * 1000.0 * 1e-6 * 100.0)


@pytest.mark.parametrize("fill", [(-1.0, 1.4), (1e5, 0.9), (float("nan"), 1.4)])
def test_nonsense_fills_are_bad_input(fill):
    with pytest.raises(BadInput, match=r"void_fill = .*a pressure of 0 Pa or more"):
        make_quarter(4, 1.0, 1e-6, 4, void_fill=fill)


def test_restarts_while_a_void_closes():
    """Before it closes, with what resists in it, and after: the same bits."""

    def make():
        return make_quarter(6, 50.0, 1.25e-5, 12, void_fill=(1e4, 1.4))[1]

    one, states, rows = make(), [], []
    while not one.finished:
        rows.append(one.advance())
        states.append(one.get_state())
    closed = next(k for k, state in enumerate(states) if state["contacts/voids"][0, 5] > 0.0)
    for at in (2, closed - 1, closed, closed + 1):
        other = make()
        other.set_state(states[at])
        for k in range(at + 1, at + 4):
            row, new = other.advance(), other.get_state()
            assert (row["voids"], row["void_area"]) == (rows[k]["voids"], rows[k]["void_area"])
            for name, array in states[k].items():
                assert np.array_equal(new[name], array), name
