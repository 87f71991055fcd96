"""All kinds of segment by name, one line each, and how one is put on a block's side.

A new boundary kind is one class in a file of this folder and one line in SEGMENTS.
"""

from __future__ import annotations

import inspect
from collections import ChainMap

from hydro.block import Block
from hydro.boundary.kinds import (
    Axis,
    FreeSurface,
    Inflow,
    Interface,
    Outflow,
    Periodic,
    Piston,
    Seam,
    Sliding,
    Wall,
)
from hydro.boundary.segment import Segment
from regrid.errors import BadInput, suggest
from regrid.plug_ins import PlugIns

OWN: dict[str, type[Segment]] = {
    "wall": Wall,
    "axis": Axis,
    "piston": Piston,
    "free-surface": FreeSurface,
    "outflow": Outflow,
    "inflow": Inflow,
    "interface": Interface,
    "sliding": Sliding,
    "seam": Seam,
    "periodic": Periodic,
}
SEGMENTS: ChainMap[str, type[Segment]] = ChainMap(OWN, PlugIns("shockgrid.boundaries"))  # type: ignore


def make_segment(
    kind: str, block: Block, side: str, start: int, stop: int, options: dict
) -> Segment:
    """A segment of a registered kind; raises BadInput for an unknown kind or option."""
    if not isinstance(kind, str) or kind not in SEGMENTS:
        raise BadInput(f"there is no segment kind {kind!r}{suggest(kind, SEGMENTS)}")
    place = f"block {block.name!r}, side {side}: {kind} segment"
    _check_options(place, SEGMENTS[kind], options)
    try:
        return SEGMENTS[kind](block, side, start, stop, **options)
    except (TypeError, ValueError) as error:
        raise BadInput(f"{place}: {error}") from error


def _check_options(place: str, make: type[Segment], options: dict) -> None:
    """Raise BadInput for options that a kind does not have, and for those that it lacks."""
    given = list(inspect.signature(make).parameters.values())[4:]  # block, side, start, stop
    if any(one.kind is one.VAR_KEYWORD for one in given):
        return
    known = [one.name for one in given]
    for name in options:
        if name not in known:
            raise BadInput(
                f"{place}: there is no option {name!r}{suggest(name, known)}"
                if known
                else f"{place}: {name!r} is given, and it has no options"
            )
    missing = [one.name for one in given if one.default is one.empty and one.name not in options]
    if missing:
        words = ", ".join(f"{name}=..." for name in missing)
        about = (make.__doc__ or "").strip().partition("\n")[0]
        raise BadInput(f"{place}: {words} is missing ({about})")


def put(
    block: Block, side: str, kind: str, start: int = 0, stop: int | None = None, **options
) -> Segment:
    """Put a segment of a kind on the faces start..stop - 1 of a block's side; returns it.

    options: those of the kind's class.  Raises BadInput for an unknown side, kind or option, and
    for faces that the side does not have.
    """
    count = block.side_faces(side)[1]
    segment = make_segment(kind, block, side, start, count if stop is None else stop, options)
    block.segments.append(segment)
    return segment
