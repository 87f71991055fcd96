"""Gauges: interpolation, the block that a point lies in, points that go with the material."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from shockgrid.problems.deck import Gauge
from shockgrid.regrid.measure.corners import compute_centres
from shockgrid.runs.gauges import Gauges, place_points

FIELDS = ("rho", "u", "v", "p", "e", "c")


def make_block(nodes, fields, name="gas", material="gas"):
    centres = compute_centres(nodes)
    values = {key: function(*centres) for key, function in fields.items()}
    return SimpleNamespace(name=name, material=material, nodes=nodes, cell_fields=values, units={})


def distort(ni, nj, phase=0.0, low=(0.0, 0.0), size=(1.0, 1.0)):
    """A wavy grid of quadrilaterals, no two alike, whose outline waves as well."""
    a, b = np.meshgrid(np.linspace(0, 1, ni + 1), np.linspace(0, 1, nj + 1), indexing="ij")
    x = a + 0.06 * np.sin(5.0 * b + phase) + 0.03 * np.sin(7.0 * a)
    y = b + 0.05 * np.sin(4.0 * a - phase) + 0.3 * a
    return np.array([low[0] + size[0] * x, low[1] + size[1] * y])


def make_linear(number):
    return lambda x, y: 5.0 + number + (2.0 - number) * x + (0.5 + number) * y


@pytest.mark.parametrize(("ni", "nj"), [(7, 9), (2, 2), (24, 5)])
def test_linear_fields_are_exact_on_a_grid_that_moves(ni, nj):
    fields = {name: make_linear(number) for number, name in enumerate(FIELDS)}
    chance = np.random.default_rng(ni)
    inside = chance.uniform(0.02, 0.98, (2, 40))
    points = []
    for a, b in inside.T:  # of the first grid, up to its very sides
        x = a + 0.06 * np.sin(5.0 * b) + 0.03 * np.sin(7.0 * a)
        at = x, b + 0.05 * np.sin(4.0 * a) + 0.3 * a
        points.append(Gauge(name="g", at=at, fields=FIELDS))
    places = place_points(points, [make_block(distort(ni, nj), fields)])
    counted = 0
    for phase in (0.0, 0.4, 0.8, 1.2):
        block = make_block(distort(ni, nj, phase), fields)
        places.locate([block])
        found = places.sample([block], FIELDS)
        there = places.block == 0
        counted += int(there.sum())
        for name, function in fields.items():
            exact = function(*places.position)
            assert np.abs(found[name] - exact)[there].max() < 2e-14 * np.abs(exact).max()
            assert np.isnan(found[name][~there]).all()
    assert counted > 120


class Carried:
    """Two blocks in a flow u = -rate y + u0, v = rate x, whose grids wave in time."""

    def __init__(self, rate=1.0, u0=0.0, v0=0.0, materials=("gas", "gas")):
        self.t = 0.0
        self.step = 0
        self.materials = materials
        self.fields = {
            "u": lambda x, y: u0 - rate * y,
            "v": lambda x, y: v0 + rate * x,
            "rho": lambda x, y: 1.0 + 0.0 * x,
        }
        self.make()

    def make(self):
        self.blocks = []
        for k, material in enumerate(self.materials):
            a, b = np.meshgrid(np.linspace(-2, 0, 9), np.linspace(-2, 2, 13), indexing="ij")
            nodes = np.array([a + 2.0 * k, b + 0.05 * np.sin(a + 2.0 * k + self.t)])
            self.blocks.append(make_block(nodes, self.fields, f"{material}{k}", material))

    def go(self, dt):
        self.t = self.t + dt
        self.step = self.step + 1
        self.make()


def test_a_tracer_in_solid_rotation_is_of_second_order():
    errors = []
    for steps in (40, 80, 160):
        flow = Carried()
        gauges = Gauges([Gauge(name="g", at=(1.1, 0.3), moves=True, fields=["rho"])], flow)
        for _ in range(steps):
            flow.go(4.0 / steps)
            gauges.follow()
        c = np.cos(4.0)
        s = np.sin(4.0)
        exact = np.array([c * 1.1 - s * 0.3, s * 1.1 + c * 0.3])
        errors.append(np.hypot(*(gauges.places.position[:, 0] - exact)))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (orders > 1.9).all() and (orders < 2.2).all() and errors[-1] < 2e-3
