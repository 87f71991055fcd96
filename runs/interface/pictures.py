"""Pictures as figures that a notebook shows, of a run's directory or of a flow in memory."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from regrid.errors import BadInput
from runs.pictures.command import Wanted, fill_figure, new_figure
from runs.pictures.curves import find_curves

Times = float | str | Sequence[float] | None


class Picture(Figure):
    """A figure that notebooks show as it stands, and that needs no display."""

    def _repr_png_(self) -> bytes:
        image = io.BytesIO()
        self.savefig(image, format="png", dpi=100)
        return image.getvalue()


class Curve(NamedTuple):
    """Where two materials meet at time t [s]: x and y [m], one array each, along the line.

    Where there are several lines a nan stands between them.
    """

    x: np.ndarray
    y: np.ndarray
    t: float


def draw_picture(run: Any, fields: tuple[str, ...], **words: Any) -> Figure:
    """What `shockgrid plot` draws, as a figure; `run` has what RunData has.

    words: of `Wanted`, but numbers for their texts.  Raises BadInput for a field, a picture, a time
    or a part of the plane that is none.
    """
    if words["mirror"] not in (None, "x", "y"):
        raise BadInput(f"mirror = {words['mirror']!r}: 'x' or 'y' is wanted")
    at, beside = words["at"], words["beside"]
    if at is not None and not isinstance(at, str):
        words["at"] = say_numbers(np.atleast_1d(np.asarray(at, float)))
    words["beside"] = None if beside is None else str(beside)
    words |= {name: say_numbers(words[name]) for name in ("zoom", "line", "limits")}
    figure = new_figure(Picture)
    fill_figure(figure, run, Wanted(fields, **words))
    return figure


def say_numbers(numbers: Sequence[float] | np.ndarray | None) -> str | None:
    """Numbers as an option of the command line gives them."""
    return None if numbers is None else ",".join(repr(float(value)) for value in numbers)


def find_interface(blocks: Sequence[Any], t: float, where: str) -> Curve:
    """The lines between blocks of different materials; BadInput where there are none."""
    lines = [curve[:2] for curve in find_curves(blocks).values()]
    if not lines:
        raise BadInput(f"{where}: no two materials touch, so there is no interface")
    gap = np.full((2, 1), np.nan)
    x, y = np.concatenate([part for line in lines for part in (gap, line)][1:], axis=1)
    return Curve(x, y, t)
