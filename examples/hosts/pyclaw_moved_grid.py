"""PyClaw [Mandli2016] on a mapped grid moved by the barrier: a pulse over a line that rolls up.

The flow is the vortex that turns back [LeVeque1996], psi = sin²(pi x) sin²(pi y) cos(pi t/T) / pi.
The lower side of the domain is a line of the fluid: it is carried along, respaced, and the grid
above it is regridded every step.  PyClaw sees the flow relative to the grid,

    kappa q_t + U q_xi + V q_eta = 0,  U = (psi across the edge - area it sweeps / dt) / d eta,

psi at the middle of the step, kappa the mean of the cell's old and new area: constants stay to the
bit.  At t = T line, grid and pulse have to be back.  Note: PyClaw's ghost cells hold edges of
the block's far sides, so that aux arrays come from nodes carried on beyond the sides.

    python -m examples.hosts.pyclaw_moved_grid [--cells 24,48] [--families barrier]

Needs PyClaw: `pip install clawpack` (and a Fortran compiler where there is no wheel).
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.result_tables import Tables
from shockgrid import regrid

GHOSTS = 2
LINE = 0.25  # where the line is at first
PERIOD = 1.5  # [s]: the line stands on edge at half time
PULSE = (0.5, 0.72, 0.25)  # centre and radius


@dataclass
class Passage:
    """What came of one run: grids at start, half time and end, and the pulse there."""

    grids: list[np.ndarray]
    pulses: list[np.ndarray]
    steps: int
    stopped: float | None = None  # time [s] at which there was no grid
    largest_courant: float = 0.0
    worst_sine: float = 1.0
    rescues: int = 0  # and sub-moves

    @property
    def error(self) -> float:
        """Mean of |q - q at first| over the mean of q at first; nan for a run that stopped."""
        if self.stopped is not None:
            return np.nan
        areas = compute_areas(self.grids[0])
        first = self.pulses[0]
        last = self.pulses[-1]
        return float((np.abs(last - first) * areas).sum() / (first * areas).sum())


def compute_stream(x: np.ndarray, y: np.ndarray, t: float) -> np.ndarray:
    """Stream function psi [m2/s]: u = psi_y, v = -psi_x."""
    return np.sin(np.pi * x) ** 2 * np.sin(np.pi * y) ** 2 * np.cos(np.pi * t / PERIOD) / np.pi


def compute_velocity(points: np.ndarray, t: float) -> np.ndarray:
    """Velocity (2, ...) [m/s] at the points (2, ...)."""
    x, y = np.pi * points
    turn = np.cos(np.pi * t / PERIOD)
    return turn * np.array([np.sin(x) ** 2 * np.sin(2.0 * y), -np.sin(2.0 * x) * np.sin(y) ** 2])


def carry_line(line: np.ndarray, t: float, dt: float) -> np.ndarray:
    """The line (2, n) a step later, by the classical Runge-Kutta method, nodes at equal ways."""
    first = compute_velocity(line, t)
    second = compute_velocity(line + 0.5 * dt * first, t + 0.5 * dt)
    third = compute_velocity(line + 0.5 * dt * second, t + 0.5 * dt)
    fourth = compute_velocity(line + dt * third, t + dt)
    moved = line + dt / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)
    return regrid.redistribute(moved, shape="spline")


def make_boundary(line: np.ndarray, ni: int) -> np.ndarray:
    """Sides of the domain between the line (2, nj+1), from right to left, and y = 1."""
    count = line.shape[1]
    boundary = np.full((2, ni + 1, count), np.nan)
    boundary[0, -1] = np.linspace(1.0, 0.0, count)
    boundary[1, -1] = 1.0
    up = np.linspace(0.0, 1.0, ni + 1)
    for j in (0, -1):
        boundary[0, :, j] = line[0, j]
        boundary[1, :, j] = line[1, j] + up * (1.0 - line[1, j])
    boundary[:, 0] = line
    return boundary


def carry_on(nodes: np.ndarray) -> np.ndarray:
    """Nodes with `GHOSTS` more on every side, as far apart as the last two."""
    for axis in (1, 2):
        low, high = (np.take(nodes, [k], axis=axis) for k in (0, -1))
        low_step = low - np.take(nodes, [1], axis=axis)
        high_step = high - np.take(nodes, [-2], axis=axis)
        more = range(1, GHOSTS + 1)
        nodes = np.concatenate(
            [low + k * low_step for k in reversed(more)]
            + [nodes]
            + [high + k * high_step for k in more],
            axis=axis,
        )
    return nodes


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[0] * b[1] - a[1] * b[0]


def compute_areas(nodes: np.ndarray) -> np.ndarray:
    """Areas of the cells (ni, nj), half the product of the diagonals."""
    return 0.5 * cross(nodes[:, 1:, 1:] - nodes[:, :-1, :-1], nodes[:, :-1, 1:] - nodes[:, 1:, :-1])


def compute_sweeps(old: np.ndarray, new: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Areas that edges along j (ni+1, nj) sweep towards +i, and along i (ni, nj+1) towards +j.

    Their differences over a cell are its change of area, to round-off.
    """
    along_j = 0.5 * cross(new[:, :, :-1] - old[:, :, 1:], new[:, :, 1:] - old[:, :, :-1])
    along_i = -0.5 * cross(new[:, :-1] - old[:, 1:], new[:, 1:] - old[:, :-1])
    return along_j, along_i


def compute_aux(old: np.ndarray, new: np.ndarray, t: float, dt: float) -> np.ndarray:
    """PyClaw's aux (3, ni, nj) for the step from `old` at t to `new`: U, V and kappa.

    Computational cells are 1/ni × 1/nj of the block without its ghosts.
    """
    ni, nj = (count - 1 - 2 * GHOSTS for count in old.shape[1:])
    psi = compute_stream(*(0.5 * (old + new)), t + 0.5 * dt)
    along_j, along_i = compute_sweeps(old, new)
    through_j = np.diff(psi, axis=1) - along_j / dt
    through_i = -np.diff(psi, axis=0) - along_i / dt
    areas = 0.5 * (compute_areas(old) + compute_areas(new))
    return np.array([through_j[:-1] * nj, through_i[:, :-1] * ni, areas * ni * nj])


def make_mapping(nodes: np.ndarray) -> Callable:
    """`mapc2p` of PyClaw: bilinear between the nodes of the block, and beyond them."""
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1

    def place(xi, eta):
        i = np.clip(np.floor(xi * ni).astype(int), 0, ni - 1)
        j = np.clip(np.floor(eta * nj).astype(int), 0, nj - 1)
        a = xi * ni - i
        b = eta * nj - j
        low = (1.0 - b) * nodes[:, i, j] + b * nodes[:, i, j + 1]
        high = (1.0 - b) * nodes[:, i + 1, j] + b * nodes[:, i + 1, j + 1]
        return list((1.0 - a) * low + a * high)

    return place


def make_pulse(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A smooth bump of height 1 within its radius."""
    away = np.minimum(np.hypot(x - PULSE[0], y - PULSE[1]) / PULSE[2], 1.0)
    return np.cos(0.5 * np.pi * away) ** 4


def run(cells: int = 48, family: str = "barrier", steps_a_cell: float = 2.0) -> Passage:
    """The passage on `cells` × `cells` cells, to its end or to the first step without a grid."""
    from clawpack import pyclaw, riemann

    regridder = regrid.make_regridder(family)
    line = np.array([np.linspace(1.0, 0.0, cells + 1), np.full(cells + 1, LINE)])
    nodes = regrid.transfinite_grid(make_boundary(line, cells))

    solver = pyclaw.ClawSolver2D(riemann.vc_advection_2D)
    solver.dimensional_split = False
    solver.transverse_waves = 2
    solver.order = 2
    solver.limiters = pyclaw.limiters.tvd.MC
    aux = np.empty((3, cells + 2 * GHOSTS, cells + 2 * GHOSTS))

    def fill_aux(state, dim, t, qbc, auxbc, num_ghost):
        auxbc[...] = aux

    for sides in ("lower", "upper"):
        getattr(solver, f"bc_{sides}")[:] = [pyclaw.BC.extrap] * 2
        getattr(solver, f"aux_bc_{sides}")[:] = [pyclaw.BC.custom] * 2
        setattr(solver, f"user_aux_bc_{sides}", fill_aux)
    domain = pyclaw.Domain([pyclaw.Dimension(0.0, 1.0, cells, name=name) for name in ("xi", "eta")])
    state = pyclaw.State(domain, 1, 3)
    state.index_capa = 2
    state.grid.mapc2p = make_mapping(nodes)
    state.q[0] = make_pulse(*state.grid.p_centers)
    solution = pyclaw.Solution(state, domain)

    steps = int(np.ceil(PERIOD * steps_a_cell * cells / 2.0)) * 2
    dt = PERIOD / steps
    solver.dt_variable = False
    solver.dt = dt
    solver.cfl_max = 1.0
    found = Passage([nodes], [state.q[0].copy()], steps)
    for step in range(steps):
        t = step * dt
        line = carry_line(line, t, dt)
        try:
            result = regridder.regrid(nodes, make_boundary(line, cells))
        except regrid.RegridFailure:
            found.stopped = t + dt
            break
        aux[:] = compute_aux(carry_on(nodes), carry_on(result.nodes), t, dt)
        state.aux[:] = aux[:, GHOSTS:-GHOSTS, GHOSTS:-GHOSTS]
        solver.evolve_to_time(solution, solution.t + dt)
        nodes = result.nodes
        state.grid.mapc2p = make_mapping(nodes)
        quality = regrid.measure_quality(nodes)
        found.largest_courant = max(found.largest_courant, float(solver.cfl.get_cached_max()))
        found.worst_sine = min(found.worst_sine, quality.least_scaled_jacobian)
        found.rescues += result.report.rescues + result.report.sub_moves
        if step + 1 in (steps // 2, steps):
            found.grids.append(nodes)
            found.pulses.append(state.q[0].copy())
    return found


def draw(passage: Passage, path: str) -> None:
    """Grid and pulse at the start, at half time and at the end."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 4.0), layout="constrained")
    titles = ("start", "half time", "end: back at the start")
    panels = figure.subplots(1, 3, sharey=True)
    for axes, grid, pulse, title in zip(panels, passage.grids, passage.pulses, titles, strict=True):
        shown = axes.pcolormesh(*grid, pulse, cmap="Oranges", vmin=0.0, vmax=1.0)
        axes.plot(*grid, color="0.3", linewidth=0.3)
        axes.plot(*grid.transpose(0, 2, 1), color="0.3", linewidth=0.3)
        axes.plot(*grid[:, 0], color="black", linewidth=1.2)
        axes.set(title=title, xlabel="x [m]", aspect="equal")
    panels[0].set_ylabel("y [m]")
    figure.colorbar(shown, ax=list(panels), label="q", shrink=0.8)
    figure.savefig(path, dpi=110, bbox_inches="tight")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cells", default="24,48,96")
    parser.add_argument("--families", default="barrier")
    parser.add_argument("--plot", metavar="FILE", help="the last run that came through")
    tables = Tables(parser)
    options = tables.options
    drawn = None
    for family in options.families.split(","):
        for cells in map(int, options.cells.split(",")):
            passage = run(cells, family)
            through = passage.stopped is None
            tables.add(
                "host-pyclaw",
                family=family,
                cells=f"{cells}²",
                steps=passage.steps,
                **{
                    "stopped at, s": "-" if through else f"{passage.stopped:.2f}",
                    "error of q": passage.error if through else "-",
                    "largest q": float(passage.pulses[-1].max()) if through else "-",
                    "minimum scaled Jacobian": passage.worst_sine,
                    "Courant number": passage.largest_courant,
                },
            )
            drawn = passage if through else drawn
    tables.write()
    if options.plot and drawn:
        draw(drawn, options.plot)


if __name__ == "__main__":
    main()
