"""Screen and pictures of the bubble: published velocities, space-time diagram, shadowgraphs.

Haas and Sturtevant fitted straight lines to the places of waves and edges in their photographs;
so are the histories here.  The trap: most of these speeds change while they are fitted, so that the
window counts more than the scheme; the windows are printed beside the figures.

Source: [HaasSturtevant1987], table 2; [QuirkKarni1996], table 3.  The light gas's figures
were confirmed in other publications' quotations; the heavy gas's are quoted from memory, but for
the incident shock's.  The fixed grid's are of problems/shock_bubble/fixed_grid.py.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from regrid.measure.corners import compute_centres
from regrid.sides import SIDE_NAMES, get_side

MICRO = 1e-6
DECADES = 1.3  # of gradients that are drawn, from those that 1 % of a picture's nodes exceed
# Times of photographs [us] after the shock's arrival, the heavy gas's 115, 187 and 318 from memory;
# 340 added.
PHOTOGRAPHS = {
    "helium": (32, 62, 102, 245, 340, 427, 674),
    "R22": (55, 115, 187, 247, 318, 417, 1020),
}


class Feature(NamedTuple):
    """A velocity: what, its history column, window, and what others have for it [m/s].

    Window in microseconds after the shock's arrival; a name stands for the moment the refracted
    shock leaves the bubble, `exit`, some microseconds added.  measured: Haas and Sturtevant's;
    computed: Quirk and Karni's; fixed_grid: on 200 cells a diameter, by other means.
    """

    words: str
    column: str
    window: tuple[float | str, float | str]
    measured: float
    computed: float
    fixed_grid: float


FEATURES = {
    "helium": (
        Feature("incident shock", "wall_front", (0, 50), 410, 422, 415.2),
        Feature("refracted shock", "axis_front", (5, "exit"), 900, 943, 939.7),
        Feature("transmitted shock", "axis_front", ("exit+10", 250), 393, 377, 375.4),
        Feature("upwind end", "upwind", (0, 50), 170, 178, 176.7),
        Feature("jet of air", "upwind", (100, 250), 230, 227, 215.7),
        Feature("downwind end", "downwind", ("exit+10", 250), 145, 146, 131.7),
        Feature("rearmost point", "rear", (300, 1000), 113, math.nan, 110.2),
    ),
    "R22": (
        Feature("incident shock", "wall_front", (0, 100), 415, 420, 415.2),
        Feature("refracted shock", "axis_front", (5, 170), 240, 254, 241.6),
        Feature("upwind end", "upwind", (0, 200), 73, 74, 70.2),
        Feature("upwind end to 400 us", "upwind", (0, 400), math.nan, math.nan, 65.0),
        Feature("downwind end", "downwind", (200, 400), 78, 116, 91.9),
    ),
}
# When the heavy bubble's downwind end, which the shock in the air had pushed upwind, turns:
# microseconds after the shock's arrival, on the fixed grid.
FOCUS = {"R22": 200.8}


def find_focus(problem, history) -> float:
    """When the refracted shock comes to its focus at the downwind end and turns it [s]; nan before.

    Counted from the shock's arrival.
    """
    since = history["t"] - problem.arrival
    if since[-1] < 250.0 * MICRO:
        return math.nan
    inside = np.flatnonzero((since > 100.0 * MICRO) & (since < 250.0 * MICRO))
    return float(since[inside[np.argmin(history["downwind"][inside])]])


def find_exit(problem, history) -> float:
    """When the refracted shock leaves the bubble [s]; nan before."""
    out = np.flatnonzero(history["axis_front"] > history["downwind"])
    return float(history["t"][out[0]]) if out.size else math.nan


def compute_window(problem, history, feature: Feature) -> tuple[float, float] | None:
    """Start and end [s] of a feature's window in a run, None where the run is not there yet.

    A window is complete when the run has passed its end; of the rearmost point's, a third suffices.
    """
    left = find_exit(problem, history)
    times = []
    for mark in feature.window:
        if isinstance(mark, str):
            times.append(left + float(mark.partition("+")[2] or 0.0) * MICRO)
        else:
            times.append(problem.arrival + mark * MICRO)
    start, end = times
    last = float(history["t"][-1])
    if feature.column == "rear" and last > start + 100.0 * MICRO:
        end = min(end, last)
    if not start < end <= last * (1.0 + 1e-12):
        return None
    return start, end


def fit_velocity(problem, history, feature: Feature) -> float:
    """Slope [m/s] of the straight line through a feature's places in its window, nan before.

    The line is fitted to equally many places in equal times, whatever the steps were.
    """
    window = compute_window(problem, history, feature)
    if window is None:
        return math.nan
    t = np.linspace(*window, 101)
    return float(np.polyfit(t - t[0], np.interp(t, history["t"], history[feature.column]), 1)[0])


def make_summary(problem, history) -> str:
    """What was computed beside what was measured and computed elsewhere."""
    deck, t, volume = problem.deck, history["t"], history["volume"]
    source = "" if deck.gas == "helium" else " (published ones from memory)"
    lines = [
        f"shock-bubble, {deck.gas} in air, Mach {deck.mach:g}, "
        f"t = {(t[-1] - problem.arrival) / MICRO:.4g} us after the shock's arrival:",
    ]
    head = f"  velocities [m/s]{'':14s}here  fixed grid  measured  computed   window [us]{source}"
    for feature in FEATURES[deck.gas] if deck.mach == problem.Deck().mach else ():
        window = compute_window(problem, history, feature)
        if window is None:
            continue
        if len(lines) == 1:
            lines.append(head)
        start, end = ((time - problem.arrival) / MICRO for time in window)
        others = [
            "" if math.isnan(speed) else f"{speed:g}"
            for speed in (feature.fixed_grid, feature.measured, feature.computed)
        ]
        lines.append(
            f"  {feature.words:24s}{fit_velocity(problem, history, feature):10.1f}"
            f"{others[0]:>12s}{others[1]:>10s}{others[2]:>10s}   {start:.0f}-{end:.0f}"
        )
    lines += [
        f"  plane waves: shock {problem.shock.shock_speed:.1f}, refracted shock "
        f"{problem.contact.right_wave.head:.1f}, contact {problem.contact.u:.1f} m/s; the upwind "
        f"end at first {problem.find_upwind_speed(t, history['upwind']):.1f}",
        f"  bubble from x = {1e3 * history['upwind'][-1]:.2f} to "
        f"{1e3 * history['downwind'][-1]:.2f} mm on the axis, "
        f"{1e3 * history['height'][-1]:.2f} mm high, "
        f"{volume[-1] / volume[0]:.4f} of its first volume",
    ]
    return "\n".join(lines)


def find_neighbours(blocks) -> dict[tuple[int, str], tuple[int, str, bool]]:
    """Which side of which block of the same material lies at a block's side, and if it runs back.

    Keys and values: index of the block, side; a side is known again by its nodes, which are the
    neighbour's to the bit or nearly so.
    """
    lines = {}
    for number, block in enumerate(blocks):
        for side in SIDE_NAMES:
            lines[number, side] = get_side(block.nodes, side)
    found = {}
    for one, line in lines.items():
        for other, there in lines.items():
            same = blocks[one[0]].material == blocks[other[0]].material
            if one == other or not same or line.shape != there.shape:
                continue
            for back in (False, True):
                if np.allclose(line, there[:, ::-1] if back else there, rtol=0.0, atol=1e-9):
                    found[one] = (*other, back)
    return found


def pad_over_seams(fields: list[np.ndarray], neighbours: dict) -> list[np.ndarray]:
    """Fields (ni, nj) of all blocks in frames (ni + 2, nj + 2).

    At a seam the frame is the neighbour's row, elsewhere the block's own again.
    """
    wide = [np.pad(field, 1, mode="edge") for field in fields]
    for (number, side), (other, there, back) in neighbours.items():
        row = np.moveaxis(fields[other], "ij".index(there[0]), 0)[
            0 if there.endswith("min") else -1
        ]
        frame = np.moveaxis(wide[number], "ij".index(side[0]), 0)
        frame[0 if side.endswith("min") else -1, 1:-1] = row[::-1] if back else row
    return wide


def compute_shadows(blocks) -> list[np.ndarray]:
    """Size of the gradient of the density's logarithm at the nodes (ni+1, nj+1) of blocks [1/m].

    Differences over both neighbours of a cell, of a seam's other side too, over one at a wall or
    an interface; then means over the cells around a node: a jump at a contact is not in it.
    """
    neighbours = find_neighbours(blocks)
    centres = [compute_centres(block.nodes) for block in blocks]
    logs = [np.log(block.cell_fields["rho"]) for block in blocks]
    x, y, rho = (
        pad_over_seams(list(fields), neighbours)
        for fields in ([c[0] for c in centres], [c[1] for c in centres], logs)
    )
    sizes = []
    for x_wide, y_wide, rho_wide in zip(x, y, rho, strict=True):
        (x_i, y_i, rho_i), (x_j, y_j, rho_j) = (
            [field[2:, 1:-1] - field[:-2, 1:-1] for field in (x_wide, y_wide, rho_wide)],
            [field[1:-1, 2:] - field[1:-1, :-2] for field in (x_wide, y_wide, rho_wide)],
        )
        area = x_i * y_j - x_j * y_i
        sizes.append(
            np.hypot((rho_i * y_j - rho_j * y_i) / area, (rho_j * x_i - rho_i * x_j) / area)
        )
    return [compute_centres(wide) for wide in pad_over_seams(sizes, neighbours)]


def choose_dumps(problem, run_data) -> list:
    """Dumps nearest to the times of the experiment's photographs, each once, and the last."""
    last = run_data.dumps[-1]
    chosen = {}
    for time in PHOTOGRAPHS[problem.deck.gas]:
        wanted = problem.arrival + time * MICRO
        dump = min(run_data.dumps, key=lambda dump, t=wanted: abs(dump.t - t))
        if dump.t > problem.arrival and wanted <= last.t * (1.0 + 1e-12):
            chosen[dump.t] = dump
    chosen[last.t] = last
    return list(chosen.values())


def draw_shadowgraphs(problem, figure, run_data) -> None:
    """Density gradients as a shadowgraph shows them, the grid mirrored below, at six times."""
    dumps = choose_dumps(problem, run_data)
    columns = min(3, len(dumps))
    rows = -(-len(dumps) // columns)
    figure.set_size_inches(4.2 * columns, 3.9 * rows)
    panels = figure.subplots(rows, columns, squeeze=False)
    for axis in panels.ravel()[len(dumps) :]:
        axis.remove()
    for number, (axis, dump) in enumerate(zip(panels.ravel(), dumps, strict=False)):
        draw_shadowgraph(axis, problem, dump)
        axis.set_title(f"{(dump.t - problem.arrival) / MICRO:.0f} µs", fontsize="medium")
        axis.set_xlabel("x [mm]")
        if number % columns == 0:
            axis.set_ylabel("y [mm]")


def draw_shadowgraph(axis, problem, dump) -> None:
    """One time: gradients above the axis, the grid below it, the bubble's surface around."""
    gas = problem.deck.gas
    shadows = compute_shadows(dump.blocks)
    most = float(np.percentile(np.concatenate([shadow.ravel() for shadow in shadows]), 99.0))
    for block, shadow in zip(dump.blocks, shadows, strict=True):
        x, y = 1e3 * block.nodes
        dark = np.log10(np.maximum(shadow / most, 1e-9))
        axis.pcolormesh(
            x, y, dark, cmap="Greys", shading="gouraud", vmin=-DECADES, vmax=0.2, rasterized=True
        )
        colour = "C0" if block.material == gas else "0.6"
        axis.plot(x.T, -y.T, color=colour, lw=0.2)
        axis.plot(x, -y, color=colour, lw=0.2)
    for name, row in (("west", 0), ("north", -1), ("east", -1)):
        x, y = 1e3 * dump.block(name).nodes[:, row]
        axis.plot(x, y, color="k", lw=1.0)
        axis.plot(x, -y, color="k", lw=1.0)
    ends = [1e3 * dump.block(name).nodes[0] for name in ("west", "north", "east")]
    middle = 0.5 * (min(x.min() for x in ends) + max(x.max() for x in ends))
    axis.set_aspect("equal")
    axis.set_xlim(middle - 48.0, middle + 48.0)
    axis.set_ylim(-44.5, 44.5)


def draw_space_time(problem, figure, run_data) -> None:
    """Places of the bubble's ends and of the shocks over time, with the measured velocities."""
    history = run_data.history
    axis = figure.subplots()
    figure.set_size_inches(7.5, 6.0)
    t = (history["t"] - problem.arrival) / MICRO
    inside = history["axis_front"] < problem.far_end - 1e-3
    columns = (
        ("upwind", "upwind end, then jet", "C3"),
        ("rear", "rearmost point", "C1"),
        ("downwind", "downwind end", "C0"),
        ("axis_front", "shock on the axis", "C2"),
        ("wall_front", "shock at the wall", "0.5"),
    )
    for name, words, colour in columns:
        positions = np.where(inside, history[name], np.nan) if "front" in name else history[name]
        axis.plot(1e3 * positions, t, color=colour, label=words)
    for feature in FEATURES[problem.deck.gas] if problem.deck.mach == problem.Deck().mach else ():
        window = compute_window(problem, history, feature)
        if window is None or math.isnan(feature.measured):
            continue
        ends = np.array(window)
        middle = ends.mean()
        at = np.interp(np.linspace(*window, 101), history["t"], history[feature.column]).mean()
        positions = at + feature.measured * (ends - middle)
        axis.plot(1e3 * positions, (ends - problem.arrival) / MICRO, "k--", lw=1.0)
    axis.plot([], [], "k--", lw=1.0, label="measured velocities")
    axis.set_xlim(-40.0, 1e3 * max(float(history["downwind"].max()) + 0.03, 0.08))
    axis.set_ylim(min(t[0], 0.0), t[-1])
    axis.set_xlabel("x [mm]")
    axis.set_ylabel("time after the shock's arrival [µs]")
    axis.legend(loc="lower right", frameon=False)
    axis.set_title(f"{problem.deck.gas}, {problem.deck.cells} cells", fontsize="medium")
