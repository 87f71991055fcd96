"""Convecting boxes: as `runs` sees them, steady or in time, with what their problems share.

A steady run counts Newton iterations as its steps, and as its time as well.  Note: what its
history shows before the end are iterates, most of them at a smaller Rayleigh number than the
deck's; the column `buoyancy` says what part of the wanted one has been reached.
"""

import math
from collections.abc import Mapping
from operator import attrgetter
from typing import Any, Literal

import numpy as np

from shockgrid.hydro.convection.box import Fluid
from shockgrid.hydro.convection.equations import Equations
from shockgrid.hydro.convection.march import March
from shockgrid.hydro.convection.measure import compute_local_nusselt, find_nusselt_maximum
from shockgrid.hydro.convection.steady import (
    GridControl,
    SteadySolver,
    compute_nodal_fields,
    expand_nodes,
    restrict_nodes,
)
from shockgrid.hydro.convection.tensor_grids import make_axis
from shockgrid.problems.deck import DeckTable, key
from shockgrid.problems.initial_states import make_plane_grid
from shockgrid.problems.pictures import draw_grid, make_panels
from shockgrid.problems.problem import BlockPlan, Problem
from shockgrid.problems.report import RunSoFar

# of factorised matrices per cell to the power 1.5, at the peak of a run: measured 4.5 kB a cell of
# 10 000, 7.6 of 80 000, 21 of 320 000 (heat flux), 8.9 of 490 000 (given temperatures)
FACTOR_BYTES = 38.0
LARGEST_SHIFT = 0.1  # of a node in one step of the time march, in its shorter neighbouring step
SIDES = {"i_min": "left", "i_max": "right", "j_min": "bottom", "j_max": "top"}
CONTOUR_LEVELS = 14  # of stream function and temperature in pictures


class ConvectionBlock:
    """The box with its present grid and state."""

    units: Mapping[str, str] = {"T": "K", "u": "m/s", "v": "m/s", "psi": "m2/s"}
    long_names: Mapping[str, str] = {"T": "temperature", "psi": "stream function"}

    name = "box"

    def __init__(self, equations: Equations, psi: np.ndarray, temperature: np.ndarray):
        self.equations = equations
        self.psi = psi
        self.temperature = temperature
        self.nodes = make_plane_grid(*(axis.nodes for axis in equations.axes))

    @property
    def cell_fields(self) -> dict[str, np.ndarray]:
        """Temperature, and velocities as means of the cells' faces."""
        means = []
        for k, part in enumerate(self.equations.compute_velocities(self.psi)):
            axis = self.equations.axes[k]
            means.append(np.moveaxis(axis.average_to_cells() @ np.moveaxis(part, k, 0), 0, k))
        heat = self.temperature.reshape(self.equations.shape)
        return {"T": heat, "u": means[0], "v": means[1]}

    @property
    def node_fields(self) -> dict[str, np.ndarray]:
        return {"psi": expand_nodes(self.equations, self.psi)}


def measure_mass(equations: Equations, psi: np.ndarray) -> float:
    """Largest volume that is lost or made in a cell, relative to the largest flux."""
    largest = float(np.abs(equations.momentum.curl @ psi).max())
    return float(np.abs(equations.compute_divergence(psi)).max()) / (largest or 1.0)


class _Box:
    """A box that marches: `solver` has its fluid, its `level` equations, psi and temperature."""

    def __init__(self, solver: SteadySolver | March, t_end: float):
        self.solver = solver
        self.t_end = t_end

    level = property(attrgetter("solver.level"))
    fluid = property(attrgetter("solver.fluid"))  # in a steady run that of the present stage
    equations = property(attrgetter("level.equations"))
    psi = property(attrgetter("level.psi"))
    temperature = property(attrgetter("level.temperature"))

    @property
    def blocks(self) -> list[ConvectionBlock]:
        return [ConvectionBlock(self.equations, self.psi, self.temperature)]

    def get_state(self):
        return self.solver.get_state()

    def set_state(self, state) -> None:
        self.solver.set_state(state)


class SteadyEvolution(_Box):
    """Newton's iterations towards a steady state, `t_end` of them at most."""

    level = property(attrgetter("solver"))
    step = property(attrgetter("solver.iterations"))

    @property
    def t(self) -> float:
        return float(self.solver.iterations)

    @property
    def finished(self) -> str | None:
        if self.solver.converged:
            return "steady"
        return f"all {self.t_end:g} iterations made" if self.t >= self.t_end else None

    @property
    def missed(self) -> str:
        """What a run that ends now has not reached."""
        return "" if self.solver.converged else "not steady"

    def advance(self) -> dict[str, float | int | str]:
        """One Newton step; RunFailure where it fails."""
        before = self.step
        while self.step == before:  # an iteration taken back is not a step
            self.solver.iterate()
        solver = self.solver
        return {
            "t": self.t,
            "dt": 1.0,
            "dt_limit": "newton",
            "buoyancy": 10.0**solver.exponent,
            "change": solver.change,
            "residual": solver.residual,
            "mass_residual": measure_mass(self.equations, self.psi),
            "grid_corrections": solver.corrections,
            "grid_shift": solver.grid_shift if math.isfinite(solver.grid_shift) else 0.0,
        }


class TimeEvolution(_Box):
    """The time march; the grid may move towards the one its solution asks for.

    `coldest` [K]: heat is counted from there, so that its total is no small difference.
    """

    step = property(attrgetter("solver.step"))
    t = property(attrgetter("solver.t"))

    def __init__(self, march: March, grid: GridControl, t_end: float, coldest: float):
        super().__init__(march, t_end)
        self.grid = grid
        self.coldest = coldest

    @property
    def finished(self) -> str | None:
        return "t_end reached" if self.t >= self.t_end else None

    def start_row(self) -> dict[str, float]:
        content = float((self.equations.areas * (self.temperature - self.coldest)).sum())
        return {"total_heat": content, "boundary_heat": self.level.entered}

    def advance(self) -> dict[str, float | int | str]:
        """One step in time; RunFailure where it fails."""
        march = self.solver
        shift = 0.0
        remaining = self.t_end - march.t
        dt = march.choose_step(remaining)
        axes = self._move_grid()
        if axes is not None:
            shift = max(
                float(np.abs(new - axis.nodes).max()) * axis.cells / axis.length
                for new, axis in zip(axes, self.equations.axes, strict=True)
            )
        march.advance(dt, axes)
        if dt == remaining:
            march.t = self.t_end
        row = {"t": self.t, "dt": dt, "dt_limit": march.dt_limit, **self.start_row()}
        mass = measure_mass(self.equations, self.psi)
        return {**row, "mass_residual": mass, "grid_shift": shift}

    def _move_grid(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Axes nearer to those that the solution asks for; None where the grid stays."""
        moving = self.grid.follows and self.step % self.grid.every == 0
        if not moving or not np.any(self.psi):
            return None
        wanted = self.grid.correct(self.equations, self.fluid, self.psi, self.temperature)
        axes = []
        for new, axis in zip(wanted, self.equations.axes, strict=True):
            shift = new - axis.nodes
            room = np.minimum(axis.widths[1:], axis.widths[:-1])
            fastest = float((np.abs(shift[1:-1]) / room).max())
            axes.append(axis.nodes + min(1.0, LARGEST_SHIFT / max(fastest, 1e-300)) * shift)
        return tuple(axes)


class AxisGrid(DeckTable, kw_only=True):
    """Where the nodes of an axis lie, and after what they move."""

    merges = True

    kind: key(
        Literal["uniform", "clustered", "polevikov", "monitor", "combined"],
        "clustered at walls; polevikov: by the speed; monitor: by gradients; combined: by both",
    ) = "uniform"
    every: key(int, "steps between corrections of the grid", ge=1, le=2**63 - 1) = 1
    relaxation: key(float, "fraction of a correction that is applied", ge=1e-12, le=1) = 0.7
    ratio: key(float | None, "largest of neighbouring steps. If left out: the default", gt=1) = None
    floor: key(float, "least speed, as a fraction of the largest", ge=1e-12, lt=1) = 0.02
    strength: key(float, "of the gradient against the uniform grid", ge=0, le=1e9) = 1.0
    share: key(float, "of polevikov's density of nodes in the combined one", ge=0, le=1) = 0.5
    walls: key(Literal["both", "low", "high"], "where a clustered grid is dense") = "both"
    clustering: key(float, "strength of a clustered grid's tanh spacing", ge=1e-12, le=20) = 2.0

    def make(self, n: int, low: float = 0.0, high: float = 1.0) -> np.ndarray:
        """The first axis of n steps, shape (n + 1,)."""
        return make_axis(self.kind, n, low, high, walls=self.walls, clustering=self.clustering)

    def options(self) -> dict[str, Any]:
        """What `correct_axis` needs besides the kind."""
        names = ("floor", "ratio", "strength", "share", "relaxation")
        return {name: getattr(self, name) for name in names}

    def control(self) -> GridControl:
        """How the grid is to follow the flow."""
        return GridControl(self.kind, self.every, options=self.options())


class BoxProblem(Problem):
    """A box, `extent` [m] wide and high, of `fluid` between `walls`, by the solver's names.

    `longest_part`: of the end time, in one step of a march.
    """

    fluid: Fluid
    walls: Mapping[str, Any]
    extent: tuple[float, float]
    scale = 1.0  # of the Nusselt number
    longest_part: float
    hot_and_cold = ("i_min", "i_max")  # walls through which heat comes in and goes out

    @property
    def size(self) -> tuple[int, int]:
        """Cells across and up."""
        cells = self.deck.cells
        up = self.deck.cells_up
        return cells, up or max(3, round(cells * self.extent[1] / self.extent[0]))

    def plan(self) -> tuple[float, list[BlockPlan]]:
        """Time, or most iterations, and the box."""
        return self.t_end, [BlockPlan("box", self.size, (0.0, 0.0), self.extent)]

    def estimate_solver_memory(self, cells: int) -> float:
        """Of the matrices of heat and flow."""
        return FACTOR_BYTES * cells**1.5

    def make_first_equations(self) -> Equations:
        """The discrete equations on the first grid."""
        ends = zip(self.size, self.extent, strict=True)
        return Equations(*(self.deck.grid.make(n, 0.0, end) for n, end in ends), self.walls)

    def make_march(self, equations: Equations, psi, temperature, coldest: float) -> TimeEvolution:
        """The march in time from a state."""
        run = self.deck.run
        longest = self.deck.longest_step or self.longest_part * (run.t_set_up or self.t_end)
        march = March(equations, self.fluid, psi, temperature, cfl=run.cfl, longest=longest)
        return TimeEvolution(march, self.deck.grid.control(), self.t_end, coldest)

    def describe(self) -> str:
        """The fluid and the grid in words."""
        deck = self.deck
        across, up = self.size
        fluid = f"Ra = {deck.rayleigh:g}, Pr = {deck.prandtl:g}"
        return f"{fluid}, {across} x {up} cells, grid {deck.grid.kind}"

    def say_lost_volume(self, run: RunSoFar) -> str:
        """A sentence on the conservation of volume in the last step."""
        lost = run.last("mass_residual")
        return f"volume lost in a cell, over the largest flux: {lost:.1e}"

    def read_dump(self, dump) -> tuple[Any, Equations, np.ndarray]:
        """The block of a dump, the equations on its grid, its temperatures [K] in one row."""
        (block,) = dump.blocks
        equations = Equations(block.nodes[0, :, 0], block.nodes[1, 0], self.walls)
        return block, equations, block.cell_fields["T"].ravel()

    def draw_flow(self, figure, run_data) -> None:
        """Streamlines and isotherms of the last dump."""
        from matplotlib.ticker import MaxNLocator

        block, equations, heat = self.read_dump(run_data.dumps[-1])
        psi = block.node_fields["psi"]
        x, y = block.nodes
        nodal = compute_nodal_fields(equations, restrict_nodes(equations, psi), heat)[2]
        wide = np.ptp(x) > 1.6 * np.ptp(y)
        high = float(np.clip(3.7 * np.ptp(y) / np.ptp(x) + 0.9, 3.0, 9.0))
        axes = make_panels(figure, 7.0, 7.0, 2) if wide else make_panels(figure, 10.5, high, 1, 2)
        largest = float(np.abs(psi).max()) or 1.0
        shades = np.linspace(psi.min(), psi.max(), 41) if np.ptp(psi) else 3
        pale = 1.4 * largest  # so that the lines stay visible on the strongest shade
        flow = axes[0].contourf(x, y, psi, levels=shades, cmap="RdBu_r", vmin=-pale, vmax=pale)
        lines = {"linewidths": 0.7, "linestyles": "-"}
        if np.ptp(psi):
            levels = np.linspace(psi.min(), psi.max(), CONTOUR_LEVELS + 2)[1:-1]
            axes[0].contour(x, y, psi, levels=levels, colors="k", **lines)
        warm = axes[1].contourf(x, y, nodal, levels=40, cmap="inferno")
        axes[1].contour(x, y, nodal, levels=CONTOUR_LEVELS, colors="w", **lines)
        titles = f"streamlines, |psi| up to {largest:.4g}", "isotherms"
        labels = "stream function [m2/s]", "temperature [K]"
        for axis, picture, title, label in zip(axes, (flow, warm), titles, labels, strict=True):
            figure.colorbar(picture, ax=axis, shrink=0.85, label=label, ticks=MaxNLocator(7))
            axis.set_title(title, fontsize=10)
            axis.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")

    def draw_nusselt(self, figure, run_data) -> None:
        """Local Nusselt number along two walls in the last dump, and the reference's maximum."""
        _, equations, heat = self.read_dump(run_data.dumps[-1])
        state = equations, self.fluid, heat
        axis = make_panels(figure, 7.0, 4.6)
        hot, cold = self.hot_and_cold
        for side, colour, sign, way in ((hot, "C3", 1.0, "in"), (cold, "C0", -1.0, "out")):
            positions, values = compute_local_nusselt(*state, side, self.scale)
            axis.plot(
                positions,
                sign * values,
                ".-",
                color=colour,
                ms=4,
                lw=1.0,
                label=f"{SIDES[side]} wall, {way}",
            )
        if hot == "i_min":
            peak, position = find_nusselt_maximum(*state, hot, self.scale)
            axis.plot(position, peak, "k+", ms=10, label=f"maximum {peak:.4g} at {position:.4f}")
            if (reference := self.find_reference()) is not None:
                peak = reference.nusselt_max
                position = reference.nusselt_max_y
                axis.plot(
                    position,
                    peak,
                    "o",
                    label=f"reference {peak:.4g} at {position:.4f}",
                    mfc="none",
                    color="0.3",
                    ms=9,
                )
        axis.set(xlabel="y [m]" if hot == "i_min" else "x [m]", ylabel="local Nusselt number")

    def draw_grid(self, figure, run_data) -> None:
        """The grid of the last dump over the speed, and its steps along both axes."""
        (block,) = run_data.dumps[-1].blocks
        x, y = block.nodes
        left, right = make_panels(figure, 11.0, 5.0, 1, 2)
        speed = np.hypot(block.cell_fields["u"], block.cell_fields["v"])
        picture = left.pcolormesh(x, y, speed, cmap="Blues", rasterized=True)
        figure.colorbar(picture, ax=left, shrink=0.85, label="speed [m/s]")
        draw_grid(left, block.nodes, color="0.3", lw=0.3)
        left.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
        for nodes, name in ((x[:, 0], "x"), (y[0], "y")):
            steps = np.diff(nodes)
            middle = (0.5 * (nodes[1:] + nodes[:-1]) - nodes[0]) / np.ptp(nodes)
            right.plot(middle, steps * steps.size / np.ptp(nodes), ".-", ms=3, lw=0.8, label=name)
        right.set(xlabel="place, part of the length", ylabel="step over the uniform one")
