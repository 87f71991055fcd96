"""Axisymmetric flow: free streams, conservation, shocks along and across the axis, restart."""

import numpy as np
import pytest

from builders import box, check_budget, check_restarts, get_bits, march, wall_off
from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import IdealGas, MieGruneisen
from shockgrid.hydro.links import join, slide
from shockgrid.hydro.simulation import Simulation

GAS = IdealGas(1.4)
SPEED = 0.6 * np.sqrt(1.4)


def make_grid(cells, low, high, left=-1.0, right=1.0):
    """Nodes between two lines y = low(x) and y = high(x)."""
    x = np.linspace(left, right, cells[0] + 1)
    part = np.linspace(0.0, 1.0, cells[1] + 1)
    bottom = np.broadcast_to(low(x), x.shape)
    top = np.broadcast_to(high(x), x.shape)
    y = bottom[:, None] + (top - bottom)[:, None] * part
    return np.array([np.repeat(x[:, None], part.size, 1), y])


def measure_deviation(simulation, densities):
    """Largest deviation from the stream of speed SPEED and pressure 1."""
    worst = 0.0
    for block in simulation.blocks:
        rho, u, v, p = block.state[:, 1:-1, 1:-1]
        for value in (rho / densities[block.name] - 1.0, u - SPEED, v, p - 1.0):
            worst = max(worst, float(np.abs(value).max()))
    return worst


@pytest.mark.parametrize("contact", ["interface", "seam"])
@pytest.mark.parametrize("along", ["axial line", "radial line"])
def test_shaken_grid_keeps_a_stream(contact, along):
    """Every node is thrown about at every step; those on the axis along it."""
    n = 10
    random = np.random.default_rng(5)
    x, y = box((-1, 0), (1, 1), (2 * n, n))
    base = np.array([x + 0.1 * (1.0 - x * x) * np.cos(np.pi * y), y])
    if along == "axial line":
        x, y = box((-1, 0), (1, 1), (n, 2 * n))
        base = np.array([x, y + 0.2 * y * (1.0 - y) * np.cos(2.0 * x)])
    shakes = {}

    def law(name, t):
        if t not in shakes:
            shift = random.uniform(-0.2 / n, 0.2 / n, base.shape)
            middle = shift[:, n] if along == "radial line" else shift[:, :, n]
            if contact == "interface":
                middle[...] = 0.0
            shift[1, :, 0] = 0.0
            shift[0] += SPEED * t
            shakes[t] = base + shift
        nodes = shakes[t]
        if along == "radial line":
            return nodes[:, : n + 1] if name == "one" else nodes[:, n:]
        return nodes[:, :, : n + 1] if name == "one" else nodes[:, :, n:]

    densities = {"one": 1.0, "two": 1.0 if contact == "seam" else 3.0}
    one, two = (
        Block(
            name,
            GAS,
            law(name, 0.0),
            rho,
            SPEED,
            0.0,
            1.0,
            material="all" if contact == "seam" else name,
        )
        for name, rho in densities.items()
    )
    sides = ("i_max", "i_min") if along == "radial line" else ("j_max", "j_min")
    links = [join(contact, (one, sides[0]), (two, sides[1]))]
    for block in (one, two):
        for side in ("i_min", "i_max", "j_min", "j_max"):
            if side == sides[block is two]:
                continue
            if side == "j_min":
                put(block, side, "axis")
            else:
                state = (densities[block.name], SPEED, 0.0, 1.0)
                put(block, side, "inflow", state=state)
    simulation = Simulation([one, two], links, t_end=1e9, mesh=law, geometry="axisymmetric")
    rows = [simulation.start_row(), *march(simulation, 100)]
    assert measure_deviation(simulation, densities) < 1e-13
    check_budget(rows)
    assert "total_momentum_y" not in rows[0], "radial momentum is not conserved"


def make_tube(contact, sizes=(24, 31)):
    """A cylinder with a bent surface in a tube with a free outer surface, between pistons."""

    def line(x):
        return 0.5 + 0.05 * np.sin(np.pi * x)

    def surface(x):
        return 1.0 + 0.05 * np.cos(2.0 * np.pi * x)

    inner = Block("inner", GAS, make_grid((sizes[0], 8), lambda x: 0.0 * x, line), 1.0, SPEED, 0, 1)
    nodes = make_grid((sizes[1], 6), line, surface)
    leader = inner.nodes[:, :, -1]
    nodes[1, :, 0] = np.interp(nodes[0, :, 0], *leader)
    outer = Block("outer", GAS, nodes, 3.0, SPEED, 0.0, 1.0)
    pair = (inner, "j_max"), (outer, "j_min")
    link = slide(*pair) if contact == "sliding" else join(contact, *pair)
    put(inner, "j_min", "axis")
    put(outer, "j_max", "free-surface", pressure=1.0)
    for block in (inner, outer):
        put(block, "i_min", "piston", velocity=(SPEED, 0.0))
        put(block, "i_max", "piston", velocity=(SPEED, 0.0))
    return [inner, outer], [link]


@pytest.mark.parametrize("contact", ["sliding", "interface"])
def test_regridded_stream_with_contacts_and_free_surface(contact):
    sizes = (24, 31) if contact == "sliding" else (24, 24)
    blocks, links = make_tube(contact, sizes)
    simulation = Simulation(blocks, links, t_end=1e9, geometry="axisymmetric")
    rows = [simulation.start_row(), *march(simulation, 100)]
    assert measure_deviation(simulation, {"inner": 1.0, "outer": 3.0}) < 1e-13
    check_budget(rows)
    assert "total_momentum_y" not in rows[0], "radial momentum is not conserved"
    inner = simulation.blocks[0].nodes
    assert not inner[1, :, 0].any(), "nodes on the axis stay there"


@pytest.mark.parametrize("contact", ["sliding", "interface"])
def test_budgets_of_a_shocked_tube(contact):
    """Strong flow through everything: mass, axial momentum and energy to round-off."""
    sizes = (24, 31) if contact == "sliding" else (24, 24)
    blocks, links = make_tube(contact, sizes)
    for block in blocks:
        x = block.nodes[0, 1:, 0]
        block.state[1, 1:-1, 1:-1] = np.where(x < 0.0, 0.5, -0.5)[:, None]
        block.segments = [s for s in block.segments if s.side not in ("i_min", "i_max")]
        wall_off(block, "i_min", "i_max")
    simulation = Simulation(blocks, links, t_end=1e9, geometry="axisymmetric")
    rows = [simulation.start_row(), *march(simulation, 70)]
    check_budget(rows)
    assert "total_momentum_y" not in rows[0], "radial momentum is not conserved"
    assert rows[-1]["least_scaled_jacobian"] > 0.1
    moved = np.abs(blocks[0].state[2, 1:-1, 1:-1]).max()
    assert moved > 0.02, "there is radial motion"


def make_piston_run(eos, rho, p, speed, geometry):
    nodes = make_grid((40, 12), lambda x: 0.0, lambda x: 0.4, 0.0, 1.0)
    block = Block("rod", eos, nodes, rho, 0.0, 0.0, p)
    put(block, "j_min", "axis" if geometry == "axisymmetric" else "wall")
    put(block, "i_min", "piston", velocity=(speed, 0.0))
    wall_off(block)
    simulation = Simulation([block], [], t_end=1e9, geometry=geometry)
    check_budget([simulation.start_row(), *march(simulation, 60)])
    return block.state[:, 1:-1, 1:-1]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("eos", "rho", "p", "speed"), [(GAS, 1.0, 1.0, 3.0), (MieGruneisen(), 2707.0, 0.0, 2000.0)]
)
def test_a_plane_shock_along_the_axis_does_as_in_plane_flow(eos, rho, p, speed):
    state, plane = (make_piston_run(eos, rho, p, speed, g) for g in ("axisymmetric", "plane"))
    for value, other, size in zip(state, plane, (rho, speed, speed, state[3].max()), strict=True):
        assert np.ptp(value, axis=1).max() < 1e-12 * size
        assert np.abs(value - other).max() < 1e-11 * size


@pytest.mark.slow
def test_homologous_flow_near_the_axis():
    """v = r/(1 + t) at uniform pressure is exact; averages know where in a cell they belong."""
    edges = np.linspace(0.0, 1.0, 17)
    nodes = make_grid((3, 16), lambda x: 0.0, lambda x: 1.0, 0.0, 0.2)
    centre = 2.0 / 3.0 * np.diff(edges**3) / np.diff(edges**2)
    block = Block("gas", GAS, nodes, 1.0, 0.0, np.broadcast_to(centre, (3, 16)), 1.0)
    put(block, "j_min", "axis")
    put(block, "j_max", "inflow", state=lambda t: ((1 + t) ** -2, 0, 1 / (1 + t), (1 + t) ** -2.8))
    wall_off(block)
    march(Simulation([block], [], t_end=0.2, mesh="fixed", geometry="axisymmetric"))
    rho, _, v, _ = block.state[:, 1, 1:11]
    assert np.abs(rho * 1.2**2 - 1.0).max() < 2e-3
    assert np.abs(v * 1.2 / centre[:10] - 1.0).max() < 5e-3


def measure_expansion(cells, mesh):
    """Errors of (rho, u, v, p) in the sphere u = x/(1 + t) at t = 0.5: mean, in the axis row, most.

    Cells are compared with the flow at their centres of volume; the grid rests between open sides,
    or its nodes go with the gas between pistons.
    """
    first = make_grid((cells, cells), lambda x: 0.0, lambda x: 1.0)
    middle_y = 0.5 * (first[1, :1, 1:] + first[1, :1, :-1])
    x = 0.5 * (first[0, 1:, 1:] + first[0, :-1, 1:])
    y = np.broadcast_to(middle_y + (1.0 / cells) ** 2 / (12.0 * middle_y), x.shape)

    def compute_flow(x, y, t):
        size = 1.0 + t
        return np.array([0.0 * x + size**-3, x / size, y / size, 0.0 * x + size ** (-3 * 1.4)])

    follows = mesh == "follow"
    block = Block("gas", GAS, first, *compute_flow(x, y, 0.0))
    put(block, "j_min", "axis")
    for side, velocity in (("i_min", (-1.0, 0.0)), ("i_max", (1.0, 0.0)), ("j_max", (0.0, 1.0))):
        if follows:
            put(block, side, "piston", velocity=velocity)
            continue
        line = block.side_line(side, first)
        middle = 0.5 * (line[:, 1:] + line[:, :-1])
        put(block, side, "inflow", state=lambda t, at=middle: compute_flow(*at, t))
    simulation = Simulation(
        [block],
        [],
        t_end=0.5,
        cfl=0.6,
        mesh=(lambda name, t: first * (1.0 + t)) if follows else "fixed",
        geometry="axisymmetric",
    )
    march(simulation)
    scale = 1.5 if follows else 1.0
    error = np.abs(block.state[:, 1:-1, 1:-1] - compute_flow(scale * x, scale * y, 0.5))
    mean = (error * block.volume).sum(axis=(1, 2)) / block.volume.sum()
    return np.array([mean, error[:, :, 0].mean(axis=1), error.max(axis=(1, 2))])


@pytest.mark.parametrize(
    ("mesh", "orders", "mean"),
    [("fixed", (1.95, 1.75, 1.6), 1.1e-5), ("follow", (1.9, 1.6, 1.6), 3.5e-5)],
)
def test_smooth_flow_converges_in_second_order(mesh, orders, mean):
    """On the axis pressure and density are short of it by a logarithm.

    Between prediction and flux gradients do not age, so that neighbours disagree about a face's
    velocity by dt h: faces bear a pressure that the hoop, which has no faces, does not, and what
    balances the difference is h² log r.
    """
    errors = {cells: measure_expansion(cells, mesh) for cells in (16, 32, 64)}
    assert errors[32][0].max() < mean
    for coarse, fine in ((16, 32), (32, 64)):
        found = np.log2(errors[coarse] / errors[fine])
        for row, least in zip(found, orders, strict=True):
            assert (row > least).all(), (coarse, found)


def make_shaken_rod(threads=1):
    nodes = make_grid((70, 128), lambda x: 0.0, lambda x: 0.5 + 0.05 * np.sin(3 * x), 0.0, 1.0)
    x, y = nodes[:, 1:, 1:]
    block = Block("rod", GAS, nodes, 1.0 + 0.2 * np.sin(5 * x * y), 0.0, 0.0, 1.0 + x * y)
    put(block, "j_min", "axis")
    put(block, "j_max", "free-surface", pressure=1.0)
    wall_off(block, "i_min", "i_max")
    return Simulation([block], [], t_end=1e9, geometry="axisymmetric", threads=threads)


def test_restart_and_threads_give_the_same_bits():
    one = make_shaken_rod()
    two = make_shaken_rod(threads=2)
    march(one, 5)
    march(two, 5)
    assert get_bits(one) == get_bits(two)
    check_restarts(make_shaken_rod, [5], steps=5)
