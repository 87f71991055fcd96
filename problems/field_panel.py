"""Panels of pictures: a field over the grid of a dump, its colour bar, its title."""

from __future__ import annotations

import numpy as np


def draw_field(
    axis, dump, values, *, colours="viridis", low=None, high=None, every=0, lines=(), bar="",
    title="",
):  # fmt: skip
    """Draw a field of all blocks of a dump on an axis; returns the picture for a colour bar.

    values: a name of `cell_fields` or a function `block -> (ni, nj)`; every: draw each so many
    grid lines, 0 none; lines: polylines (2, n) drawn over it; bar: words at a colour bar, none
    without; title: above the panel, "t" for the time.
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
            draw_grid(axis, block.nodes, every)
    for line in lines:
        axis.plot(line[0], line[1], color="w", lw=0.8)
    axis.set_aspect("equal")
    axis.set(**dict(zip(("xlabel", "ylabel"), (f"{name} [m]" for name in dump.axes), strict=True)))
    if bar:
        axis.figure.colorbar(picture, ax=axis, shrink=0.8, label=bar)
    if title:
        words = f"t = {dump.t:.3g} s" if title == "t" else title
        axis.set_title(words, fontsize="medium")
    return picture


def draw_grid(axis, nodes: np.ndarray, every: int = 1, color="k", lw=0.2) -> None:
    """Each so many grid lines of a block's nodes (2, ni + 1, nj + 1)."""
    x, y = nodes
    axis.plot(x[::every].T, y[::every].T, color=color, lw=lw)
    axis.plot(x[:, ::every], y[:, ::every], color=color, lw=lw)
