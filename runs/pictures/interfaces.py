"""The picture of the interfaces over time."""

from __future__ import annotations

import numpy as np
from matplotlib.colors import Normalize

from regrid.errors import BadInput
from runs.inspection.units import pick_prefix
from runs.pictures.fields import View, check_zoom, find_extent, make_sheets, scale_times
from runs.pictures.outlines import split_outline
from runs.store.reader import Dump


def draw_interfaces(figure, dumps: list[Dump], view: View) -> None:
    """All interfaces at the times of `dumps`, coloured by time; centred if they travel far."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable

    moments = [make_sheets(dump, (), view) for dump in dumps]
    if view.zoom is not None:
        check_zoom(view.zoom, find_extent(moments))
    shapes = [(d.t, split_outline(sheets)[0]) for d, sheets in zip(dumps, moments, strict=True)]
    shapes = [(t, lines) for t, lines in shapes if lines]
    if not shapes:
        raise BadInput(f"{dumps[0].path}: no two materials touch, so there is no interface to draw")
    every = [np.concatenate(lines, axis=1) for _, lines in shapes]
    middles = [0.5 * (points.min(axis=1) + points.max(axis=1)) for points in every]
    sizes = np.max([np.ptp(points, axis=1) for points in every], axis=0)
    travel = np.ptp(middles, axis=0)
    centred = (travel > 0.5 * sizes.max()) & (view.zoom is None)
    largest = float(max(sizes.max(), 0.0 if centred.any() else np.abs(every[0]).max()))
    scale, length = pick_prefix(largest, "m")
    factor, unit = scale_times(dumps)
    norm = Normalize(shapes[0][0] * factor, max(shapes[-1][0] * factor, 1e-300))
    colours = colormaps["viridis_r"]
    figure.set_size_inches(8.0, 6.5)
    axes = figure.subplots()
    for (t, lines), middle in zip(shapes, middles, strict=True):
        shift = np.where(centred, middle, 0.0)
        for line in lines:
            x, y = (line - shift[:, None]) * scale
            axes.plot(x, y, color=colours(norm(t * factor)), linewidth=1.2)
    names = [f"{n} - its middle" if c else n for n, c in zip(dumps[0].axes, centred, strict=True)]
    axes.set_xlabel(f"{names[0]} [{length}]")
    axes.set_ylabel(f"{names[1]} [{length}]")
    stretched = view.zoom is None and sizes.min() < 0.25 * sizes.max()
    axes.set_aspect("auto" if stretched else "equal", adjustable="box" if view.zoom else "datalim")
    if view.zoom:
        axes.set_xlim(view.zoom[0] * scale, view.zoom[1] * scale)
        axes.set_ylim(view.zoom[2] * scale, view.zoom[3] * scale)
    figure.colorbar(ScalarMappable(norm, colours), ax=axes, label=f"t [{unit}]")
    first, last = shapes[0][0] * factor, shapes[-1][0] * factor
    note = ", axes not to one scale" if stretched else ""
    axes.set_title(f"interface, t = {first:.4g} to {last:.4g} {unit}{note}", fontsize=10)
