"""Rayleigh–Taylor growth of a heavy gas on a light one, or a wave on a free surface.

The box has walls, half a wave of wavelength 1, height 1 on either side of y = 0, and gravity 1
downwards.  With `above` "heavy", gas of density 2 lies over gas of density 1, and a small wave on
the interface grows as cosh(rate t); without compression rate² = g k/3 tanh k, rate = 1.447197.
With "nothing", the wave oscillates on a free surface under constant pressure with omega² = g k tanh
k, omega = 2.506620.  Surface `tension` sigma reduces rate² by sigma k³/3 tanh k, so that from sigma
= g/k² = 0.025330 on the wave oscillates, and adds sigma k³ tanh k to omega².  Both layers are
isentropic, so that only the interface can become unstable, and start in equilibrium; `sound_speed`
makes them nearly incompressible.

The rate follows from the amplitude at three times a third of the run apart,
a1 + a3 = 2 a2 cosh(rate T); omega from the times of zero amplitude.  Note: gas that does not start
in equilibrium oscillates vertically, and the interface with it.
"""

import math
from typing import ClassVar, Literal

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import IdealGas
from shockgrid.hydro.links import join
from shockgrid.hydro.sources import make_gravity
from shockgrid.problems.deck import MOST_CELLS, Deck, Regrid, RunControl, key
from shockgrid.problems.initial_states import put_walls
from shockgrid.problems.pictures import draw_columns
from shockgrid.problems.problem import Problem
from shockgrid.problems.references.exact_flows import compute_gravity_mode, compute_isentropic_layer
from shockgrid.problems.report import Report, Row, RunSoFar
from shockgrid.problems.signals import find_frequency, find_growth_rate
from shockgrid.regrid.measure.corners import compute_centres

GAS_GAMMA = 5.0 / 3.0
WAVE_NUMBER = 2.0 * math.pi
GRAVITY_ACCELERATION = 1.0
STEEPEST_LINEAR_KA = 0.1  # steepest wave for linear theory, whose next term is (k a)²


class RayleighTaylorDeck(Deck, kw_only=True):
    run: RunControl = RunControl(cfl=0.8)
    regrid: Regrid = Regrid()
    above: key(Literal["heavy", "nothing"], "a heavy gas, or a free surface") = "heavy"
    cells: key(int, "cells in a wavelength", ge=8, le=MOST_CELLS) = 64
    amplitude: key(float | None, "first amplitude [m]. If left out: small", ge=1e-8, lt=0.2) = None
    sound_speed: key(float, "of the lower gas at the interface [m/s]", ge=1.2, le=1000) = 10.0
    tension: key(float, "of the surface [N/m]", ge=0, le=1000) = 0.0


class RayleighTaylor(Problem):
    Deck = RayleighTaylorDeck
    t_unit = "1"
    counted = ("cells", "columns", "layers")
    units: ClassVar = {"amplitude": "m"}

    def __init__(self, deck: RayleighTaylorDeck):
        super().__init__(deck)
        # at y = 0
        self.heavy = deck.above == "heavy"
        self.pressure = deck.sound_speed**2 / GAS_GAMMA
        wave = WAVE_NUMBER, GRAVITY_ACCELERATION, 2.0 if self.heavy else 0.0
        square = compute_gravity_mode(*wave, deck.tension)
        if square == 0.0:
            raise deck.error("tension", "there the wave neither grows nor swings")
        self.grows = square > 0.0
        self.exact = math.sqrt(abs(square))
        self.columns = max(4, deck.cells // 2)
        self.layers = 1 + self.heavy
        self.amplitude = deck.amplitude or (1e-4 if self.heavy else 1e-3)
        rate = math.sqrt(abs(compute_gravity_mode(*wave, 0.0)))
        usual = (3.0 if self.heavy else 6.0) * (rate / self.exact)
        swings = self.heavy and not self.grows  # by surface tension
        self.t_end = deck.run.t_end or (2.5 * math.pi / self.exact if swings else usual)

    def make_grids(self, t=0.0):
        x = np.linspace(0.0, 0.5, self.columns + 1)[:, None]
        part = np.linspace(0.0, 1.0, self.deck.cells + 1)
        front = self.amplitude * np.cos(WAVE_NUMBER * x)
        heights = {"light": -1.0 + (front + 1.0) * part, "heavy": front + (1.0 - front) * part}
        shown = heights if self.heavy else ("light",)
        return {name: np.array(np.broadcast_arrays(x, heights[name])) for name in shown}

    def build(self):
        tension = self.deck.tension
        blocks = []
        layer = (GRAVITY_ACCELERATION, self.pressure, GAS_GAMMA)
        for name, grid in self.make_grids().items():
            density = 2.0 if name == "heavy" else 1.0
            # layers of the same height everywhere: the gas beside the wave is out of balance
            rho, p = compute_isentropic_layer(compute_centres(grid)[1], density, *layer)
            blocks.append(Block(name, IdealGas(GAS_GAMMA), grid, rho, 0.0, 0.0, p))
        top = (blocks[0], "j_max")
        links = []
        if self.heavy:
            links = [join("interface", top, (blocks[1], "j_min"), tension=tension)]
        else:
            put(*top, "free-surface", pressure=self.pressure, tension=tension)
        put_walls(*blocks)
        return self.simulate(blocks, links, source=make_gravity(0.0, -GRAVITY_ACCELERATION))

    def measure(self, evolution) -> dict[str, float]:
        """Amplitude of the wave (its first Fourier coefficient) and height of the mean."""
        x, y = evolution.blocks[0].nodes[:, :, -1]
        steps = np.diff(x)
        height = 0.5 * (y[1:] + y[:-1])
        mean = float(np.average(height, weights=steps))
        wave = np.cos(WAVE_NUMBER * (0.5 * (x[1:] + x[:-1])))
        amplitude = ((height - mean) * wave * steps).sum() / (wave * wave * steps).sum()
        return {"amplitude": float(amplitude), "interface_mean": mean}

    def report(self, run) -> Report:
        find = find_growth_rate if self.grows else find_frequency
        linear = run.until(self.find_linear_end(run)).history
        rate = find(linear["t"], linear["amplitude"])
        notes = []
        if len(linear["t"]) < len(run.history["t"]):
            until = f"k a = {STEEPEST_LINEAR_KA:g} at t = {linear['t'][-1]:.4g}"
            notes.append(f"linear theory ends at {until}: the rate is that up to there")
        label = "growth rate [1/s]" if self.grows else "angular frequency [1/s]"
        mean = run.history["interface_mean"]
        head = f"rayleigh-taylor, {self.deck.above} above, {self.deck.cells} cells per wavelength"
        row = Row("rate", rate, self.exact, label, digits=7, error="rate")
        rows = [row, run.compare("amplitude", label="last amplitude", digits=4)]
        moved = f"the mean has moved by at most {np.abs(mean - mean[0]).max():.1e} m"
        return Report(head, rows, ["theory is without compression", *notes, moved])

    def find_linear_end(self, run: RunSoFar) -> float:
        """The last time [s] before the wave is steeper than STEEPEST_LINEAR_KA."""
        steep = WAVE_NUMBER * np.abs(run.history["amplitude"]) > STEEPEST_LINEAR_KA
        first = run.find_time(steep)
        return math.inf if math.isnan(first) else math.nextafter(first, -math.inf)

    def draw_growth(self, figure, run_data) -> None:
        """Amplitude against theory."""
        axis = figure.subplots()
        t = run_data.history["t"]
        draw_columns(axis, run_data.history, {"amplitude": "computed"}, "amplitude", "1")
        theory, name = (np.cosh, "cosh(rate t)") if self.grows else (np.cos, "cos(omega t)")
        axis.plot(t, self.amplitude * theory(self.exact * t), "k--", lw=0.9, label=f"a0 {name}")
        if self.grows:
            axis.set_yscale("log")
