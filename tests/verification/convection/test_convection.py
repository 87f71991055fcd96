"""Convection against spectral numbers, linear theory, exact and manufactured solutions."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from builders import march
from shockgrid.hydro.convection.box import PERIODIC, Fluid, adiabatic, isothermal, make_fluid
from shockgrid.hydro.convection.equations import Equations
from shockgrid.hydro.convection.march import March
from shockgrid.hydro.convection.measure import (
    compute_growth,
    find_onset,
    measure_energy,
    solve_rest,
)
from shockgrid.hydro.convection.steady import restrict_nodes
from shockgrid.problems.convection.heated_cavity import HeatedCavity, HeatedCavityDeck
from shockgrid.problems.references.convection import (
    FREE_LAYER_ONSET,
    FREE_LAYER_WAVENUMBER,
    LAYER_ONSET,
    LAYER_WAVENUMBER,
    STATES,
    compute_layer_growth,
)

QUANTITIES = ("nusselt", "u_max", "v_max", "nusselt_max")
PLACES = ("u_max_y", "v_max_x", "nusselt_max_y")


def solve_cavity(rayleigh: float, cells: int) -> dict[str, float]:
    problem = HeatedCavity(HeatedCavityDeck(rayleigh=rayleigh, cells=cells))
    evolution = problem.build()
    march(evolution)
    assert evolution.finished == "steady"
    return problem.measure(evolution)


def check_cavity(rayleigh: float, cells: tuple[int, int], errors, places: float, order: float):
    """Errors of the finer grid within `errors`; extrapolation to 1e-4; orders above `order`."""
    coarse, fine = (solve_cavity(rayleigh, n) for n in cells)
    reference = STATES[rayleigh]
    for quantity, allowed in zip(QUANTITIES, errors, strict=True):
        exact = getattr(reference, quantity)
        assert fine[quantity] == pytest.approx(exact, rel=allowed), quantity
        seen = math.log2(abs((coarse[quantity] - exact) / (fine[quantity] - exact)))
        assert seen > order, quantity
    for place in PLACES:
        assert fine[place] == pytest.approx(getattr(reference, place), abs=places), place
    limit = fine["nusselt"] + (fine["nusselt"] - coarse["nusselt"]) / 3.0
    assert limit == pytest.approx(reference.nusselt, rel=1e-4)


@pytest.mark.parametrize("rayleigh", [1e3, 1e4, 1e5])
def test_cavity_at_41(rayleigh):
    check_cavity(rayleigh, (20, 40), (1e-3, 4e-3, 5e-3, 4e-3), 2e-3, 1.6)


def test_cavity_at_81_and_a_million():
    found = solve_cavity(1e6, 80)
    reference = STATES[1e6]
    assert found["nusselt"] == pytest.approx(reference.nusselt, rel=2e-4)
    for quantity, allowed in zip(QUANTITIES[1:], (3e-3, 2e-3, 4e-3), strict=True):
        assert found[quantity] == pytest.approx(getattr(reference, quantity), rel=allowed)


LAYERS = {
    "no-slip": (LAYER_ONSET, LAYER_WAVENUMBER),
    "free": (FREE_LAYER_ONSET, FREE_LAYER_WAVENUMBER),
}


def make_layer(flow: str, cells: int) -> Equations:
    x, y = (
        np.linspace(0.0, 2.0 * math.pi / LAYERS[flow][1], cells + 1),
        np.linspace(0, 1, cells + 1),
    )
    walls = {"i_min": PERIODIC, "i_max": PERIODIC}
    walls |= {"j_min": isothermal(0.5, flow), "j_max": isothermal(-0.5, flow)}
    return Equations(x, y, walls)


@pytest.mark.parametrize("flow", LAYERS)
def test_onset_and_growth_in_a_layer(flow):
    onset, wavenumber = LAYERS[flow]
    errors = []
    for cells in (20, 40):
        equations = make_layer(flow, cells)
        fluid = make_fluid(1.0, 0.71)
        errors.append(find_onset(equations, fluid, 0.5 * onset, 2.0 * onset, 1e-7) / onset - 1.0)
        fast = fluid.at_rayleigh(3.0 * onset)
        rate = compute_growth(equations, fast, *solve_rest(equations, fast))[0]
        theory = compute_layer_growth(3.0 * onset, 0.71, wavenumber, flow == "free")
        errors.append(rate / theory - 1.0)
    assert abs(errors[2]) < 4e-3 and abs(errors[3]) < 5e-3
    for coarse, fine in zip(errors[:2], errors[2:], strict=True):
        assert 1.9 < math.log2(coarse / fine) < 2.1


def test_a_disturbance_grows_in_time_as_its_eigenvalue_says():
    equations = make_layer("no-slip", 20)
    fluid = make_fluid(4000.0, 0.71)
    psi, temperature = solve_rest(equations, fluid)
    rate, flow, heat = compute_growth(equations, fluid, psi, temperature)
    errors = []
    for steps in (40, 80):
        start = psi + 1e-6 * flow, temperature + 1e-6 * heat
        march = March(equations, fluid, *start)
        before = measure_energy(equations, march.level.psi)
        for _ in range(steps):
            march.advance(0.2 / steps)
        seen = 0.5 * math.log(measure_energy(equations, march.level.psi) / before) / 0.2
        errors.append(abs(seen / rate - 1.0))
    assert errors[1] < 2e-3 and math.log2(errors[0] / errors[1]) > 1.8


class Manufactured:
    """psi = a(t) f(x) g(y), T = b(t) h(x) k(y): no-slip; T = 0 at x = 0, 1; dT/dy = 0."""

    viscosity = 0.7
    buoyancy = (3.0, 50.0)
    x = Polynomial([0.0, 1.0])
    f = 40.0 * x**2 * (1.0 - x) ** 2 * (1.0 + 0.5 * x)
    g = x**2 * (1.0 - x) ** 2
    h = 4.0 * x * (1.0 - x) * (1.0 + x)
    k = 1.0 - 6.0 * x**2 + 4.0 * x**3

    @staticmethod
    def place(cells: int, t: float) -> tuple[np.ndarray, np.ndarray]:
        """The moving grid: both axes sway smoothly, by up to a coarse cell."""
        s = np.linspace(0.0, 1.0, cells + 1)
        x = s + 0.06 * math.sin(5.0 * t) * np.sin(np.pi * s)
        y = s + 0.03 * math.cos(4.0 * t) * np.sin(2.0 * np.pi * s)
        x[-1] = y[-1] = 1.0
        return x, y

    def amplitudes(self, t: float) -> tuple[float, float, float, float]:
        """a, b and their derivatives."""
        a = 2.0 + math.sin(3.0 * t)
        b = 1.0 + 0.5 * math.cos(2.0 * t)
        return a, b, 3.0 * math.cos(3.0 * t), -math.sin(2.0 * t)

    def psi(self, x, y, t):
        return self.amplitudes(t)[0] * self.f(x) * self.g(y)

    def u(self, x, y, t):
        return self.amplitudes(t)[0] * self.f(x) * self.g.deriv()(y)

    def v(self, x, y, t):
        return -self.amplitudes(t)[0] * self.f.deriv()(x) * self.g(y)

    def temperature(self, x, y, t):
        return self.amplitudes(t)[1] * self.h(x) * self.k(y)

    def forces(self, x, y, t):
        """What has to push in x and in y, and the heat to be given, at points."""
        a, b, a_t, b_t = self.amplitudes(t)
        f = [self.f(x), *(self.f.deriv(n)(x) for n in (1, 2, 3))]
        g = [self.g(y), *(self.g.deriv(n)(y) for n in (1, 2, 3))]
        h = [self.h(x), *(self.h.deriv(n)(x) for n in (1, 2))]
        k = [self.k(y), *(self.k.deriv(n)(y) for n in (1, 2))]
        heat = b * h[0] * k[0]
        across = a_t * f[0] * g[1] + a * a * f[0] * f[1] * (g[1] ** 2 - g[0] * g[2])
        across -= self.viscosity * a * (f[2] * g[1] + f[0] * g[3]) + self.buoyancy[0] * heat
        up = -a_t * f[1] * g[0] + a * a * g[0] * g[1] * (f[1] ** 2 - f[0] * f[2])
        up -= -self.viscosity * a * (f[3] * g[0] + f[1] * g[2]) + self.buoyancy[1] * heat
        source = b_t * h[0] * k[0] - b * (h[2] * k[0] + h[0] * k[2])
        source += a * b * (f[0] * g[1] * h[1] * k[0] - f[1] * g[0] * h[0] * k[1])
        return across, up, source

    def sources(self, equations: Equations, t: float) -> tuple[np.ndarray, np.ndarray]:
        x, y = equations.axes
        momentum = equations.momentum
        volumes = equations.split_faces(momentum.lengths * momentum.reaches)
        across = self.forces(x.nodes[:, None], y.centres, t)[0] * volumes[0]
        up = self.forces(x.centres[:, None], y.nodes, t)[1] * volumes[1]
        heat = self.forces(x.centres[:, None], y.centres, t)[2].ravel() * equations.areas
        return np.concatenate([across.ravel(), up.ravel()]), heat

    def march(self, cells: int, steps: int, t_end: float = 0.3) -> tuple[March, float]:
        """The state at t_end and the largest volume lost in a cell on the way."""
        walls = {"i_min": isothermal(0.0), "i_max": isothermal(0.0)}
        walls |= {"j_min": adiabatic(), "j_max": adiabatic()}
        equations = Equations(*self.place(cells, 0.0), walls)
        x, y = equations.axes
        psi = restrict_nodes(equations, self.psi(x.nodes[:, None], y.nodes, 0.0))
        heat = self.temperature(x.centres[:, None], y.centres, 0.0).ravel()
        fluid = Fluid(self.viscosity, 1.0, self.buoyancy)
        march = March(equations, fluid, psi, heat, sources=self.sources)
        lost = 0.0
        for step in range(1, steps + 1):
            march.advance(t_end / steps, self.place(cells, step * t_end / steps))
            lost = max(lost, np.abs(march.equations.compute_divergence(march.level.psi)).max())
        return march, lost

    def run(self, cells: int, steps: int) -> np.ndarray:
        """(largest errors of u, v, T, mean ones, volume lost in a cell) at the end."""
        march, lost = self.march(cells, steps)
        equations = march.equations
        t = march.t
        x, y = equations.axes
        u, v = equations.compute_velocities(march.level.psi)
        errors = [
            u - self.u(x.nodes[:, None], y.centres, t),
            v - self.v(x.centres[:, None], y.nodes, t),
            march.level.temperature.reshape(equations.shape)
            - self.temperature(x.centres[:, None], y.centres, t),
        ]
        largest = [np.abs(error).max() for error in errors]
        return np.array([*largest, *(np.sqrt((error**2).mean()) for error in errors), lost])


def test_manufactured_solution_on_a_moving_grid():
    runs = [Manufactured().run(cells, steps) for cells, steps in ((16, 24), (32, 48))]
    orders = np.log2(runs[0] / runs[1])
    assert (orders[3:6] >= 1.9).all(), orders
    assert (orders[:3] >= 1.8).all(), orders
    assert max(run[6] for run in runs) < 1e-15
    assert (runs[1][:3] < [0.02, 0.02, 0.006]).all()


def test_second_order_in_time_on_a_moving_grid():
    """Steps are halved, the grid's motion and its cells stay: differences fall to a quarter.

    Little friction, so that what the fluid carries counts; with all errors of space in them, the
    orders of the test before would hide a first-order term.
    """
    problem = Manufactured()
    problem.viscosity = 0.02
    ends = [problem.march(12, steps)[0].level for steps in (40, 80, 160)]
    for name in ("velocity", "temperature"):
        first, second = (
            np.abs(getattr(one, name) - getattr(other, name)).max() for one, other in pairwise(ends)
        )
        assert 1.9 < math.log2(first / second) < 2.3, name
    assert second > 1e-6, "steps this long leave something to see"
