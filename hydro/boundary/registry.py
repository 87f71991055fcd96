"""All kinds of segment by name, one line each, and how one is put on a block's side.

A new boundary kind is one class in a file of this folder and one line in SEGMENTS.
"""

from __future__ import annotations

from collections import ChainMap

from hydro.block import Block
from hydro.boundary.free_surface import FreeSurface
from hydro.boundary.linked import Interface, Periodic, Seam, Sliding
from hydro.boundary.open_sides import Inflow, Outflow
from hydro.boundary.segment import Segment
from hydro.boundary.walls import Axis, Piston, Wall
from regrid.errors import BadInput, find_nearest
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
    if kind not in SEGMENTS:
        nearest = find_nearest(kind, SEGMENTS, cutoff=0.0)
        raise BadInput(f"there is no segment kind {kind!r}; did you mean {nearest!r}?")
    try:
        return SEGMENTS[kind](block, side, start, stop, **options)
    except TypeError as error:
        raise BadInput(f"block {block.name!r}, side {side}: {kind} segment: {error}") from None


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
