"""Saltzmann's piston: a plane shock on a skewed grid stays plane, through two reflections.

A piston at speed 1 drives a shock of infinite strength through gas at rest, g = 5/3, on a grid
whose lines are bent by a tenth of the length: x = i/100 + (0.1 - j/100) sin(pi i/100).  The shock
(D = 4/3) meets the wall at t = 0.75 and returns to the piston at t = 0.9; the density behind it
is 4, then 10, then 20.  The problem measures the density between the wave and its origin, in the
middle seven tenths of that length: mean, root mean square and worst cell's difference from the
exact state.

Note: gas at rest without pressure allows any time step, and one in which the shock leaves the
piston through several cells at once leaves entropy there permanently, so the first steps are short.
There is no contact to preserve, so HLL on all faces reduces the error in rows of cells that lines
oblique to the shock leave.
"""

import math
from typing import ClassVar, Literal

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import IdealGas
from shockgrid.hydro.formulas.reconstruction import DEFAULT_LIMITER
from shockgrid.problems.deck import MOST_CELLS, Deck, Limiter, Regrid, RunControl, key
from shockgrid.problems.initial_states import put_walls
from shockgrid.problems.pictures import draw_field, find_dump
from shockgrid.problems.problem import BlockPlan, Problem
from shockgrid.problems.report import Report, Row

# times at which a shock starts and ends, its first place, its speed, density behind it
PHASES = (
    (0.0, 0.75, 0.0, 4.0 / 3.0, 4.0), (0.75, 0.9, 1.0, -2.0 / 3.0, 10.0),
    (0.9, 0.95, 0.9, 2.0, 20.0),
)  # fmt: skip
KINDS = {"mean": "mean", "rms": "root mean square", "worst": "worst cell"}  # of errors
FIRST_STEP = 0.02  # of a cell that the shock crosses in the first step
LEFT_OUT_PART = 0.15  # of the length behind the shock that is left out at either end


class SaltzmannDeck(Deck, kw_only=True):
    run: RunControl = RunControl(t_end=0.93, cfl=0.6)
    regrid: Regrid = Regrid()
    cells: key(int, "cells along the tube, which is 1 m long", ge=10, le=MOST_CELLS) = 100
    rows: key(int, "cells across; the tube is 0.1 m wide", ge=2, le=MOST_CELLS) = 10
    skew: key(float, "largest displacement of the grid lines [m]", ge=0, le=0.25) = 0.1
    pressure: key(float, "of the gas at rest; exact is 0 [Pa]", ge=1e-12, le=0.01) = 1e-6
    limiter: Limiter = DEFAULT_LIMITER
    flux: key(Literal["hllc", "hll"], "hllc: HLL at shocks only; hll: on all faces") = "hll"


class Saltzmann(Problem):
    Deck = SaltzmannDeck
    t_unit = "1"
    units: ClassVar = {"transverse_speed": "m/s"}

    def __init__(self, deck: SaltzmannDeck):
        super().__init__(deck)
        self.check_end(PHASES[-1][1], "the third shock meets the wall")

    def list_boxes(self):
        return [BlockPlan("gas", (self.deck.cells, self.deck.rows), (0.0, 0.0), (1.0, 0.1))]

    def make_grids(self, t=0.0):
        x, y = self.list_boxes()[0].make_nodes()
        bend = np.sin(math.pi * x)
        bend[-1] = 0.0
        return {"gas": np.array([x + self.deck.skew * (1.0 - 10.0 * y) * bend, y])}

    def build(self):
        deck = self.deck
        gas = IdealGas(5.0 / 3.0)
        state = (1.0, 0.0, 0.0, self.deck.pressure)
        scheme = {"limiter": deck.limiter, "flux": deck.flux}
        block = Block("gas", gas, self.make_grids()["gas"], *state, **scheme)
        put(block, "i_min", "piston", velocity=(1.0, 0.0))
        put_walls(block)
        return self.simulate([block], first_dt=FIRST_STEP / (deck.cells * PHASES[0][3]))

    def measure(self, evolution) -> dict[str, float]:
        """Relative errors of the density behind each shock (once it is half way), 1D or not."""
        (block,) = evolution.blocks
        row = {f"{kind}_error_{n}": math.nan for n in (1, 2, 3) for kind in KINDS}
        row["transverse_speed"] = float(np.abs(block.v).max())
        t = evolution.t
        x = block.centres[0]
        phase = sum(t > start for start, *_ in PHASES[1:])  # reflections before
        start, end, place, speed, exact = PHASES[phase]
        front = place + speed * (t - start)
        back = t if phase != 1 else 1.0
        inside = np.abs(x - 0.5 * (front + back)) < (0.5 - LEFT_OUT_PART) * abs(front - back)
        if t < 0.5 * (start + end) or not inside.any():
            return row
        error = block.rho[inside] / exact - 1.0
        sizes = abs(error.mean()), np.sqrt((error * error).mean()), np.abs(error).max()
        for kind, size in zip(KINDS, sizes, strict=True):
            row[f"{kind}_error_{phase + 1}"] = float(size)
        return row

    def report(self, run) -> Report:
        history = run.history
        deck = self.deck
        rows = []
        for n, (*_, exact) in enumerate(PHASES, 1):
            for last in np.flatnonzero(np.isfinite(history[f"mean_error_{n}"]))[-1:]:
                when = f"density {exact:g}, t = {history['t'][last]:.3f}"
                for kind, error in KINDS.items():
                    name = f"{kind}_error_{n}"
                    label = f"{when}: {error} [%]"
                    rows.append(Row(name, history[name][last], label=label, unit=0.01, digits=3))
        most = run.most("transverse_speed")
        rows.append(Row("largest_transverse_speed", most, label="largest speed across", digits=2))
        head = f"saltzmann, {deck.cells} x {deck.rows} cells, {deck.regrid.name}"
        return Report(f"{head}; errors of the density behind each shock:", rows)

    def draw_saltzmann(self, figure, run_data) -> None:
        """Grid and density at three times, and density against x of all cells."""
        panels = figure.subplots(3, 2, width_ratios=(2, 1))
        for (left, right), t in zip(panels, (0.6, 0.85, 0.93), strict=True):
            dump = find_dump(run_data, t)
            draw_field(left, dump, "rho", every=1, bar="density", title="t")
            left.set_aspect("auto")
            gas = dump["gas"]
            right.plot(gas.centres[0].ravel(), gas.rho.ravel(), ".", ms=1.5)
            for exact in (exact for start, *_, exact in PHASES if dump.t > start):
                right.axhline(exact, color="k", lw=0.5)
            right.set_xlabel("x")
