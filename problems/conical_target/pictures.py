"""Pictures of `conical-target` at one time: where the materials are, and the state of the graphite.

Each material has one colour in all of them.
"""

from __future__ import annotations

import numpy as np

from problems.references.hugoniot import shock_to_pressure
from regrid.errors import BadInput

COLOURS = {"impactor": "tab:blue", "shell": "0.45", "target": "tab:purple", "filling": "k"}
FACES = {"impactor": "#cfe2f3", "shell": "0.88", "target": "#e6dcf0", "filling": "#f6e3b4"}
LABELS = {"impactor": "impactor", "side": "shell", "behind": "target", "cone": "filling"}
PAINTED = ("impactor", "front", "side", "cone", "ring", "beside", "behind")
MM, GPA, US = 1e3, 1e-9, 1e6


def _find_outlines(dump, following: set[tuple[str, str]]) -> dict[str, list[np.ndarray]]:
    """Polylines (2, n) [m] of each block's sides, cut where they are seams in one material.

    Sides that are laid on another's line are left out: that line is where they touch.
    """
    sides = {}
    for block in dump.blocks:
        x = block.nodes
        lines = {"j_min": x[:, :, 0], "i_max": x[:, -1], "j_max": x[:, :, -1], "i_min": x[:, 0]}
        sides[block.name] = lines
    found = {}
    for block in dump.blocks:
        inside = {
            tuple(point)
            for other in dump.blocks
            if other.name != block.name and other.material == block.material
            for line in sides[other.name].values()
            for point in line.T
        }
        found[block.name] = []
        for side, line in sides[block.name].items():
            if (block.name, side) not in following:
                shared = np.array([tuple(point) in inside for point in line.T])
                seam = np.flatnonzero(shared[1:] & shared[:-1])
                found[block.name].append(np.insert(line, seam + 1, np.nan, axis=1))
    return found


def _draw_materials(axis, dump, names: dict[str, str], following, grid: bool) -> None:
    """Blocks filled with their materials' colours, the lines between, and the grid if asked for.

    Blocks that follow come first: where their chords leave the line, others cover them.
    """
    outlines = _find_outlines(dump, following)
    for block in sorted(dump.blocks, key=lambda block: PAINTED.index(block.name)):
        x, y = MM * block.nodes
        around = [np.concatenate((a[:, 0], a[-1], a[::-1, -1], a[0, ::-1])) for a in (x, y)]
        face = FACES[block.material]
        axis.fill(*around, facecolor=face, edgecolor=face, lw=0.5)
        if grid:
            axis.plot(x, y, color=COLOURS[block.material], lw=0.25)
            axis.plot(x.T, y.T, color=COLOURS[block.material], lw=0.25)
        if block.name in names:
            position = 0.5 * (x.min() + x.max()), 0.5 * (y.min() + y.max())
            if block.name == "cone":
                position = x.mean(), 0.3 * y.max()
            axis.text(*position, names[block.name], ha="center", va="center", fontsize="small")
    for lines in outlines.values():
        for line in lines:
            axis.plot(*(MM * line), color="k", lw=0.8)
    _label_lengths(axis)


def _label_lengths(axis) -> None:
    axis.set(aspect="equal", xlabel="x, mm", ylabel="r, mm")


def draw_configuration(problem, figure, run_data) -> None:
    """Materials at the start and the end, pressure at the end; the graphite and its corner near."""
    figure.set_size_inches(12.0, 7.4)
    grid = figure.add_gridspec(2, 6, height_ratios=(1.0, 1.25))
    top = [figure.add_subplot(grid[0, 2 * n : 2 * n + 2]) for n in range(3)]
    cone_axis, corner = figure.add_subplot(grid[1, :3]), figure.add_subplot(grid[1, 3:])
    first, last = run_data.dumps[0], run_data.dumps[-1]
    following = problem.layout.find_following()
    names = {block: getattr(problem.deck, part) for block, part in LABELS.items()}
    names["cone"] = names["cone"].split("-")[0]
    for axis, dump in zip(top, (first, last), strict=False):
        _draw_materials(axis, dump, names, following, grid=False)
        axis.set_title(f"t = {dump.t * US:.3g} us", fontsize="medium")
    p = [GPA * block.cell_fields["p"] for block in last.blocks]
    least, most = min(field.min() for field in p), max(field.max() for field in p)
    for block, field in zip(last.blocks, p, strict=True):
        picture = top[2].pcolormesh(
            *(MM * block.nodes), field, vmin=least, vmax=most, rasterized=True
        )
    for lines in _find_outlines(last, following).values():
        for line in lines:
            top[2].plot(*(MM * line), color="w", lw=0.5)
    top[2].set_title(f"t = {last.t * US:.3g} us, pressure", fontsize="medium")
    _label_lengths(top[2])
    nodes = [MM * block.nodes for dump in (first, last) for block in dump.blocks]
    left, right = min(n[0].min() for n in nodes), max(n[0].max() for n in nodes)
    highest = max(n[1].max() for n in nodes)
    for axis in top:
        axis.set(xlim=(left - 1.0, right + 1.0), ylim=(0.0, 1.32 * highest))
    bar = figure.colorbar(
        picture, cax=top[2].inset_axes([0.08, 0.9, 0.84, 0.045]), orientation="horizontal"
    )
    bar.ax.tick_params(labelsize="small", pad=1.0)
    bar.ax.set_title("GPa", fontsize="small", loc="right", x=1.08, y=-1.6)
    cone = next(block for block in last.blocks if block.name == "cone")
    for axis in (cone_axis, corner):
        axis.set_facecolor(FACES["shell"])  # what shows between chords and the line is the shell's
        _draw_materials(axis, last, {}, following, grid=True)
    low, high = MM * cone.nodes.min(axis=(1, 2)), MM * cone.nodes.max(axis=(1, 2))
    cone_axis.set(xlim=(low[0] - 1.5, high[0] + 1.5), ylim=(0.0, high[1] + 1.5))
    cone_axis.set_title(f"the graphite at {last.t * US:.3g} us", fontsize="medium")
    x, y = MM * cone.nodes[:, 0, -1]
    corner.set(xlim=(x - 1.6, x + 3.2), ylim=(y - 1.9, y + 1.3))
    corner.set_title("where graphite, steel and lead meet", fontsize="medium")
    figure.set_layout_engine("constrained")


def draw_graphite(problem, figure, run_data) -> None:
    """Part in the second phase over time; states beside the Hugoniot; where the phase is."""
    figure.set_size_inches(12.0, 4.2)
    part, states, map_axes = figure.subplots(1, 3, width_ratios=(1.0, 1.0, 1.3))
    eos, history = problem.materials["filling"].eos, run_data.history
    t = US * np.asarray(history["t"])
    part.plot(t, 100.0 * np.asarray(history["transformed"]), color="k")
    part.set(
        xlabel="t, us",
        ylabel="in the second phase, % of the cone's mass",
        xlim=(0.0, t[-1]),
        ylim=(0.0, None),
    )
    cones = [(d, next(b for b in d.blocks if b.name == "cone")) for d in run_data.dumps]
    shares = [float(np.interp(US * d.t, t, history["transformed"])) for d, _ in cones]
    tops = [block.cell_fields["p"].max() for _, block in cones]
    most = int(np.argmax(shares)) if max(shares) > 0.0 else int(np.argmax(tops))
    chosen = np.unique(np.linspace(0, len(cones) - 1, 6).round().astype(int)[1:])
    for number in sorted({most, *chosen}):
        dump, block = cones[number]
        fields = block.cell_fields
        states.plot(
            fields["rho"].ravel(), GPA * fields["p"].ravel(), ".", ms=1.5, zorder=2,
            label=f"{US * dump.t:.3g} us",
        )  # fmt: skip
    rho, p = sample_hugoniot(problem.materials["filling"], max(tops))
    states.plot(rho, GPA * p, color="k", lw=0.9, zorder=3, label="Hugoniot")
    if eos.mixed_region is not None:
        edges = [eos.rho0 / (1.0 - eta) for eta in eos.mixed_region]
        states.axvspan(*edges, color="0.9", zorder=0)
        states.text(edges[0], 0.0, " mixed", color="0.4", fontsize="small", va="bottom")
        states.set_xlim(0.9 * rho[0], min(1.02 * edges[1], max(1.05 * rho[-1], 1.15 * edges[0])))
    states.set_ylim(
        1.1 * GPA * min(b.cell_fields["p"].min() for _, b in cones), 1.1 * GPA * max(tops)
    )
    states.locator_params(axis="x", nbins=5)
    states.set(xlabel="density, kg/m3", ylabel="pressure, GPa")
    states.legend(fontsize="x-small", markerscale=4.0, loc="upper left")
    dump, block = cones[most]
    x, y = MM * block.nodes
    values = 100.0 * eos.compute_second_part(block.cell_fields["rho"])
    picture = map_axes.pcolormesh(x, y, values, cmap="magma_r", vmin=0.0, rasterized=True)
    map_axes.plot(x[:, -1], y[:, -1], "k", lw=0.8)
    map_axes.plot(x[0], y[0], "k", lw=0.8)
    map_axes.plot(x[-1], y[-1], "k", lw=0.8)
    map_axes.set(aspect="equal", xlabel="x, mm", ylabel="r, mm")
    map_axes.set_title(f"t = {US * dump.t:.3g} us", fontsize="medium")
    figure.colorbar(picture, ax=map_axes, shrink=0.7, label="second phase, %")
    figure.set_layout_engine("constrained")


def sample_hugoniot(material, top: float) -> tuple[np.ndarray, np.ndarray]:
    """Densities and pressures of single shocks from rest up to the pressure `top`, if there are."""
    points = [(material.rho0, 0.0)]
    for p in np.linspace(0.0, 1.05 * top, 60)[1:]:
        try:
            points.append((shock_to_pressure(material.eos, material.rho0, 0.0, p).rho, p))
        except BadInput:  # beyond its table
            break
    return tuple(np.array(points).T)
