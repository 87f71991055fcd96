"""Pictures as figures that a notebook shows, of a run's directory or of a flow in memory."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from regrid.errors import BadInput
from runs.pictures.command import Wanted, fill_figure, new_figure
from runs.pictures.fields import split_outline

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


def draw_picture(run: Any, fields: tuple[str, ...], what: str | None, **words: Any) -> Figure:
    """What `shockgrid plot` draws, as a figure; `run` has what RunData has.

    words: of `Wanted`, but numbers for their texts.  Raises BadInput for a field, a picture, a time
    or a part of the plane that is none.
    """
    if words["mirror"] not in (None, "x", "y"):
        raise BadInput(f"mirror = {words['mirror']!r}: 'x' or 'y' is wanted")
    figure = new_figure(Picture)
    words |= {name: say_numbers(words[name]) for name in ("zoom", "line", "limits")}
    beside, at = words["beside"], _say_times(words.get("at"))
    words |= {"beside": None if beside is None else str(beside), "at": at}
    fill_figure(figure, run, Wanted(fields, what, **words))
    return figure


def find_interface(blocks: Sequence[Any], t: float, where: str) -> Curve:
    """The lines between blocks of different materials; BadInput where there are none."""
    lines, _ = split_outline(blocks)
    if not lines:
        raise BadInput(f"{where}: no two materials touch, so there is no interface")
    pieces = _chain(lines)
    gap = np.full((2, 1), np.nan)
    parts = [part for piece in pieces for part in (gap, piece)][1:]
    x, y = np.concatenate(parts, axis=1)
    return Curve(x, y, t)


def _chain(lines: list[np.ndarray]) -> list[np.ndarray]:
    """Lines of which one ends where the next begins, put together; (2, n) each."""
    pieces: list[np.ndarray] = []
    for line in lines:
        if pieces and np.array_equal(pieces[-1][:, -1], line[:, 0]):
            pieces[-1] = np.concatenate([pieces[-1], line[:, 1:]], axis=1)
        else:
            pieces.append(line)
    return pieces


def _say_times(at: Times) -> str | None:
    if at is None or isinstance(at, str):
        return at
    return ",".join(repr(float(t)) for t in np.atleast_1d(np.asarray(at, float)))


def say_numbers(numbers: Sequence[float] | None) -> str | None:
    return None if numbers is None else ",".join(repr(float(value)) for value in numbers)
