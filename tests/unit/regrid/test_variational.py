"""[BrackbillSaltzman1982] and [IvanenkoCharakhchyan1988]: derivatives, exact grids, orders."""

import itertools

import numpy as np
import pytest

from builders import tensor
from regrid.barrier.tuning import Tuning
from regrid.barrier.workspace import Workspace
from regrid.equidistribution.weights import Weight
from regrid.errors import BadInput
from regrid.measure.corners import compute_corner_signs
from regrid.measure.quality import compute_corner_areas, find_bad_cells, measure_quality
from regrid.protocol import RegridReport
from regrid.variational.regridders import (
    BLOCK_CORNERS,
    IvanenkoCharakhchyanRegridder,
    ValidStart,
    VariationalFunctional,
    VariationalRegridder,
)


def graded_box(ni, nj, power=1.0):
    x, y = np.linspace(0.0, 1.0, ni + 1) ** power, np.linspace(0.0, 1.0, nj + 1) ** power
    return tensor(x, y)


def shaken(nodes, size, seed=1):
    nodes = nodes.copy()
    inner = nodes[:, 1:-1, 1:-1]
    inner += size * np.random.default_rng(seed).normal(size=inner.shape)
    return nodes


def make_functional(nodes, weight, **options):
    regridder = VariationalRegridder(**options)
    work = Workspace(nodes.shape[1] - 1, nodes.shape[2] - 1, regridder.threads)
    work.sides[:], work.base[:] = nodes, nodes
    work.begin(True, 0.0, 0.0, Tuning(epsilon=1.0, area_weight=0.0))
    excluded = np.zeros((4, work.ni, work.nj), dtype=bool)
    for corner in BLOCK_CORNERS:
        excluded[corner] = True
    report = RegridReport(0, 0, 0, 0, 1.0, 0.0, "displacement")
    functional = VariationalFunctional(regridder, work, ValidStart(nodes, report, excluded, False))
    functional.set_weight(weight)
    return functional, work


@pytest.mark.parametrize(
    "lambdas", [(1.0, 0.0, 0.0), (0.1, 2.0, 0.0), (0.1, 0.0, 3.0), (1.3, 2.0, 1.7)]
)
def test_gradient_is_that_of_the_functional(lambdas):
    nodes = shaken(graded_box(7, 6, 1.3), 0.02)
    weight = np.random.default_rng(2).uniform(1.0, 5.0, (7, 6))
    names = ("smoothness", "volume", "orthogonality")
    options = dict(zip(names, lambdas, strict=True))
    functional, work = make_functional(nodes, weight, **options)
    functional.solve()
    numerical = np.zeros_like(nodes)
    for k, i, j in np.ndindex(2, 5, 4):
        place, values = (k, i + 1, j + 1), []
        for step in (1e-6, -1e-6):
            moved = nodes.copy()
            moved[place] += step
            values.append(functional.measure(moved))
        numerical[place] = (values[0] - values[1]) / 2e-6
    inner = np.s_[:, 1:-2, 1:-2]
    scale = np.abs(numerical).max()
    assert np.abs(numerical - work.gradient)[inner].max() < 1e-7 * scale


def test_folded_and_infinite_grids_have_no_finite_value():
    nodes = graded_box(6, 5)
    functional, _ = make_functional(nodes, np.ones((6, 5)))
    assert np.isfinite(functional.measure(nodes))
    for value in (0.9, np.nan, np.inf):
        folded = nodes.copy()
        folded[0, 2, 2] = value
        assert functional.measure(folded) == np.inf


def test_steps_converge_from_a_shaken_grid_to_the_graded_rectangle():
    exact = graded_box(20, 15, 1.4)
    found = VariationalRegridder(steps=30, tolerance=1e-9).regrid(shaken(exact, 0.004), exact)
    assert found.report.residual <= 1e-9
    assert np.abs(found.nodes - exact).max() < 1e-10


def test_ring_of_similar_cells_is_exact_for_smoothness_alone():
    """r = exp(a q1), theta = a q2: every cell is its neighbour enlarged and turned."""
    q = np.linspace(0.0, 1.2, 17)
    exact = np.array([np.outer(np.exp(q), np.cos(q)), np.outer(np.exp(q), np.sin(q))])
    start = shaken(exact, 0.01)
    found = IvanenkoCharakhchyanRegridder(steps=40, tolerance=1e-10).regrid(start, exact)
    assert np.abs(found.nodes - exact).max() < 1e-9


def test_conformal_grid_is_second_order_for_smoothness_alone():
    """Of the maps with given sides the conformal one, here a square root, has the least I_s."""
    errors = []
    for steps in (8, 16, 32):
        a, b = np.meshgrid(*(np.linspace(0.2, 1.2, steps + 1),) * 2, indexing="ij")
        root = np.sqrt(a + 1j * b)
        exact = np.array([root.real, root.imag])
        found = IvanenkoCharakhchyanRegridder(steps=40, tolerance=1e-9).regrid(exact, exact)
        errors.append(np.abs(found.nodes - exact).max())
    assert errors[0] / errors[1] > 3.4 and errors[1] / errors[2] > 3.4, errors


def measure_spread(weight, nodes):
    products = Weight(weight).on(nodes, nodes)(nodes) * compute_corner_areas(nodes).sum(axis=0)
    return products.std() / products.mean()


@pytest.mark.parametrize("weight", ["1 + 10*y", "1 + 10*exp(-50*((x-0.5)**2 + (y-0.5)**2))"])
def test_more_weight_of_volume_leaves_less_spread_of_weight_times_area(weight):
    start, spreads = graded_box(24, 24), []
    for volume in (0.0, 1.0, 5.0, 25.0):
        found = VariationalRegridder(volume=volume, weight=weight, steps=40).regrid(start, start)
        assert measure_quality(found.nodes).least_scaled_jacobian > 0.4
        spreads.append(measure_spread(weight, found.nodes))
    for less, more in itertools.pairwise(spreads):
        assert more < 0.85 * less, spreads
    assert spreads[-1] < 0.15


def tensor_grid(steps):
    """ED2's exact grid for w = (1 + 10x)(1 + 5y)."""
    q = np.linspace(0.0, 1.0, steps + 1)
    x, y = ((np.sqrt(1.0 + c * (c + 2.0) * q) - 1.0) / c for c in (10.0, 5.0))
    return tensor(x, y)


def test_sides_that_follow_the_weight_make_the_tensor_grid_exact():
    regridder = VariationalRegridder(weight="(1 + 10*x)*(1 + 5*y)", boundary="equidistributed")
    found = regridder.regrid(graded_box(12, 12), graded_box(12, 12)).nodes
    assert np.abs(found - tensor_grid(12)).max() < 1e-12


def test_volume_alone_finds_the_tensor_grid_where_smoothness_wants_equal_lengths():
    errors = []
    for volume in (1e1, 1e2, 1e3):
        regridder = VariationalRegridder(
            volume=volume,
            orthogonality=0.0,
            weight="(1 + 10*x)*(1 + 5*y)",
            edge_lengths="unit",
            steps=100,
            tolerance=1e-7,
        )
        found = regridder.regrid(tensor_grid(12), tensor_grid(12)).nodes
        errors.append(np.abs(found - tensor_grid(12)).max())
    assert errors[2] < 0.02 * errors[0] and errors[1] < 0.2 * errors[0], errors


def test_orthogonality_turns_corners_to_right_angles():
    q = np.linspace(0.0, 1.0, 17)
    a, b = np.meshgrid(q, q, indexing="ij")
    start = np.array([a + 0.3 * np.sin(np.pi * b) * (1.0 - a), b])
    deviations = []
    for weight in (0.0, 10.0):
        options = {"volume": 0.0, "orthogonality": weight, "edge_lengths": "unit"}
        nodes = VariationalRegridder(steps=40, **options).regrid(start, start).nodes
        along = nodes[:, 2:, 1:-1] - nodes[:, :-2, 1:-1]
        across = nodes[:, 1:-1, 2:] - nodes[:, 1:-1, :-2]
        cosine = (along * across).sum(axis=0) / np.hypot(*along) / np.hypot(*across)
        deviations.append(np.sqrt((cosine**2).mean()))
    assert deviations[1] < 0.8 * deviations[0], deviations


def test_side_in_one_point_leaves_its_triangles_out():
    """A sector: the corner triangles on the axis have no area; all others stay positive."""
    r, angle = np.linspace(0.0, 1.0, 13), np.linspace(0.0, 1.2, 9)
    sector = np.array([np.outer(r, np.cos(angle)), np.outer(r, np.sin(angle))])
    start = sector.copy()
    noise = np.random.default_rng(3).normal(size=(2, 11, 7))
    start[:, 1:-1, 1:-1] += 0.01 * r[1:-1, None] * noise
    found = VariationalRegridder(steps=20).regrid(start, 1.1 * sector)
    signs = compute_corner_signs(found.nodes)
    assert found.report.exempt_corners == 16 == (signs <= 0).sum()
    assert (signs[1:3, 1:] == 1).all() and (signs[:, 1:] == 1).all()
    assert found.report.residual < 1e-2


def test_barrier_alone_leaves_the_first_line_behind_in_a_tongue():
    """[CharakhchyanND] Fig 1, 3: without straight lines the grid does not enter the tongues."""
    from regrid.barrier.regridder import BarrierRegridder
    from regrid.domains.plane import make_domain
    from regrid.measure.quality import measure_first_line_gap

    moving, gaps = make_domain("three_fingers", 30, 24), []
    for regridder in (IvanenkoCharakhchyanRegridder(), BarrierRegridder()):
        nodes, steps = moving.start, 80
        for step in range(1, steps + 1):
            nodes = regridder.regrid(nodes, moving.boundary(step / steps)).nodes
            assert len(find_bad_cells(nodes)) == 0
        gaps.append(measure_first_line_gap(nodes))
    assert gaps[0] > 4.0 * gaps[1] and gaps[1] < 1.3


def test_options_that_cannot_be_are_bad_input():
    for options in (
        {"smoothness": 0.0},
        {"volume": -1.0},
        {"orthogonality": -1.0},
        {"edge_lengths": "equal"},
        {"boundary": "free"},
        {"weight": "own", "boundary": "equidistributed"},
        {"smoothing": -1},
    ):
        with pytest.raises(BadInput):
            VariationalRegridder(**options)
