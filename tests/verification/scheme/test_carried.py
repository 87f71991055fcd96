"""Carried fields: constants, sums, bounds and order are kept wherever mass crosses a face."""

from __future__ import annotations

import numpy as np
import pytest

from builders import beside_line, box, check_restarts, get_bits, march, wall_off
from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.carried.fields import CarriedField
from shockgrid.hydro.eos import IdealGas
from shockgrid.hydro.formulas.geometry import GEOMETRIES
from shockgrid.hydro.links import join, slide
from shockgrid.hydro.remap.conserved import remap_state
from shockgrid.hydro.remap.overlay import compute_cell_moments
from shockgrid.hydro.simulation import Simulation
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.measure.corners import compute_centres
from thread_ranks import compare_with_ranks

GAS = IdealGas(1.4)
CONSTANT = 1.0 / 3.0
ONE = CarriedField("one", first=CONSTANT)
DISC = CarriedField("disc", first=lambda x, y: 1.0 * (np.hypot(x - 0.45, y - 0.5) < 0.2))
RADIUS_SHIFT = 0.5  # of the axisymmetric box


def swing(nodes):
    """A motion of all inner nodes of a box of width 1."""
    x, y = nodes
    wave = np.sin(np.pi * x) * np.sin(np.pi * (y - y.min()))

    def law(name, t):
        return nodes + 0.05 * np.sin(7.0 * t) * np.array([wave, -wave])

    return law


def make_gust(cells=24, fields=(ONE, DISC), geometry="plane", **options):
    """Gas that is driven about in a closed box, on a grid that swings."""
    nodes = box((0.0, 0.0), (1.0, 1.0), (cells, cells))
    x, y = compute_centres(nodes)
    if geometry == "axisymmetric":
        nodes[1] += RADIUS_SHIFT
    state = 1.0 + 0.3 * np.sin(5.0 * x + 2.0 * y), 0.9 * np.sin(3.0 * y), 0.7 * np.cos(4.0 * x)
    shifted = [
        CarriedField(f.name, first=f.first(x, y) if callable(f.first) else f.first) for f in fields
    ]
    block = Block("gas", GAS, nodes, *state, 1.0, carried=shifted)
    wall_off(block)
    return Simulation([block], [], t_end=0.4, mesh=swing(nodes), geometry=geometry, **options)


def make_slip(fields=(ONE,)):
    """Two gases slip on each other along a contact on which a shock falls; polygon cells."""
    lower = box((0.0, -0.5), (1.0, 0.0), (16, 10))
    upper = box((0.0, 0.0), (1.0, 0.5), (23, 10))
    low = Block("low", GAS, lower, 1.0, 0.0, 0.0, 1.0, carried=fields)
    high = Block("high", GAS, upper, 1.0, 0.7, 0.0, 1.0, carried=fields)
    links = [join("periodic", (block, "i_min"), (block, "i_max")) for block in (low, high)]
    put(low, "j_min", "piston", velocity=(0.0, 0.8))
    put(high, "j_max", "wall")
    links.append(slide((low, "j_max"), (high, "j_min")))
    return Simulation([low, high], links, t_end=0.3)


def make_front(fields=(ONE,)):
    """A shocked, bent interface: lines that are smoothed, regridded grids, small cells."""
    grids = beside_line(lambda y: 0.08 * np.cos(np.pi * y), (20, 16))
    left = Block("left", GAS, grids[0], 1.0, 1.2, 0.0, 2.5, carried=fields)
    right = Block("right", GAS, grids[1], 3.0, 0.0, 0.0, 1.0, carried=fields)
    links = [join("interface", (left, "i_max"), (right, "i_min"))]
    wall_off(left)
    wall_off(right)
    return Simulation([left, right], links, t_end=0.4)


def sum_up(simulation):
    """Mass times each field, over all blocks."""
    total = 0.0
    for block in simulation.blocks:
        mass = block.volume * block.state[0, 1:-1, 1:-1]
        total = total + (mass * block.carried[:, 1:-1, 1:-1]).sum(axis=(1, 2))
    return total


@pytest.mark.parametrize("geometry", list(GEOMETRIES))
def test_constants_sums_and_bounds_on_a_grid_that_swings(geometry):
    simulation = make_gust(geometry=geometry)
    before = sum_up(simulation)
    march(simulation)
    one, disc = simulation.blocks[0].carried[:, 1:-1, 1:-1]
    assert (one == CONSTANT).all(), "to the bit"
    assert sum_up(simulation) == pytest.approx(before, rel=1e-13)
    assert disc.min() > -1e-3 and disc.max() < 1.0 + 1e-3
    assert disc.max() > 0.8, "it is not smeared away"


@pytest.mark.parametrize("make", [make_slip, make_front])
def test_constants_and_sums_where_contacts_move_mass_along_themselves(make):
    graded = CarriedField("graded", first=lambda x, y: 0.5 + 0.3 * np.sin(6.0 * x + y))
    simulation = make(fields=(ONE, graded))
    before = sum_up(simulation)
    march(simulation)
    assert sum_up(simulation) == pytest.approx(before, rel=1e-12)
    for block in simulation.blocks:
        assert np.abs(block.carried[0, 1:-1, 1:-1] - CONSTANT).max() < 1e-13, block.name
        assert np.ptp(block.carried[1, 1:-1, 1:-1]) > 0.2


def miss_wave(cells):
    """Mean error of a wave that is carried through a period on a grid that swings."""

    def wave(x, y):
        return np.sin(2.0 * np.pi * x) * np.cos(2.0 * np.pi * y)

    nodes = box((0.0, 0.0), (1.0, 1.0), (cells, cells))
    fields = [CarriedField("wave", first=wave)]
    block = Block("gas", GAS, nodes, 1.0, 1.0, 0.5, 1.0, carried=fields)
    links = [join("periodic", (block, f"{d}_min"), (block, f"{d}_max")) for d in "ij"]
    simulation = Simulation([block], links, t_end=1.0, mesh=swing(nodes))
    march(simulation)
    x, y = compute_centres(block.nodes)
    return np.abs(block.carried[0, 1:-1, 1:-1] - wave(x - 1.0, y - 0.5)).mean()


def test_second_order_on_a_grid_that_swings():
    assert np.log2(miss_wave(24) / miss_wave(48)) > 1.8


def test_the_flow_has_the_bits_that_it_has_without():
    for make in (make_gust, make_slip):
        with_fields, without = make(), make(fields=())
        march(with_fields)
        march(without)
        bits = get_bits(with_fields)
        assert get_bits(without) == {n: v for n, v in bits.items() if not n.endswith("/carried")}


def test_restarts_and_ranks_go_on_with_the_same_bits():
    check_restarts(make_gust, [3, 11])
    check_restarts(make_slip, [4])
    compare_with_ranks(lambda: make_slip((ONE, DISC)), 8, (2,))
    compare_with_ranks(lambda: make_gust(70), 8, (3,), places=[(2, 0, 1)])


def test_squeezed_cells_share_what_they_carry():
    steps = np.ones(40)
    steps[20] = 0.1
    x = np.concatenate([[0.0], np.cumsum(steps)])
    nodes = np.array(np.meshgrid(x / x[-1], np.linspace(0.0, 0.3, 7), indexing="ij"))
    u = 0.3 * np.sin(3.0 * compute_centres(nodes)[0])
    block = Block("gas", GAS, nodes, 1.0, u, 0.1, 1.0, carried=(ONE, DISC))
    wall_off(block)
    simulation = Simulation([block], [], t_end=0.4, mesh="fixed", small_cells=0.05)
    before = sum_up(simulation)
    march(simulation, 30)
    assert simulation.small_cells.redistributed_count > 0
    assert sum_up(simulation) == pytest.approx(before, rel=1e-13)
    one, disc = block.carried[:, 1:-1, 1:-1]
    assert np.abs(one - CONSTANT).max() < 1e-14
    assert disc.min() > -0.01 and disc.max() < 1.01


@pytest.mark.parametrize("geometry", list(GEOMETRIES))
def test_remapped_cells_keep_constants_and_sums(geometry):
    curved = GEOMETRIES[geometry].curved
    old = box((0.0, 0.5), (1.0, 1.5), (20, 17))
    new = box((0.0, 0.5), (1.0, 1.5), (31, 9))
    x, y = compute_centres(old)
    state = np.array([1.0 + 0.3 * np.sin(5.0 * x), 0.2 * y, 0.1 * x, 1.0 + 0.1 * y])
    carried = np.array([np.full(x.shape, CONSTANT), 0.5 + 0.5 * np.sin(7.0 * y + x)])
    held = {"state": state, "void_energy": np.zeros(x.shape), "carried": carried}
    found, _ = remap_state("gas", GAS, curved, old, held, new)

    def total(nodes, held):
        volumes, _ = compute_cell_moments(nodes, curved)
        return (volumes * held["state"][0] * held["carried"]).sum(axis=(1, 2))

    assert total(new, found) == pytest.approx(total(old, held), rel=1e-13)
    assert np.abs(found["carried"][0] - CONSTANT).max() < 1e-14
    assert found["carried"][1].min() > -0.01 and found["carried"][1].max() < 1.01


def test_material_comes_in_with_the_values_that_are_given():
    nodes = box((0.0, 0.0), (1.0, 0.2), (40, 4))
    block = Block("gas", GAS, nodes, 1.0, 1.0, 0.0, 1.0, carried=(ONE, CarriedField("dye")))
    values = {"one": CONSTANT, "dye": 0.25}
    put(block, "i_min", "inflow", state=(1.0, 1.0, 0.0, 1.0), carried=values)
    put(block, "i_max", "outflow")
    wall_off(block)
    simulation = Simulation([block], [], t_end=0.5, mesh="fixed")
    march(simulation)
    one, dye = block.carried[:, 1:-1, 1:-1]
    assert (one == CONSTANT).all()
    x = compute_centres(nodes)[0]
    assert (dye * block.volume).sum() == pytest.approx(0.25 * 0.1, rel=1e-12), "all that came in"
    assert np.abs(dye[x < 0.35] - 0.25).max() < 1e-3 and np.abs(dye[x > 0.65]).max() < 1e-3


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: CarriedField("rho"), "which the flow has already"),
        (lambda: CarriedField("a dye"), "letters, digits and _"),
        (lambda: CarriedField("dye", least=1.0, most=0.0), "not below"),
        (lambda: make_gust(fields=(ONE, ONE)), "2 carried fields"),
        (lambda: make_gust(fields=(CarriedField("dye", first=np.zeros(3)),)), "24 x 24 cells"),
    ],
)
def test_fields_that_make_no_sense_are_refused(make, said):
    with pytest.raises(BadInput, match=said):
        make()


def test_fields_out_of_bounds_and_missing_ones_are_refused():
    nodes = box((0.0, 0.0), (1.0, 1.0), (4, 4))
    state = 1.0, 0.0, 0.0, 1.0
    dye = CarriedField("dye", first=2.0, most=1.0)
    with pytest.raises(BadInput, match="a value is 2"):
        Block("gas", GAS, nodes, *state, carried=[dye])
    one = Block("one", GAS, nodes, *state, carried=[ONE])
    with pytest.raises(BadInput, match="carries 'one'"):
        put(one, "i_min", "inflow", state=state)
    two = Block("two", GAS, nodes + np.array([1.0, 0.0])[:, None, None], *state)
    with pytest.raises(BadInput, match="their carried fields differ"):
        join("seam", (one, "i_max"), (two, "i_min"))
