"""Convecting boxes: as `runs` sees them, steady or in time; their reports and pictures.

A steady run counts Newton iterations as its steps, and as its time as well.  Note: what its
history shows before the end are iterates, most of them at a smaller Rayleigh number than the
deck's; the column `buoyancy` says what part of the wanted one has been reached.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from hydro.convection.box import Fluid
from hydro.convection.equations import Equations
from hydro.convection.march import March
from hydro.convection.steady import GridControl, SteadySolver, expand_nodes
from problems.problem import Report, Row, compare, get_last
from problems.problem import draw_grid as draw_grid_lines
from problems.references.convection import compute_layer_growth
from regrid.errors import BadInput

MOST_ITERATIONS = 200
LARGEST_SHIFT = 0.1  # of a node in one step of the time march, in its shorter neighbouring step


class ConvectionBlock:
    """The box with its present grid and state."""

    units: Mapping[str, str] = {"T": "K", "u": "m/s", "v": "m/s", "psi": "m2/s"}
    long_names: Mapping[str, str] = {"T": "temperature", "psi": "stream function"}

    def __init__(self, name: str, equations: Equations, psi: np.ndarray, temperature: np.ndarray):
        self.name, self.equations = name, equations
        self.psi, self.temperature = psi, temperature
        x, y = (axis.nodes for axis in equations.axes)
        self.nodes = np.array(np.meshgrid(x, y, indexing="ij"))

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
    """A box that marches: `source` has its fluid and its present equations, psi, temperature."""

    def __init__(self, name: str, t_end: float):
        self.name, self.t_end = name, t_end

    @property
    def fluid(self) -> Fluid:
        """The fluid, in a steady run that of the present stage."""
        return self.solver.fluid

    @property
    def equations(self) -> Equations:
        return self.level.equations

    @property
    def psi(self) -> np.ndarray:
        return self.level.psi

    @property
    def temperature(self) -> np.ndarray:
        return self.level.temperature

    @property
    def blocks(self) -> list[ConvectionBlock]:
        return [ConvectionBlock(self.name, self.equations, self.psi, self.temperature)]

    def get_state(self):
        return self.solver.get_state()

    def set_state(self, state) -> None:
        self.solver.set_state(state)


class SteadyEvolution(_Box):
    """Newton's iterations towards a steady state."""

    def __init__(self, name: str, solver: SteadySolver, most: int = MOST_ITERATIONS):
        super().__init__(name, float(most))
        self.solver = solver

    @property
    def level(self) -> SteadySolver:
        return self.solver

    @property
    def step(self) -> int:
        return self.solver.iterations

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
    """The time march; the grid may move towards the one its solution asks for."""

    def __init__(
        self, name: str, march: March, grid: GridControl, t_end: float, coldest: float = 0.0
    ):
        """`coldest` [K]: heat is counted from there, so that its total is no small difference."""
        super().__init__(name, t_end)
        self.solver, self.grid, self.coldest = march, grid, coldest

    @property
    def level(self):
        return self.solver.level

    @property
    def step(self) -> int:
        return self.solver.step

    @property
    def t(self) -> float:
        return self.solver.t

    @property
    def finished(self) -> str | None:
        return "t_end reached" if self.t >= self.t_end else None

    def start_row(self) -> dict[str, float]:
        content = float((self.equations.areas * (self.temperature - self.coldest)).sum())
        return {"total_heat": content, "boundary_heat": self.level.entered}

    def advance(self) -> dict[str, float | int | str]:
        """One step in time; RunFailure where it fails."""
        march, shift = self.solver, 0.0
        remaining = self.t_end - march.t
        dt, axes = march.choose_step(remaining), self._move_grid()
        if axes is not None:
            shift = max(
                float(np.abs(new - axis.nodes).max()) * axis.cells / axis.length
                for new, axis in zip(axes, self.equations.axes, strict=True)
            )
        march.advance(dt, axes)
        if dt == remaining:
            march.t = self.t_end
        row = {"t": self.t, "dt": dt, "dt_limit": march.limit, **self.start_row()}
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


ROWS = (
    ("Nu mean, left wall", "nusselt"),
    ("greatest u on x = 1/2", "u_max"),
    ("  at y [m]", "u_max_y"),
    ("greatest v on y = 1/2", "v_max"),
    ("  at x [m]", "v_max_x"),
    ("greatest Nu, left wall", "nusselt_max"),
    ("  at y [m]", "nusselt_max_y"),
)
SMALL = 1e-2  # of the last kinetic energy: below it a disturbance grows by linear theory
ONSET_BRACKET = (0.3, 3.0)  # of the reference, or of the deck's Rayleigh number
STILL = 1e-9  # kinetic energy over the squared disturbance: less is no flow [m4/s2/K2]
WIDENINGS = 3  # of the bracket, tenfold both ways


def report_cavity(problem, history) -> Report:
    """The quantities of the reference, with its values where there are any."""
    deck, reference, (across, up) = problem.deck, problem.find_reference(), problem.size
    head = (
        f"Ra = {deck.rayleigh:g}, Pr = {deck.prandtl:g}, {across} x {up} cells, "
        f"grid {deck.grid.kind}"
    )
    rows = [
        compare(history, name, getattr(reference, name, math.nan), words) for words, name in ROWS
    ]
    if not history:
        return Report(head, rows)
    notes = [] if reference else ["there is no reference for this deck"]
    passes = deck.bottom.heat == deck.top.heat == "adiabatic"
    if passes and history["nusselt"][-1] != 0.0:
        balance = history["nusselt_right"][-1] / history["nusselt"][-1] - 1.0
        notes.append(f"heat out at the right over heat in at the left, less 1: {balance:.1e}")
    notes.append(say_lost_volume(history))
    if deck.method == "steady":
        part, change = get_last(history, "buoyancy"), get_last(history, "change")
        if part < 1.0 or change > deck.tolerance:
            head += (
                f"\nNOT STEADY: these are iterates at Ra = {part * deck.rayleigh:.3g} that still "
                f"change by {change:.1e}; more iterations (run.t_end) or method = 'time'"
            )
        notes.append(f"last change of Newton's iteration: {change:.1e}")
    return Report(head, rows, notes)


def say_lost_volume(history) -> str:
    lost = get_last(history, "mass_residual")
    return f"volume lost in a cell, over the largest flux: {lost:.1e}"


def measure_growth(t: np.ndarray, energy: np.ndarray) -> tuple[float, float]:
    """(growth rate [1/s], its spread) from the time and kinetic energy of a disturbance.

    Median of the slopes of log(energy)/2 while the energy is small and after the first steps; the
    spread is half the range of the middle half of the slopes.  nan where too few steps are small.
    """
    known = np.isfinite(energy) & (energy > 0.0)
    t, energy = t[known], energy[known]
    decays = energy[-1] < energy[0]
    small = energy < (np.inf if decays else SMALL * energy.max())
    end = int(np.argmin(small)) if not small.all() else small.size
    if end < 12:
        return math.nan, math.nan
    slopes = 0.5 * np.diff(np.log(energy[4:end])) / np.diff(t[4:end])
    low, middle, high = np.percentile(slopes, (25, 50, 75))
    return float(middle), float(0.5 * (high - low))


def find_onset(problem) -> tuple[float | None, float | None]:
    """(Ra at which growth of the discrete equations begins, the reference); None where unknown."""
    from hydro.convection.box import make_fluid
    from hydro.convection.measure import find_onset as bracket

    reference = problem.find_onset_reference()
    deck = problem.deck
    about = reference or max(deck.rayleigh, 1.0)
    fluid = make_fluid(1.0, deck.prandtl, deck.tilt)
    equations = problem.make_first_equations()
    low, high = (part * about for part in ONSET_BRACKET)
    for _ in range(WIDENINGS):
        try:
            return bracket(equations, fluid, low, high), reference
        except BadInput:  # both ends grow, or both decay
            low, high = 0.1 * low, 10.0 * high
    return None, reference


def report_benard(problem, history) -> Report:
    """Onset and growth rate beside linear theory, heat transported at the end."""
    from hydro.convection.measure import compute_growth, solve_rest

    deck, rows, notes = problem.deck, [], []
    onset = problem.find_onset_reference()
    if deck.onset and deck.tilt == 0.0:
        found, _ = find_onset(problem)
        if found is None:
            notes.append("onset: none was found")
        else:
            rows.append(Row("onset", found, onset or math.nan, "onset, Ra"))
    if deck.tilt == 0.0:
        equations = problem.make_first_equations()
        rest = solve_rest(equations, problem.fluid)
        rate, theory = compute_growth(equations, problem.fluid, *rest)[0], math.nan
        if deck.shape == "layer":
            wavenumber = 2.0 * math.pi / problem.width
            numbers = deck.rayleigh, deck.prandtl, wavenumber, deck.walls == "free"
            theory = compute_layer_growth(*numbers)
        rows.append(Row("eigenvalue", rate, theory, "growth rate, eigenvalue [1/s]"))
        energy = np.asarray(history["kinetic_energy"])
        seen, _ = measure_growth(np.asarray(history["t"]), energy)
        if energy[0] < STILL * deck.amplitude**2:
            notes.append("the disturbance that decays most slowly is heat alone: nothing moves")
        elif math.isfinite(seen):
            rows.append(Row("growth", seen, rate, "growth rate, in time [1/s]"))
            notes.append("growth in time: beside the eigenvalue")
    rows.append(compare(history, "nusselt", label="Nu, floor"))
    rows.append(compare(history, "nusselt_top", label="Nu, ceiling"))
    head = (
        f"{deck.shape}, Ra = {deck.rayleigh:g}, Pr = {deck.prandtl:g}, {deck.cells} x "
        f"{deck.cells_up} cells, grid {deck.grid.kind}"
    )
    return Report(head, rows, [*notes, say_lost_volume(history)])


NAMES = {"i_min": "left", "i_max": "right", "j_min": "bottom", "j_max": "top"}
LEVELS = 14


def make_equations(problem, block):
    """The discrete equations on the grid of a block in a dump."""
    return problem.make_equations(block.nodes[0, :, 0], block.nodes[1, 0])


def draw_flow(problem, figure, run_data) -> None:
    """Streamlines and isotherms of the last dump."""
    from matplotlib.ticker import MaxNLocator

    from hydro.convection.steady import compute_nodal_fields, restrict_nodes

    dump = run_data.dumps[-1]
    (block,) = dump.blocks
    equations = make_equations(problem, block)
    psi = block.node_fields["psi"]
    heat = block.cell_fields["T"].ravel()
    nodal = compute_nodal_fields(equations, restrict_nodes(equations, psi), heat)[2]
    x, y = block.nodes
    wide = np.ptp(x) > 1.6 * np.ptp(y)
    high = float(np.clip(3.7 * np.ptp(y) / np.ptp(x) + 0.9, 3.0, 9.0))
    figure.set_size_inches((7.0, 7.0) if wide else (10.5, high))
    axes = figure.subplots(2, 1) if wide else figure.subplots(1, 2)
    largest = float(np.abs(psi).max()) or 1.0
    levels = np.linspace(psi.min(), psi.max(), LEVELS + 2)[1:-1] if np.ptp(psi) else None
    shades = np.linspace(psi.min(), psi.max(), 41) if np.ptp(psi) else 3
    pale = 1.4 * largest  # so that the lines stay visible on the strongest shade
    picture = axes[0].contourf(x, y, psi, levels=shades, cmap="RdBu_r", vmin=-pale, vmax=pale)
    if levels is not None:
        axes[0].contour(x, y, psi, levels=levels, colors="k", linewidths=0.7, linestyles="-")
    figure.colorbar(
        picture, ax=axes[0], shrink=0.85, label="stream function [m2/s]", ticks=MaxNLocator(7)
    )
    axes[0].set_title(f"streamlines, |psi| up to {largest:.4g}", fontsize=10)
    picture = axes[1].contourf(x, y, nodal, levels=40, cmap="inferno")
    axes[1].contour(x, y, nodal, levels=LEVELS, colors="w", linewidths=0.7, linestyles="-")
    figure.colorbar(picture, ax=axes[1], shrink=0.85, label="temperature [K]", ticks=MaxNLocator(7))
    axes[1].set_title("isotherms", fontsize=10)
    for axis in axes:
        axis.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")


def draw_nusselt(problem, sides, figure, run_data) -> None:
    """Local Nusselt number along two walls in the last dump, and the reference's maximum."""
    from hydro.convection.measure import compute_local_nusselt, find_nusselt_maximum

    dump = run_data.dumps[-1]
    (block,) = dump.blocks
    equations = make_equations(problem, block)
    state = (equations, problem.fluid, block.cell_fields["T"].ravel())
    figure.set_size_inches(7.0, 4.6)
    axis = figure.subplots()
    for side, colour, sign in zip(sides, ("C3", "C0"), (1.0, -1.0), strict=True):
        positions, values = compute_local_nusselt(*state, side, problem.scale)
        words = f"{NAMES[side]} wall, {'in' if sign > 0 else 'out'}"
        axis.plot(positions, sign * values, ".-", color=colour, ms=4, lw=1.0, label=words)
    if sides[0] == "i_min":
        peak, position = find_nusselt_maximum(*state, sides[0], problem.scale)
        axis.plot(position, peak, "k+", ms=10, label=f"maximum {peak:.4g} at {position:.4f}")
        reference = problem.find_reference()
        if reference is not None:
            peak, position = reference.nusselt_max, reference.nusselt_max_y
            style = {"mfc": "none", "color": "0.3", "ms": 9}
            axis.plot(position, peak, "o", label=f"reference {peak:.4g} at {position:.4f}", **style)
    axis.set(xlabel="x [m]" if sides[0].startswith("j") else "y [m]", ylabel="local Nusselt number")
    axis.grid(alpha=0.3)
    axis.legend(fontsize="small")


def draw_grid(figure, run_data) -> None:
    """The grid of the last dump over the speed, and its steps along both axes."""
    (block,) = run_data.dumps[-1].blocks
    x, y = block.nodes
    figure.set_size_inches(11.0, 5.0)
    left, right = figure.subplots(1, 2)
    speed = np.hypot(block.cell_fields["u"], block.cell_fields["v"])
    picture = left.pcolormesh(x, y, speed, cmap="Blues", rasterized=True)
    figure.colorbar(picture, ax=left, shrink=0.85, label="speed [m/s]")
    draw_grid_lines(left, block.nodes, color="0.3", lw=0.3)
    left.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    for nodes, name in ((x[:, 0], "x"), (y[0], "y")):
        steps = np.diff(nodes)
        middle = (0.5 * (nodes[1:] + nodes[:-1]) - nodes[0]) / np.ptp(nodes)
        right.plot(middle, steps * steps.size / np.ptp(nodes), ".-", ms=3, lw=0.8, label=name)
    right.set(xlabel="place, part of the length", ylabel="step over the uniform one")
    right.grid(alpha=0.3)
    right.legend()


def draw_growth(problem, figure, run_data) -> None:
    """Kinetic energy and Nusselt number against time, with the growth of the eigenvalue."""
    from hydro.convection.measure import compute_growth, solve_rest

    history = run_data.history
    t, energy = history["t"], history["kinetic_energy"]
    figure.set_size_inches(10.0, 4.4)
    left, right = figure.subplots(1, 2)
    left.semilogy(t, energy, lw=1.4, label="kinetic energy")
    if problem.deck.tilt == 0.0:
        equations = problem.make_first_equations()
        rate = compute_growth(equations, problem.fluid, *solve_rest(equations, problem.fluid))[0]
        line = energy[0] * np.exp(2.0 * rate * (t - t[0]))
        shown = line <= 3.0 * energy.max()
        left.semilogy(t[shown], line[shown], "k--", lw=0.9, label=f"exp(2 · {rate:.4g} t)")
    left.set(xlabel="t [s]", ylabel="kinetic energy over density [m4/s2]")
    left.legend(fontsize="small")
    right.plot(t, history["nusselt"], lw=1.2, label="floor")
    right.plot(t, history["nusselt_top"], "--", lw=1.2, label="ceiling")
    right.set(xlabel="t [s]", ylabel="Nusselt number")
    right.legend(fontsize="small")
    for axis in (left, right):
        axis.grid(alpha=0.3)
