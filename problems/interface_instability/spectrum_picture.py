"""The picture of an interface of many modes: their sizes by number, beside linear theory."""

from __future__ import annotations

import numpy as np

from problems.interface_instability.theories import get_kct, predict_amplitude

SHOWN = 3  # times, besides the start


def draw_spectrum(problem, figure, run) -> None:
    """k a of each mode by its number at some times, and the line at these times.

    Theory is drawn where there is one: for a single shock, and for small slopes alone right.
    """
    history, modes = run.history, problem.harmonics
    known = np.flatnonzero(np.isfinite(history["amplitude"]))
    numbers = np.array([mode.number for mode in modes])
    first = np.array([mode.amplitude for mode in modes])
    kct = np.asarray(get_kct(problem, history["t"]), dtype=float)
    last = kct[known[-1]]
    from matplotlib.ticker import MaxNLocator

    axes, lines = figure.subplots(1, 2, width_ratios=(2.0, 1.0))
    axes.semilogy(numbers, np.abs(first) * problem.k, "o-", color="0.6", ms=3, label="start")
    for n in range(SHOWN):
        row = known[np.argmin(np.abs(kct[known] - last * (n + 1) / SHOWN))]
        size = np.array([history[mode.column][row] for mode in modes])
        colour, words = f"C{n}", f"k c t = {kct[row]:.3g}"
        axes.semilogy(numbers, np.abs(size) * problem.k, "o", color=colour, ms=4, label=words)
        if problem.deck.second_shock is None and kct[row] > 0.0:
            theory = first * predict_amplitude(problem.theory, numbers * kct[row])
            axes.semilogy(numbers, np.abs(theory) * problem.k, "--", color=colour, lw=1)
        if run.dumps:
            nodes = run.dump_at(float(history["t"][row])).blocks[0].nodes[:, -1, :]
            lines.plot(nodes[0] - nodes[0].mean(), nodes[1], color=colour, lw=1)
    axes.plot([], [], "k--", lw=1, label="linear compressible")
    axes.set_xlabel("number of the mode")
    axes.set_ylabel("size of the mode: k |a|, k of the wavelength")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, frameon=False)
    lines.set_xlabel("x less its mean [m]")
    lines.set_ylabel("y [m]")
    lines.set_title("the line at these times", fontsize=9)
    lines.grid(alpha=0.3)
    lines.xaxis.set_major_locator(MaxNLocator(4))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
