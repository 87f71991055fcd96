"""Blocks bent on all four sides: curved lines, those between straight sides, and marches."""

import numpy as np
import pytest

from shockgrid.regrid.algebraic import fill_curves
from shockgrid.regrid.barrier.regridder import BarrierRegridder
from shockgrid.regrid.barrier.side_inputs import fill_family_weights, weigh_curves
from shockgrid.regrid.barrier.tuning import DEFAULT
from shockgrid.regrid.domains import make_domain
from shockgrid.regrid.measure.quality import measure_first_line_gap, measure_quality

# domain: least corner sine, largest first line gap at the sides that deform; a little beyond the
# figures of the marches (.527, 1.27; .308, 1.81; .28, 1.33; .411, 1.14; .410, 1.12; .316, 2.09;
# .613, 1.20).  On the swan no grid can have less: its top's arc over its chord is 1.85.
BENT = {
    "nozzle": (0.5, 1.4),
    "swan": (0.3, 1.85),
    "waves": (0.27, 1.4),
    "cushion": (0.4, 1.2),
    "pinched": (0.4, 1.15),
    "crescent": (0.31, 2.2),
    "bulged_chevron": (0.6, 1.25),
}
BOUNDS = DEFAULT.open_side, DEFAULT.closed_side, DEFAULT.curved_barrier, DEFAULT.half_barrier


def curves(boundary, share_i, share_j):
    curve = np.empty_like(boundary)
    fill_curves(boundary, share_i, share_j, curve)
    return curve


def last_sides(name, ni=24, nj=16):
    return np.ascontiguousarray(np.nan_to_num(make_domain(name, ni, nj).boundary(1.0)))


def march(domain, regridder):
    nodes = domain.start
    steps = domain.suggested_steps
    rescues = 0
    for step in range(1, steps + 1):
        result = regridder.regrid(nodes, domain.boundary(step / steps))
        nodes = result.nodes
        rescues = rescues + result.report.rescues + result.report.sub_moves
    return nodes, rescues


@pytest.mark.parametrize("name", BENT)
def test_march_of_four_bent_sides(name):
    domain = make_domain(name, 60, 40)
    nodes, rescues = march(domain, BarrierRegridder())
    quality = measure_quality(nodes)
    least, most = BENT[name]
    assert quality.bad_cells == 0 and rescues == 0
    assert quality.least_scaled_jacobian >= least
    assert max(measure_first_line_gap(nodes, side) for side in domain.deforming_sides) <= most
    assert quality.worst_aspect_ratio <= 11.0


@pytest.mark.parametrize("name", ["three_fingers", "strip", "chevron", "annulus"])
def test_a_pair_of_straight_sides_has_straight_lines_to_the_bit(name):
    domain = make_domain(name, 24, 16)
    end = domain.boundary(0.1)
    assert weigh_curves(np.nan_to_num(end), *BOUNDS) == (0.0, 0.0, 0.0)
    weights = np.empty(2)
    fill_family_weights(end, weights)
    free = BarrierRegridder().regrid(domain.start, end).nodes
    told = BarrierRegridder(family=tuple(weights)).regrid(domain.start, end).nodes
    assert np.array_equal(free, told)


def test_arcs_between_arcs_and_turned_blocks():
    radius, angle = np.meshgrid(np.linspace(1.0, 2.0, 9), np.linspace(0.0, 2.0, 13), indexing="ij")
    ring = np.array([radius * np.cos(angle), radius * np.sin(angle)])
    assert np.abs(curves(ring, 0.0, 1.0) - ring).max() < 1e-14
    sides = last_sides("nozzle")
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    turned = 2.0 * np.einsum("kl,lij->kij", turn, sides)
    expected = 2.0 * np.einsum("kl,lij->kij", turn, curves(sides, 0.3, 0.7))
    assert np.abs(curves(turned, 0.3, 0.7) - expected).max() < 1e-13
