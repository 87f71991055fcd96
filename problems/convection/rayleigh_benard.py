"""A fluid heated from below, in a square box or in a layer: onset, growth and steady rolls.

The fluid lies between a hot floor (1/2) and a cold ceiling (-1/2), 1 above it.  `shape = "box"` has
side walls at a distance `width`, adiabatic or conducting; `shape = "layer"` has periodic sides, by
default a critical wavelength apart.  The run starts from the fluid at rest with its fastest
disturbance, of `amplitude` K; above the onset it grows into rolls, below it decays.  A layer has
its rolls at any position, and rolls may turn either way: the disturbance used is the part of
exp(x/width + y) that grows at the largest rate (`stability.filter_disturbance`), so that every
computer starts from the same one.

The summary compares the Rayleigh number of the onset, bracketed by the sign of the largest growth
rate of the discrete equations, with linear theory, and the growth in time with the eigenvalue.
Scales: height 1 m, diffusivity 1 m2/s, difference 1 K.

Note: near the onset everything is slow.  At one per cent above it a disturbance takes several
diffusive times to grow by a factor e.
"""

import math
from collections.abc import Mapping
from typing import Literal

import numpy as np

from shockgrid.hydro.convection import measure
from shockgrid.hydro.convection.box import PERIODIC, adiabatic, isothermal, make_fluid
from shockgrid.problems.convection.boxes import AxisGrid, BoxProblem
from shockgrid.problems.deck import Deck, Output, RunControl, key
from shockgrid.problems.pictures import make_panels
from shockgrid.problems.references import convection as linear
from shockgrid.problems.report import Report, Row, RunSoFar
from shockgrid.regrid.errors import BadInput

BENARD_MARCH_TIME = 1.5
# of the last kinetic energy: below it a disturbance grows by linear theory
LINEAR_ENERGY_PART = 1e-2
LEAST_ROWS = 12  # of a history, for a rate of growth
ONSET_BRACKET = (0.3, 3.0)  # of the reference, or of the deck's Rayleigh number
STILL_ENERGY_RATIO = 1e-9  # kinetic energy over the squared disturbance: less is no flow [m4/s2/K2]
BRACKET_WIDENINGS = 3  # of the bracket, tenfold both ways


class RayleighBenardDeck(Deck, kw_only=True):
    output: Output = Output(dumps=6)
    run: RunControl = RunControl(t_end=BENARD_MARCH_TIME)
    shape: key(Literal["box", "layer"], "side walls, or periodic sides") = "box"
    sides: key(Literal["adiabatic", "conducting"], "side walls of a box") = "adiabatic"
    walls: key(Literal["no-slip", "free"], "floor and ceiling hold the fluid, or not") = "no-slip"
    cells: key(int, "cells across", ge=3, le=2000) = 40
    cells_up: key(int, "cells up", ge=3, le=2000) = 40
    width: key(float | None, "over the height. If left out: 1, or critical", ge=0.01, le=100) = None
    rayleigh: key(float, "Rayleigh number of the height", le=1e12) = 5000.0
    prandtl: key(float, "viscosity over diffusivity", le=1e6) = linear.AIR_PRANDTL
    tilt: key(float, "of gravity, anticlockwise from down [degrees]", gt=-90, lt=90) = 0.0
    amplitude: key(float, "of the first disturbance of the temperature [K]", ge=1e-12, le=1) = 1e-3
    onset: key(bool, "search for the onset at the end") = True
    grid: AxisGrid = AxisGrid()
    longest_step: key(float | None, "of the march [s]. If left out: 1/600 of its time", gt=0) = None


class RayleighBenard(BoxProblem):
    Deck = RayleighBenardDeck
    longest_part = 1 / 600
    hot_and_cold = ("j_min", "j_max")
    units: Mapping[str, str] = {"kinetic_energy": "m4/s2", "growth": "1/s", "u_max": "m/s"}

    def __init__(self, deck: RayleighBenardDeck):
        super().__init__(deck)
        self.t_end = deck.run.t_end or BENARD_MARCH_TIME
        if deck.shape == "layer" and deck.sides != "adiabatic":
            raise deck.error(
                "sides", "those of a layer are periodic; leave sides out or take shape = 'box'"
            )
        self.fluid = make_fluid(deck.rayleigh, deck.prandtl, deck.tilt)
        free = deck.walls == "free"
        self.critical = linear.FREE_LAYER_WAVENUMBER if free else linear.LAYER_WAVENUMBER
        usual = 1.0 if deck.shape == "box" else 2.0 * math.pi / self.critical
        self.width = deck.width or usual
        self.extent = (self.width, 1.0)
        side = PERIODIC
        self.onset = math.nan  # by linear theory, where it has one for this deck
        if deck.tilt == 0.0 and deck.shape == "layer":
            if math.isclose(self.width * self.critical, 2.0 * math.pi, rel_tol=1e-3):
                self.onset = linear.FREE_LAYER_ONSET if free else linear.LAYER_ONSET
        elif deck.tilt == 0.0 and self.width == 1.0 and not free:
            self.onset = linear.BOX_ONSETS[deck.sides]
        if deck.shape == "box":
            rest = lambda y: 0.5 - y  # noqa: E731
            side = adiabatic() if deck.sides == "adiabatic" else isothermal(rest)
        floor, ceiling = (isothermal(heat, deck.walls) for heat in (0.5, -0.5))
        self.walls = {"i_min": side, "i_max": side, "j_min": floor, "j_max": ceiling}

    def build(self):
        equations = self.make_first_equations()
        size = self.deck.amplitude
        (psi, temperature), _, flow, heat = self.compute_growth(equations)
        return self.make_march(equations, psi + size * flow, temperature + size * heat, -0.5)

    def measure(self, evolution) -> dict[str, float]:
        """Nusselt numbers of floor and ceiling, kinetic energy, greatest velocity across."""
        equations = evolution.equations
        state = (equations, evolution.fluid, evolution.temperature)
        return {
            "nusselt": measure.compute_mean_nusselt(*state, "j_min"),
            "nusselt_top": -measure.compute_mean_nusselt(*state, "j_max"),
            "kinetic_energy": measure.measure_energy(equations, evolution.psi),
            "u_max": float(np.abs(equations.compute_velocities(evolution.psi)[0]).max()),
        }

    def find_onset(self) -> float | None:
        """Ra at which growth of the discrete equations begins; None where none is found."""
        deck = self.deck
        equations = self.make_first_equations()
        about = self.onset if math.isfinite(self.onset) else max(deck.rayleigh, 1.0)
        fluid = make_fluid(1.0, deck.prandtl, deck.tilt)
        low, high = (part * about for part in ONSET_BRACKET)
        for _ in range(BRACKET_WIDENINGS):
            try:
                return measure.find_onset(equations, fluid, low, high)
            except BadInput:  # both ends grow, or both decay
                low, high = 0.1 * low, 10.0 * high
        return None

    def compute_growth(self, equations) -> tuple:
        """Rest, and the largest growth rate [1/s] of the discrete equations with its flow."""
        rest = measure.solve_rest(equations, self.fluid)
        return rest, *measure.compute_growth(equations, self.fluid, *rest)

    def report(self, run) -> Report:
        rows = [Row("onset", theory=self.onset)]
        return Report((lambda: str(self.compute_report(run))) if run.begun else "", rows)

    def compute_report(self, run: RunSoFar) -> Report:
        """Onset and growth rate beside linear theory, heat transported at the end."""
        deck = self.deck
        rows = []
        notes = []
        if deck.onset and deck.tilt == 0.0:
            found = self.find_onset()
            if found is None:
                notes.append("onset: none was found")
            else:
                rows.append(Row("onset", found, self.onset, "onset, Ra"))
        if deck.tilt == 0.0:
            rate = self.compute_growth(self.make_first_equations())[1]
            theory = math.nan
            if deck.shape == "layer":
                numbers = deck.rayleigh, deck.prandtl, 2.0 * math.pi / self.width
                theory = linear.compute_layer_growth(*numbers, deck.walls == "free")
            rows.append(Row("eigenvalue", rate, theory, "growth rate, eigenvalue [1/s]"))
            energy = run.history["kinetic_energy"]
            seen = measure_growth(run.history["t"], energy)
            if energy[0] < STILL_ENERGY_RATIO * deck.amplitude**2:
                notes.append("the disturbance that decays most slowly is heat alone: nothing moves")
            elif math.isfinite(seen):
                rows.append(Row("growth", seen, rate, "growth rate, in time [1/s]"))
                notes.append("growth in time: beside the eigenvalue")
        rows.append(run.compare("nusselt", label="Nu, floor"))
        rows.append(run.compare("nusselt_top", label="Nu, ceiling"))
        return Report(f"{deck.shape}, {self.describe()}", rows, [*notes, self.say_lost_volume(run)])

    def draw_growth(self, figure, run_data) -> None:
        """Kinetic energy and Nusselt number against time, with the growth of the eigenvalue."""
        t = run_data.history["t"]
        energy = run_data.history["kinetic_energy"]
        left, right = make_panels(figure, 10.0, 4.4, 1, 2)
        left.semilogy(t, energy, lw=1.4, label="kinetic energy")
        if self.deck.tilt == 0.0:
            rate = self.compute_growth(self.make_first_equations())[1]
            line = energy[0] * np.exp(2.0 * rate * (t - t[0]))
            shown = line <= 3.0 * energy.max()
            left.semilogy(t[shown], line[shown], "k--", lw=0.9, label=f"exp(2 · {rate:.4g} t)")
        left.set(xlabel="t [s]", ylabel="kinetic energy over density [m4/s2]")
        right.plot(t, run_data.history["nusselt"], lw=1.2, label="floor")
        right.plot(t, run_data.history["nusselt_top"], "--", lw=1.2, label="ceiling")
        right.set(xlabel="t [s]", ylabel="Nusselt number")


def measure_growth(t: np.ndarray, energy: np.ndarray) -> float:
    """Growth rate [1/s] from the time and kinetic energy (n,) of a disturbance.

    Median of the slopes of log(energy)/2 while the energy is small and after the first steps; NaN
    where too few steps are small.
    """
    known = np.isfinite(energy) & (energy > 0.0)
    t = t[known]
    energy = energy[known]
    if energy.size < LEAST_ROWS:
        return math.nan
    decays = energy[-1] < energy[0]
    small = energy < (np.inf if decays else LINEAR_ENERGY_PART * energy.max())
    end = int(np.argmin(small)) if not small.all() else small.size
    if end < LEAST_ROWS:
        return math.nan
    return float(np.median(0.5 * np.diff(np.log(energy[4:end])) / np.diff(t[4:end])))
