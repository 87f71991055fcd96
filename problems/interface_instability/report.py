"""Closing screen and pictures of `interface-instability`: measured growth beside theory."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from problems.references.growth_models import compute_atwood_number, compute_pade_amplitude
from regrid.measure.centres import compute_centres

WINDOW = (6.0, 30.0)  # k c t over which the growth rate is averaged
LINEAR = 0.1  # largest k a0 for which linear theory is the reference
SHOWN = 3  # times drawn beside the growth


def _columns(history: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The columns used here, without rows that have no amplitude."""
    names = ("t", "amplitude", "amplitude_mode_1", "interface_mean", "interface_min",
             "interface_max", "far_transverse_speed")  # fmt: skip
    column = {name: np.asarray(history[name], dtype=float) for name in names}
    known = np.isfinite(column["amplitude"]) & np.isfinite(column["t"])
    return {name: values[known] for name, values in column.items()}


def _kct(problem, t):
    """k c t since the shock met the mean interface."""
    return (np.asarray(t) - problem.arrival) * problem.k * problem.theory.sound_speed


def measure_growth(problem, history, first: float = WINDOW[0], last: float = WINDOW[1]) -> float:
    """Mean (da/dt)/(k a0) of the first mode over first < k c t < last, in units of velocity.

    NaN when the history does not reach so far.  The counterpart of `LinearGrowth.get_mean_rate`.
    """
    column = _columns(history)
    kct = _kct(problem, column["t"])
    if kct[-1] < last - 1e-6:
        return float("nan")
    grown = np.interp((first, last), kct, column["amplitude_mode_1"])
    duration = (last - first) / (problem.k * problem.theory.sound_speed)
    return float((grown[1] - grown[0]) / duration / (problem.k * _first_amplitude(problem)))


def _first_amplitude(problem) -> float:
    """Signed amplitude of the first harmonic before the shock."""
    modes = [mode for mode in problem.deck.modes if mode.number == 1]
    return sum(mode.ka0 * np.cos(mode.phase) for mode in modes) / problem.k


def _is_linear(problem) -> bool:
    return (
        problem.deck.second_shock is None
        and len(problem.deck.modes) == 1
        and _first_amplitude(problem) != 0.0
        and problem.k * problem.amplitude <= LINEAR
    )


def compute_model(problem, t: np.ndarray) -> np.ndarray:
    """Non-linear amplitude (Zhang–Sohn Padé from the linear asymptotic rate) at times t."""
    theory = problem.theory
    start = abs(_first_amplitude(problem))
    base = theory.base
    atwood = compute_atwood_number(base.rho_left, base.rho_right)
    rate = abs(theory.get_asymptotic_rate()) * problem.k * start
    after = np.maximum(t - problem.arrival, 0.0)
    grown = np.full(t.shape, start * theory.compression)
    late = after > 0.0
    if late.any():
        times = np.concatenate([[0.0], after[late]])
        model = compute_pade_amplitude(problem.k, start * theory.compression, rate, atwood, times)
        grown[late] = model[1:]
    return grown


def make_summary(problem, history) -> str:
    """What was computed and how far it is from theory, as lines of text."""
    column = _columns(history)
    theory, deck = problem.theory, problem.deck
    base = theory.base
    kct = float(_kct(problem, column["t"][-1]))
    atwood = compute_atwood_number(base.rho_left, base.rho_right)
    lines = [
        f"shock to p = {problem.shock.p:g} through rho = {problem.rho_first:g} onto rho = "
        f"{problem.rho_second:g}; k a0 = {problem.k * problem.amplitude:g}, "
        f"{deck.cells} cells a wavelength, to k c t = {kct:.3g}",
        f"  reflected wave: {theory.reflected}, Atwood number after the shock {atwood:.3f}",
        "                                   computed     theory   difference",
    ]
    after = column["t"] > problem.arrival + 0.3 * (column["t"][-1] - problem.arrival)
    if deck.second_shock is None and after.sum() > 2:
        speed = np.polyfit(column["t"][after], column["interface_mean"][after], 1)[0]
        lines.append(_line("interface speed", speed, base.u, "exact Riemann solution"))
    last = min(WINDOW[1], kct)
    if _is_linear(problem) and last > WINDOW[0] + 1.0:
        rate = measure_growth(problem, history, WINDOW[0], last)
        words = f"(da/dt)/(k a0), {WINDOW[0]:g} < k c t < {last:.3g}"
        lines += [
            _line(words, rate, theory.get_mean_rate(WINDOW[0], last), "linear compressible theory"),
            f"  {'impulsive model, for comparison':32s} {'':>9s}  {theory.impulsive:9.5g}",
        ]
    elif deck.second_shock is None and _first_amplitude(problem) != 0.0:
        model = compute_model(problem, column["t"])
        lines.append(
            _line("amplitude at the end", column["amplitude"][-1], model[-1], "Padé model, rough")
        )
    else:
        lines.append("  growth: no theory at hand for two shocks or without a first harmonic")
    lines.append(
        f"  amplitude {column['amplitude'][0]:.4g} -> {column['amplitude'][-1]:.4g}, largest "
        f"transverse speed in the far field "
        f"{column['far_transverse_speed'].max() / theory.sound_speed:.1e} of the sound speed"
    )
    return "\n".join(lines)


def _line(words: str, computed: float, reference: float, source: str) -> str:
    difference = 100.0 * (computed / reference - 1.0)
    return f"  {words:32s} {computed:9.5g}  {reference:9.5g}  {difference:+8.2f} %   {source}"


def draw_growth(problem, figure, run) -> None:
    """Amplitude and growth rate against theory, and the interface with its grid at the end."""
    column = _columns(run.history)
    theory = problem.theory
    kct = _kct(problem, column["t"])
    start = abs(_first_amplitude(problem)) or problem.amplitude
    grid = figure.add_gridspec(2, SHOWN, height_ratios=(1.0, 1.1))
    amplitude = figure.add_subplot(grid[0, 0])
    rate = figure.add_subplot(grid[0, 1:])
    signed = column["amplitude_mode_1"] if _is_linear(problem) else column["amplitude"]
    norm = _first_amplitude(problem) if _is_linear(problem) else start
    amplitude.plot(kct, signed / norm, color="C0", label="computed")
    known = (kct > 0.0) & (kct <= theory.kt[-1] * theory.sound_speed)
    t = column["t"][known] - problem.arrival
    linear = _first_amplitude(problem) != 0.0 and problem.deck.second_shock is None
    if linear:
        amplitude.plot(
            kct[known], theory.get_amplitude(problem.k, t), "k--", label="linear compressible"
        )
        if not _is_linear(problem):
            model = compute_model(problem, column["t"]) / start
            amplitude.plot(kct, model, "C1:", label="Padé model")
            amplitude.set_ylim(0.0, 1.6 * max(model.max(), column["amplitude"].max() / start))
        rate.plot(kct[known], theory.get_rate(problem.k, t), "k--", label="linear compressible")
        rate.axhline(theory.impulsive, color="0.6", lw=0.8, label="impulsive")
    if len(kct) > 3:
        width = max(1, len(kct) // 200)
        speed = (signed[width:] - signed[:-width]) / (column["t"][width:] - column["t"][:-width])
        middle = 0.5 * (kct[width:] + kct[:-width])
        speed = speed / (problem.k * norm)
        shown = middle > 0.0
        settled = speed[middle > 1.0]  # before, the shock is passing through the interface
        if settled.size:
            settled = np.concatenate([settled, rate.dataLim.intervaly]) if linear else settled
            span = np.ptp(settled)
            low, high = min(0.0, settled.min() - 0.1 * span), settled.max() + 0.1 * span
            rate.set_ylim(low, high)
            passing = np.flatnonzero((middle <= 1.0) & ((speed < low) | (speed > high)))
            shown[: passing[-1] + 1 if passing.size else 0] = False
        rate.plot(middle[shown], speed[shown], color="C0", label="computed, shock past")
    for axes, words in ((amplitude, "a / a0"), (rate, "(da/dt) / (k a0)")):
        axes.set_xlabel("k c t after the shock's arrival")
        axes.set_ylabel(words)
        axes.legend(fontsize=8, frameon=False)
        axes.grid(alpha=0.3)
    dumps = run.dumps
    chosen = sorted({round((n + 1) * (len(dumps) - 1) / SHOWN) for n in range(SHOWN)})
    fields = [find_shown(problem, dumps[number]) for number in chosen]
    scale = min(f.min() for f in fields), max(f.max() for f in fields)
    panels = [figure.add_subplot(grid[1, column]) for column in range(len(chosen))]
    for axes, number in zip(panels, chosen, strict=True):
        mesh = _draw_grid(axes, problem, dumps[number], scale)
    if panels:
        panels[0].set_ylabel("y [m]")
        figure.colorbar(mesh, ax=panels, label="density [kg/m3]")


def find_window(problem, dump) -> tuple[float, float]:
    """Least and greatest x [m] of the picture around the interface."""
    x, y = dump.blocks[0].nodes[:, -1, :]
    middle, half = 0.5 * (x.min() + x.max()), 0.5 * np.ptp(y)
    reach = max(0.6 * np.ptp(x) + 0.05 * problem.deck.wavelength, half)
    return middle - reach, middle + reach


def find_shown(problem, dump) -> np.ndarray:
    """Densities of the cells that lie in the window of the dump's picture."""
    low, high = find_window(problem, dump)
    shown = []
    for block in dump.blocks:
        x = compute_centres(block.nodes)[0]
        shown.append(block.cell_fields["rho"][(x >= low) & (x <= high)])
    return np.concatenate(shown)


def _draw_grid(axes, problem, dump, scale):
    """Both grids around the interface at one time, coloured by density on one scale.

    Returns what a colour bar needs.
    """
    line = dump.blocks[0].nodes[:, -1, :]
    fields = [block.cell_fields["rho"] for block in dump.blocks]
    low, high = scale
    for block, field in zip(dump.blocks, fields, strict=True):
        x, y = block.nodes
        mesh = axes.pcolormesh(
            x,
            y,
            field,
            vmin=low,
            vmax=high,
            cmap="viridis",
            edgecolor=(1, 1, 1, 0.25),
            linewidth=0.15,
        )
    axes.plot(line[0], line[1], color="C3", lw=1.2)
    axes.set_xlim(*find_window(problem, dump))
    axes.set_aspect("equal")
    axes.set_xlabel("x [m]")
    axes.set_title(f"density and grid, k c t = {float(_kct(problem, dump.t)):.1f}", fontsize=9)
    return mesh
