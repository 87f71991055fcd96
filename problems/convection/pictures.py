"""Pictures of convecting boxes: streamlines, isotherms, heat through the walls, the grid."""

from __future__ import annotations

import numpy as np
from matplotlib.ticker import MaxNLocator

NAMES = {"i_min": "left", "i_max": "right", "j_min": "bottom", "j_max": "top"}
LEVELS = 14


def make_equations(problem, block):
    """The discrete equations on the grid of a block in a dump."""
    return problem.make_equations(block.nodes[0, :, 0], block.nodes[1, 0])


def draw_flow(problem, figure, run_data) -> None:
    """Streamlines and isotherms of the last dump."""
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
        axis.set_aspect("equal")
        axis.set_xlabel("x [m]")
        axis.set_ylabel("y [m]")


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
            axis.plot(
                reference.nusselt_max_y,
                reference.nusselt_max,
                "o",
                mfc="none",
                color="0.3",
                ms=9,
                label=f"reference {reference.nusselt_max:.4g} at {reference.nusselt_max_y:.4f}",
            )
    axis.set_xlabel("x [m]" if sides[0].startswith("j") else "y [m]")
    axis.set_ylabel("local Nusselt number")
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
    left.plot(x, y, color="0.3", lw=0.3)
    left.plot(x.T, y.T, color="0.3", lw=0.3)
    left.set_aspect("equal")
    left.set_xlabel("x [m]")
    left.set_ylabel("y [m]")
    for nodes, name in ((x[:, 0], "x"), (y[0], "y")):
        steps = np.diff(nodes)
        middle = (0.5 * (nodes[1:] + nodes[:-1]) - nodes[0]) / np.ptp(nodes)
        right.plot(middle, steps * steps.size / np.ptp(nodes), ".-", ms=3, lw=0.8, label=name)
    right.set_xlabel("place, part of the length")
    right.set_ylabel("step over the uniform one")
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
    left.set_xlabel("t [s]")
    left.set_ylabel("kinetic energy over density [m4/s2]")
    left.legend(fontsize="small")
    right.plot(t, history["nusselt"], lw=1.2, label="floor")
    right.plot(t, history["nusselt_top"], "--", lw=1.2, label="ceiling")
    right.set_xlabel("t [s]")
    right.set_ylabel("Nusselt number")
    right.legend(fontsize="small")
    for axis in (left, right):
        axis.grid(alpha=0.3)
