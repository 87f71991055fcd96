"""One panel of a picture: a field over a block's grid."""

from __future__ import annotations

import numpy as np


def draw_field(axis, dump, values, *, colours="viridis", low=None, high=None, every=0, lines=()):
    """Draw a field of all blocks of a dump on an axis; returns the picture for a colour bar.

    values: a name of `cell_fields` or a function `block -> (ni, nj)`; every: draw each so many
    grid lines, 0 none; lines: polylines (2, n) drawn over it.
    """
    make = values if callable(values) else (lambda block: block.cell_fields[values])
    fields = [make(block) for block in dump.blocks]
    low = min(float(np.nanmin(field)) for field in fields) if low is None else low
    high = max(float(np.nanmax(field)) for field in fields) if high is None else high
    picture = None
    for block, field in zip(dump.blocks, fields, strict=True):
        x, y = block.nodes
        picture = axis.pcolormesh(x, y, field, cmap=colours, vmin=low, vmax=high, rasterized=True)
        if every:
            axis.plot(x[::every].T, y[::every].T, color="k", lw=0.2)
            axis.plot(x[:, ::every], y[:, ::every], color="k", lw=0.2)
    for line in lines:
        axis.plot(line[0], line[1], color="w", lw=0.8)
    axis.set_aspect("equal")
    for name, label in zip(dump.axes, (axis.set_xlabel, axis.set_ylabel), strict=True):
        label(f"{name} [m]")
    return picture
