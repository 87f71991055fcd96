"""Convection between vertical plates with a through-flow, against its exact profiles.

Two plates, hot at x = 0 and cold at x = 1, form a slot that is closed far above and below:
the fluid rises along one and sinks along the other, v = Ra/12 x (1 - x)(1 - 2 x).  Suction and
injection through the plates (`peclet`) blow the heat towards one of them, into a layer of thickness
1/Pe.  `mean_speed` adds a flow along the slot.  The fluid starts at rest, and the run ends when
the flow is steady.

Scales: width of the slot 1 m, diffusivity 1 m2/s, 1 K between the plates.

The grid may follow the speed as Polevikov's does, gradients, or both (`grid.kind`);
`benchmarks/convection_1d_tables.py` compares all of them, and the schemes of the through-flow's
flux.  Note: Polevikov's grid has its longest steps at the plates, where they decrease only with the
square root of the number of cells: v is first order on it, not second.
"""

import functools
import math
from collections.abc import Mapping
from typing import Literal

import numpy as np

from shockgrid.hydro.convection import columns
from shockgrid.problems.convection.boxes import AxisGrid
from shockgrid.problems.deck import Deck, Output, RunControl, key
from shockgrid.problems.problem import Problem
from shockgrid.problems.references.convection import VerticalPlates
from shockgrid.problems.report import Report

ROUND_OFF_SWING = 1e-12  # relative: differences below are rounding, no swing
LONGEST_DIFFUSIVE_TIMES = 50.0  # slowest diffusive times that a run may take: steady long before
ERRORS = ("error_T", "error_v", "swings_T", "swings_v")


class Convection1DDeck(Deck, kw_only=True):
    output: Output = Output(dumps=4)
    run: RunControl = RunControl()
    cells: key(int, "cells across the slot", ge=3, le=20000) = 40
    rayleigh: key(float, "Rayleigh number of the slot's width", ge=0, le=1e12) = 1e4
    prandtl: key(float, "viscosity over diffusivity", ge=1e-6, le=1e6) = 0.71
    peclet: key(float, "Péclet number of the flow from hot to cold plate", ge=-1e6, le=1e6) = 0.0
    mean_speed: key(float, "along the slot [m/s]; 0: closed far away", ge=-1e6, le=1e6) = 0.0
    scheme: key(
        Literal["exponential", "samarskii", "upwind", "central"],
        "of the fluxes; central oscillates beyond a grid Péclet number of 2",
    ) = "exponential"
    grid: AxisGrid = AxisGrid()


class Convection1D(Problem):
    Deck = Convection1DDeck
    units: Mapping[str, str] = {"least_step": "m", "flow": "m2/s", "reference_temperature": "K"}

    def __init__(self, deck: Convection1DDeck):
        super().__init__(deck)
        if deck.rayleigh == deck.mean_speed == 0.0:
            raise deck.error(
                "rayleigh", "nothing would rise or sink, with mean_speed = 0; give one of them"
            )
        self.words = (
            f"Ra {deck.rayleigh:g}, Pr {deck.prandtl:g}, Pe {deck.peclet:g}, {deck.cells} cells, "
            f"grid {deck.grid.kind}"
        )
        self.exact = VerticalPlates(deck.rayleigh, deck.prandtl, deck.peclet, deck.mean_speed)

    def make_column(self, scheme: str | None = None) -> columns.Column:
        """The fluid and its walls, with the deck's scheme or another."""
        deck = self.deck
        forces = {"buoyancy": deck.rayleigh * deck.prandtl, "through_flow": deck.peclet}
        forces |= {"mean_speed": deck.mean_speed, "scheme": scheme or deck.scheme}
        return columns.Column(viscosity=deck.prandtl, diffusivity=1.0, **forces)

    def build(self) -> columns.ColumnMarch:
        deck = self.deck
        grid = self.deck.grid
        t_end = deck.run.t_end or LONGEST_DIFFUSIVE_TIMES * max(1.0, 1.0 / deck.prandtl)
        kind = t_end, grid.kind, grid.every
        column = self.make_column()
        first = grid.make(deck.cells)
        return columns.ColumnMarch(column, first, *kind, **grid.options())

    def measure(self, evolution: columns.ColumnMarch) -> dict[str, float]:
        """Errors and swings against the exact steady profiles, at the end only."""
        if evolution.finished is None:
            return dict.fromkeys(ERRORS, math.nan)
        return measure_errors(self.exact, evolution.x, evolution.temperature, evolution.velocity)

    def report(self, run) -> Report:
        """Errors of the profiles at the end, and the heat through the slot."""
        deck = self.deck
        change = run.last("change")
        rows = [
            run.compare("error_T", label="largest error of T [K]", digits=3),
            run.compare("error_v", label="largest error of v, of its largest", digits=3),
            run.compare("nusselt", self.exact.compute_nusselt(), "heat", digits=9),
        ]
        notes = run.say_unreached("error_v")
        if change >= columns.STEADY_CHANGE and not notes:
            notes.append(
                f"NOT STEADY: the state still changes by {change:.1e} in a diffusive time, and the "
                "exact profiles are the steady ones; a longer time (run.t_end)"
            )
        return Report(f"{self.words}, scheme {deck.scheme}", rows, notes)

    def draw_profiles(self, figure, run_data) -> None:
        """Temperature and velocity in the last dump over the exact profiles, nodes below.

        A thin layer at a wall has a second row of panels to itself.
        """
        deck = self.deck
        dump = run_data.dumps[-1]
        (block,) = dump.blocks
        x = block.nodes[0, :, 0]
        windows = [(0.0, 1.0)]
        if abs(deck.peclet) > 20.0:
            last = -1 if deck.peclet > 0.0 else 0  # the step at the wall of the layer
            width = 8.0 * max(1.0, deck.prandtl) / abs(deck.peclet)
            width = max(width, 3.0 * np.diff(x)[last])
            windows.append((1.0 - width, 1.0) if last else (0.0, width))
        figure.set_size_inches(9.0, 3.8 * len(windows))
        figure.suptitle(f"{self.words}, t = {dump.t:.3g} s", fontsize="medium")
        centres = 0.5 * (x[1:] + x[:-1])
        labels = {"T": "temperature [K]", "v": "velocity along the plates [m/s]"}
        panels = figure.subplots(len(windows), 2, squeeze=False)
        for row, (low, high) in zip(panels, windows, strict=True):
            shown = (centres >= low) & (centres <= high)
            fine = np.linspace(low, high, 501)
            nodes = x[(x >= low) & (x <= high)]
            for axes, exact, name in zip(row, self.exact.sample(fine), labels, strict=True):
                found = block.cell_fields[name][shown, 0]
                axes.plot(fine, exact, color="0.6", lw=1.2, label="exact")
                axes.plot(centres[shown], found, ".", ms=4, label="computed")
                values = np.concatenate([exact, found])
                position = values.min() - 0.07 * (np.ptp(values) or 1.0)
                axes.plot(nodes, np.full_like(nodes, position), "|", color="k", ms=7, mew=0.6)
                axes.set_xlabel("x [m], nodes below")
                axes.set_title(labels[name], fontsize="medium")


def count_turns(values: np.ndarray) -> int:
    """How often a profile turns from rising to falling or back; level parts do not count."""
    change = np.diff(values)
    change = np.sign(change[np.abs(change) > ROUND_OFF_SWING * np.ptp(values)])
    return int(np.count_nonzero(change[1:] != change[:-1]))


def measure_errors(
    exact: VerticalPlates, x: np.ndarray, temperature: np.ndarray, velocity: np.ndarray
) -> dict[str, float]:
    """Largest errors at the centres, T [K] and v over the largest exact |v|; turns too many.

    The turns are those of the computed profiles, walls included, less those of the exact ones,
    wherever they lie.
    """
    positions = np.concatenate([[x[0]], 0.5 * (x[1:] + x[:-1]), [x[-1]]])
    right_t, right_v = exact.sample(positions)
    found_t = np.concatenate([right_t[:1], temperature, right_t[-1:]])
    found_v = np.concatenate([[0.0], velocity, [0.0]])
    turns_t, turns_v = count_exact_turns(exact)
    return {
        "error_T": float(np.abs(found_t - right_t).max()),
        "error_v": float(np.abs(found_v - right_v).max() / np.abs(right_v).max()),
        "swings_T": float(count_turns(found_t) - turns_t),
        "swings_v": float(count_turns(found_v) - turns_v),
    }


@functools.cache
def count_exact_turns(exact: VerticalPlates) -> tuple[int, int]:
    """Turns of the exact temperature and velocity, those inside thin layers at the walls too."""
    near = np.geomspace(1e-9, 0.5, 150)
    return tuple(
        count_turns(one)
        for one in exact.sample(np.concatenate([[0.0], near, 1.0 - near[-2::-1], [1.0]]))
    )
