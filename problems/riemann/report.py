"""The closing screen and the picture of `riemann`: computed beside exact."""

from __future__ import annotations

import math

import numpy as np

LABELS = {"rho": "density [kg/m3]", "u": "velocity [m/s]", "p": "pressure [Pa]"}


def make_summary(problem, history) -> str:
    """Error of the density and a table of the star states."""
    deck = problem.deck
    where = "on a grid line" if deck.contact == "on-line" else f"captured, grid {deck.mesh}"
    lines = [
        f"riemann problem {problem.name!r}, {deck.cells} cells, contact {where}: "
        f"L1(rho) = {history['l1_rho'][-1]:.3g} kg/m2",
        "  star state        computed           exact        error",
    ]
    for name, (exact, size) in problem.star_states().items():
        found = history[f"star_{name}"][-1]
        quantity, side = name.split("_")
        if math.isnan(found):
            lines.append(f"  {quantity:3} {side:6} {'no cell':>16} {exact:16.9g}")
            continue
        error = (found - exact) / size
        lines.append(f"  {quantity:3} {side:6} {found:16.9g} {exact:16.9g} {error:11.3%}")
    return "\n".join(lines + list(explain_empty(problem, history)))


def explain_empty(problem, history):
    """A line for each plateau that has no cell in its middle half."""
    t, exact = float(history["t"][-1]), problem.exact
    for side, wave in (("left", exact.left_wave), ("right", exact.right_wave)):
        if math.isnan(history[f"star_p_{side}"][-1]):
            yield (
                f"  the {side} plateau, {abs(wave.tail - exact.u) * t:.3g} m wide, has no cell in "
                "its middle half: more cells, lengths left out, or a larger grading"
            )


def draw_profiles(problem, figure, run_data) -> None:
    """Density, velocity and pressure along x in the last dump over the exact solution."""
    dump = run_data.dumps[-1]
    axes = figure.subplots(1, 3)
    ends = [block.nodes[0, [0, -1], 0] for block in dump.blocks]
    x = np.linspace(np.min(ends), np.max(ends), 2000)
    if dump.t > 0.0:
        speeds = problem.exact.get_speeds() * dump.t
        speeds = speeds[(speeds > x[0]) & (speeds < x[-1])]
        x = np.unique(np.concatenate([x, speeds, np.nextafter(speeds, np.inf)]))
        exact = dict(zip(LABELS, problem.exact.sample(x / dump.t), strict=True))
        for axis, values in zip(axes, exact.values(), strict=True):
            axis.plot(x, values, color="0.6", lw=1.2, label="exact")
    for axis, (name, label) in zip(axes, LABELS.items(), strict=True):
        for block, colour in zip(dump.blocks, ("C0", "C3"), strict=False):
            edges = block.nodes[0, :, 0]
            axis.plot(
                0.5 * (edges[1:] + edges[:-1]),
                block.cell_fields[name][:, 0],
                ".",
                ms=3,
                color=colour,
                label=block.name if len(dump.blocks) > 1 else "computed",
            )
        axis.set_xlabel("x [m]")
        axis.set_title(label, fontsize="medium")
        values = np.concatenate([block.cell_fields[name][:, 0] for block in dump.blocks])
        if name != "u" and values.min() > 0.0 and values.max() > 300.0 * values.min():
            axis.set_yscale("log")
    axes[0].legend(fontsize="small")
    figure.suptitle(f"{problem.name}, t = {dump.t:.4g} s", fontsize="medium")
