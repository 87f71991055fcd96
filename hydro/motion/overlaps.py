"""Detection of overlapping blocks, in the initial grid and, for moving lines, before every step.

Blocks meet along links and sliding contacts, and free surfaces of different bodies are handled by
`hydro.contacts`.  Blocks that run into each other otherwise would not interact, so the run has to
stop.

The check covers the segments that form the outline of linked blocks: those without a partner, and
the leaders of sliding contacts, whose ends may be uncovered.  If two blocks overlap, their outlines
cross, or one block lies within the other, which is possible only in the initial grid.  Blocks may
touch, and chords may cut curves, so a crossing counts if one outline has entered the other block by
the fraction OVERLAP_DEPTH_PART of its first cells.  Self-intersection of a block is detected by its
regridder.

Note: linked blocks are checked in the initial grid only.  Where their contact ends, both outlines
start from one node and may close on each other: a jet that bends round the end of a wedge presses
on it there, which no link describes.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Sequence

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import NodeMotion, Piston, Segment
from shockgrid.hydro.links import Link
from shockgrid.hydro.perimeter.contacts import PISTON
from shockgrid.hydro.sliding.contact import SlidingContact
from shockgrid.regrid.errors import BadInput, Place, RunFailure
from shockgrid.regrid.jit import kernel
from shockgrid.regrid.measure.crossings import GROUP_EDGES, fill_boxes, find_touching
from shockgrid.regrid.sides import SIDE_NAMES, find_node, trace_outline

CHECKED_TIMES = 101  # at which pistons are checked beforehand
OVERLAP_DEPTH_PART = 0.25  # fraction of the cells along a side: further in, blocks overlap
MOST_GROUPS = 64  # boxes of a line
ADVICE = (
    "blocks may touch, not overlap; link sides that stay together, and cut curves that touch the "
    "same way, or finer"
)


@kernel
def fill_outline(nodes, side, start, line, inset):
    """Fill `line` (2, n) with a side's nodes from `start` on, and `inset` (2, n), further inwards.

    The inset lies OVERLAP_DEPTH_PART of a cell inwards, and ends as much of a face before the line.
    Returns the least and the largest x, then y, of the line.
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    last = line.shape[1] - 1
    for c in range(2):
        for k in range(last + 1):
            i, j = find_node(side, start + k, 0, ni, nj)
            i_next, j_next = find_node(side, start + k, 1, ni, nj)
            here = nodes[c, i, j]
            there = nodes[c, i_next, j_next]
            line[c, k] = here
            inset[c, k] = here + OVERLAP_DEPTH_PART * (there - here)
        first_step = inset[c, 1] - inset[c, 0]
        last_step = inset[c, last - 1] - inset[c, last]
        inset[c, 0] += OVERLAP_DEPTH_PART * first_step
        inset[c, last] += OVERLAP_DEPTH_PART * last_step
    x, y = line[0], line[1]
    return x.min(), x.max(), y.min(), y.max()


class Outline:
    """A segment that other blocks may run into: its line, and its line shifted slightly inward."""

    def __init__(self, segment: Segment, group: int):
        self.segment = segment
        self.group = group
        nodes = segment.stop - segment.start + 1
        self.line = np.empty((2, nodes))
        self.inset = np.empty((2, nodes))
        boxes = 4, -(-(nodes - 1) // group)
        self.boxes = np.empty(boxes)
        self.inset_boxes = np.empty(boxes)
        self.follow()

    def follow(self) -> None:
        """Update from the current nodes."""
        segment = self.segment
        side = SIDE_NAMES.index(segment.side)
        self.bounds = fill_outline(segment.block.nodes, side, segment.start, self.line, self.inset)
        self.is_boxed = False

    def fill_boxes(self) -> None:
        """Fill the bounding boxes of groups of faces, for the proximity test."""
        if not self.is_boxed:
            fill_boxes(self.line, self.group, self.boxes)
            fill_boxes(self.inset, self.group, self.inset_boxes)
            self.is_boxed = True

    def find_crossing(self, other_outline: Outline) -> tuple[int, int] | None:
        """Indices of the faces of both at which one is inside the other's block, or None."""
        self.fill_boxes()
        other_outline.fill_boxes()
        for line, inset, boxes, inset_boxes in (
            (self.line, other_outline.inset, self.boxes, other_outline.inset_boxes),
            (self.inset, other_outline.line, self.inset_boxes, other_outline.boxes),
        ):
            a, b = find_touching(line, inset, False, self.group, boxes, inset_boxes)
            if a >= 0:
                return int(a), int(b)
        return None


Pairs = list[tuple[int, int]]  # of indices in a list of outlines or segments


def search(
    outlines: Sequence[Outline], pairs: Pairs
) -> tuple[Outline, Outline, tuple[int, int]] | None:
    """The first pair that crosses, with the faces, or None."""
    if not pairs:
        return None
    bounds = np.array([outline.bounds for outline in outlines])
    first_numbers, second_numbers = np.array(pairs).T
    low = np.maximum(bounds[first_numbers, ::2], bounds[second_numbers, ::2])
    high = np.minimum(bounds[first_numbers, 1::2], bounds[second_numbers, 1::2])
    for number in np.flatnonzero((low <= high).all(axis=1)):
        outline, other_outline = (outlines[k] for k in pairs[number])
        at = outline.find_crossing(other_outline)
        if at is not None:
            return outline, other_outline, at
    return None


class Overlaps:
    """Pairs of segments that may come to overlap, and the search among them."""

    def __init__(self, blocks: Sequence[Block], links: Sequence[Link | SlidingContact]):
        self.blocks = blocks
        self._linked = [{id(s.block) for s in link.segments} for link in links]
        self._contacts = [
            ({id(s) for s in link.segments}, {id(s.block) for s in link.segments})
            for link in links
            if isinstance(link, SlidingContact)
        ]
        self.segments = [
            segment
            for block in blocks
            for segment in block.segments
            if isinstance(segment, Segment)
            and (not segment.linked or (segment.is_sliding and not segment.is_follower))
        ]
        self._outlines: list[Outline] = []  # of the segments that are watched
        self._watched: Pairs = []

    def check_start(self) -> None:
        """Raise BadInput if blocks of the initial grid overlap."""
        overlap = search(self._make_outlines(self.segments), self._pair(self.segments))
        if overlap is not None:
            outline, other_outline, at = overlap
            depth = describe_depth(outline.segment.block, other_outline.segment.block)
            raise BadInput(f"{self._describe(outline, other_outline, at)}{depth}: {ADVICE}")
        for pair in itertools.combinations(self.blocks, 2):
            for block, other_outline in (pair, pair[::-1]):
                i, j = block.ni // 2, block.nj // 2
                x, y = block.nodes[:, i : i + 2, j : j + 2].mean(axis=(1, 2))
                if is_inside((x, y), other_outline.nodes):
                    raise BadInput(
                        f"blocks {pair[0].name!r} and {pair[1].name!r} lie on each other at "
                        f"x = {x:.6g} m, y = {y:.6g} m{describe_depth(*pair)}: {ADVICE}"
                    )

    def check_pistons(self, t_end: float) -> None:
        """Raise BadInput if a piston will enter a block bounded by walls only before `t_end`."""
        # ways of all pistons
        times = np.linspace(0.0, t_end, CHECKED_TIMES)
        paths = {
            id(segment): integrate_motion(segment, times)
            for segment in self.segments
            if segment.wall == PISTON
        }
        for block in self.blocks if paths else ():
            # blocks with walls only that keep their shape
            own_segments = [segment for segment in self.segments if segment.block is block]
            if not own_segments or not all(s.is_rigid and s.meets_bodies for s in own_segments):
                continue
            moved = [
                paths.get(id(segment), np.zeros((2, CHECKED_TIMES))) for segment in own_segments
            ]
            if not all(np.array_equal(path, moved[0]) for path in moved):
                continue  # it changes its shape: detected when it happens
            # pistons of other blocks, relative to this one
            for segment in self.segments:
                linked = any({id(block), id(segment.block)} <= pair for pair in self._linked)
                if segment.block is block or linked or id(segment) not in paths:
                    continue
                line = segment.line(segment.block.nodes)
                middles = 0.5 * (line[:, 1:] + line[:, :-1])
                for t, x, y in zip(times, *(paths[id(segment)] - moved[0]), strict=True):
                    points = middles + np.array([[x], [y]])
                    if any(is_inside((px, py), block.nodes) for px, py in points.T):
                        raise BadInput(
                            f"{segment} comes into block {block.name!r} by t = {t:.3g} s: walls "
                            f"cannot meet, and {block.name!r} has no free surface; give it one, "
                            "link the sides that meet, or end the run before"
                        )

    def watch(self, all_segments: bool = False) -> None:
        """From now on check unlinked pairs of which one moves independently, or all pairs."""
        pairs = [
            (a, b)
            for a, b in self._pair(self.segments)
            if all_segments or _leaves(self.segments[a]) or _leaves(self.segments[b])
        ]
        blocks = [id(segment.block) for segment in self.segments]
        pairs = [
            (a, b)
            for a, b in pairs
            if not any({blocks[a], blocks[b]} <= linked for linked in self._linked)
        ]
        used = sorted({number for pair in pairs for number in pair})
        self._outlines = self._make_outlines([self.segments[number] for number in used])
        self._watched = [(used.index(a), used.index(b)) for a, b in pairs]

    def check(self, t: float, step: int, touching: Collection[frozenset[int]] = ()) -> None:
        """Raise RunFailure if blocks overlap now, except those (by id) in `touching`."""
        for outline in self._outlines:
            outline.follow()
        watched = self._watched
        if touching:
            blocks = [id(outline.segment.block) for outline in self._outlines]
            watched = [
                (a, b) for a, b in watched if frozenset((blocks[a], blocks[b])) not in touching
            ]
        overlap = search(self._outlines, watched)
        if overlap is not None:
            outline, other_outline, at = overlap
            segment = outline.segment
            raise RunFailure(
                f"{self._describe(outline, other_outline, at)}, t = {t:.6g} s (step {step}): "
                "no link is between these sides, and blocks without one pass through each other",
                cause="blocks-overlap",
                place=Place(segment.block.name, side=segment.side, nodes=(segment.start + at[0],)),
            )

    @staticmethod
    def _make_outlines(segments: Sequence[Segment]) -> list[Outline]:
        longest = max((segment.stop - segment.start for segment in segments), default=0)
        group = max(GROUP_EDGES, -(-longest // MOST_GROUPS))
        return [Outline(segment, group) for segment in segments]

    def _pair(self, segments: Sequence[Segment]) -> Pairs:
        """All pairs except those within a block and those of a sliding contact."""
        return [
            (a, b)
            for (a, segment), (b, other_segment) in itertools.combinations(enumerate(segments), 2)
            if segment.block is not other_segment.block
            and not any(
                {id(segment), id(other_segment)} & members
                and {id(segment.block), id(other_segment.block)} <= blocks
                for members, blocks in self._contacts
            )
        ]

    @staticmethod
    def _describe(outline: Outline, other_outline: Outline, places: tuple[int, int]) -> str:
        a = outline.segment
        b = other_outline.segment
        x, y = 0.5 * (outline.line[:, places[0]] + outline.line[:, places[0] + 1])
        return (
            f"block {a.block.name!r}, side {a.side}, and block {b.block.name!r}, side {b.side}, "
            f"lie on each other at x = {x:.6g} m, y = {y:.6g} m"
        )


def _leaves(segment: Segment) -> bool:
    """Whether the segment may leave its initial line."""
    return segment.moves or segment.motion is NodeMotion.JOIN


def integrate_motion(piston: Piston, times: np.ndarray) -> np.ndarray:
    """Displacement (2, n) of a piston since t = 0."""
    speeds = np.array([piston.velocity(float(t)) for t in times]).T
    steps = 0.5 * (speeds[:, 1:] + speeds[:, :-1]) * np.diff(times)
    return np.concatenate([np.zeros((2, 1)), np.cumsum(steps, axis=1)], axis=1)


def describe_depth(block: Block, other_block: Block) -> str:
    """Describe which block reaches how far into the other, from the nodes along their sides."""
    deepest = 0.0, ""
    for inner, outer in ((block, other_block), (other_block, block)):
        # segments of the outer block's outline, but for those of no length
        outline = trace_outline(outer.nodes)
        steps = np.roll(outline, -1, axis=1) - outline
        square = (steps * steps).sum(axis=0)
        start = outline[:, square > 0.0]
        steps = steps[:, square > 0.0]
        square = square[square > 0.0]
        # the farthest of the inner one's nodes and middles of edges that lie inside
        nodes = trace_outline(inner.nodes)
        middles = 0.5 * (nodes + np.roll(nodes, -1, axis=1))
        for x, y in np.concatenate([nodes, middles], axis=1).T:
            if is_inside((x, y), outer.nodes):
                away = np.array([[x], [y]]) - start
                fraction = np.clip((away * steps).sum(axis=0) / square, 0.0, 1.0)
                depth = float(np.hypot(*(away - fraction * steps)).min())
                place = f"; block {inner.name!r} is up to {depth:.3g} m inside block {outer.name!r}"
                deepest = max(deepest, (depth, place))
    return deepest[1]


def is_inside(point: tuple[float, float], nodes: np.ndarray) -> bool:
    """Whether a point is inside the outline of `nodes` (2, ni+1, nj+1), by the even-odd rule."""
    x, y = trace_outline(nodes) - np.reshape(point, (2, 1))
    if x.min() > 0.0 or x.max() < 0.0 or y.min() > 0.0 or y.max() < 0.0:
        return False
    rises = y > 0.0
    following = np.roll(y > 0.0, -1)
    at = np.flatnonzero(rises != following)
    x_next, y_next = np.roll(x, -1)[at], np.roll(y, -1)[at]
    crossing = x[at] - y[at] * (x_next - x[at]) / (y_next - y[at])
    return bool((crossing > 0.0).sum() % 2)
