"""Grid lines added and taken away while a flow goes on: where nodes of its contacts no longer do.

All blocks have the same lines j = const, which run through their interfaces from block to block.
Where a segment of an interface has grown long, or the line turns sharply beside it, the column of
cells on both sides is split; where a line has become straight and its segments short, one goes
(theory F12.6).  What is chosen depends on the nodes and the step alone, and simulation and blocks
are made anew by the problem's own rules, with first grids that are the first ones sampled: a
restart, which knows nothing but the nodes, comes to the same.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from hydro.block import Block
from hydro.motion.grid_motion import GridMotion
from hydro.motion.line import Line, StraightLine
from hydro.remap.conserved import remap_state
from hydro.remap.simulation import settle_grid
from regrid.errors import BadInput
from regrid.measure.quality import measure_turns

EVERY = 50  # steps from one look at the lines to the next
LONGEST = 3.0  # edges of the first ones' mean from which on a column is split
SHARPEST = np.radians(15.0)  # turn at a node from which on the columns beside it are split
LEAST_SPLIT = 0.3  # of the first edges' mean: shorter ones are not split for a turn's sake
CALM = 0.5  # part of both limits below which all edges and turns are before a line goes
LONGEST_MERGED = 1.0  # edge of two merged columns, of the first mean
SHARE = 0.125  # part of all columns that are split or merged at once
MOST = 8  # times the first count of columns
PASSES = 10  # of the regridders, so that grids settle before they move again
TIE = 1e-6  # mirror images are chosen together

Nodes = list[np.ndarray]
# nodes and states (4, ni, nj) of all blocks -> blocks, links, what makes their regridders
Rebuild = Callable[[Nodes, Nodes], tuple[list[Block], list, Callable[[], object] | None]]


class Refinement:
    """The rule of one simulation; `first`: its first nodes, `rebuild`: what makes its blocks."""

    def __init__(self, blocks: Sequence[Block], rebuild: Rebuild):
        self.rebuild = rebuild
        self.first = {block.name: block.nodes.copy() for block in blocks}
        if len({block.nj for block in blocks}) > 1:
            raise BadInput("lines can be added where all blocks have as many cells along j alone")
        self.first_count = blocks[0].nj

    def make_first_nodes(self, count: int) -> Nodes:
        """The first grids with `count` columns: the first lines, sampled evenly in j."""
        if count == self.first_count:
            return [nodes.copy() for nodes in self.first.values()]
        places = np.arange(count + 1) * (self.first_count / count)
        return [sample_lines(nodes, places) for nodes in self.first.values()]

    def choose(self, step: int, lines: Sequence[Line]) -> np.ndarray | None:
        """After a step, where in numbers of the present columns the new lines lie; None: stay."""
        if step % EVERY:
            return None
        lines = [line for line in lines if line.segment.kind == "interface"]
        count = lines[0].segment.block.nj
        split, kept = np.zeros(count), np.zeros(count - 1)
        for line in lines:
            edges, turns = measure_line(line)
            first = line.segment.line(self.first[line.segment.block.name])
            edges = edges / (np.hypot(*np.diff(first, axis=1)).sum() / self.first_count)
            sharp = np.where(edges > LEAST_SPLIT, np.maximum(turns[:-1], turns[1:]), 0.0)
            split = np.maximum(split, np.maximum(edges / LONGEST, sharp / SHARPEST))
            around = turns[:-2] + turns[1:-1] + turns[2:]
            long = (edges[:-1] + edges[1:]) / LONGEST_MERGED
            kept = np.maximum(kept, np.maximum(long, around / (CALM * SHARPEST)))
        most = max(1, int(SHARE * count))
        columns = pick_largest(split, min(most, MOST * self.first_count - count))
        if columns.size:
            return np.sort(np.append(np.arange(count + 1), columns + 0.5))
        if count == self.first_count or split.max() > CALM:
            return None
        beside = np.minimum(np.append(kept[1:], np.inf), np.insert(kept[:-1], 0, np.inf))
        kept = np.where(kept < beside * (1.0 - TIE), kept, np.inf)  # no two neighbours go at once
        ease = 1.0 / np.maximum(kept, TIE)
        removed = 1 + pick_largest(ease, min(most, count - self.first_count))
        fits = 0 < removed.size <= count - self.first_count
        return np.delete(np.arange(count + 1.0), removed) if fits else None

    def lay(
        self, places: np.ndarray, blocks: Sequence[Block], motion: GridMotion
    ) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Nodes, states and void energies of all blocks on lines at these places.

        The nodes of interfaces stay, or lie half way between two of them; straight sides are spread
        by their laws, and the grids inside settle before they get the states.  `motion`: of the new
        blocks.  Raises RunFailure, and nothing has changed.
        """
        for one, other in zip(blocks, motion.blocks, strict=True):
            other.nodes_new[...] = sample_lines(one.nodes, places)
        for line in motion.lines:
            if isinstance(line, StraightLine) and line.track.straight:
                line.spread_straight()
        found = []
        parents = places[:-1].astype(int)
        for number, (one, other) in enumerate(zip(blocks, motion.blocks, strict=True)):
            cells = np.array(np.meshgrid(np.arange(one.ni), parents, indexing="ij"))
            first, sides = sample_lines(one.nodes, places), other.nodes_new
            nodes = settle_grid(motion, number, one, cells, first, sides, PASSES).copy()
            held = one.nodes, one.state[:, 1:-1, 1:-1], one.void_energy
            state, void_energy, _ = remap_state(
                one.name, one.eos, one.geometry.curved, *held, nodes
            )
            found.append((nodes, state, void_energy))
        return found


def sample_lines(nodes: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Lines j = const (2, ni+1, n) at places in numbers of columns, between those of `nodes`."""
    before = np.minimum(places.astype(int), nodes.shape[2] - 2)
    part = places - before
    return nodes[:, :, before] * (1.0 - part) + nodes[:, :, before + 1] * part


def measure_line(line: Line) -> tuple[np.ndarray, np.ndarray]:
    """Edges (n,) [m] of a line and turns (n + 1,) at all its nodes [rad], those of ends between
    it and its image."""
    nodes = line.segment.line(line.segment.block.nodes)
    images = []
    for end, (here, inside) in enumerate(((0, 1), (-1, -2))):
        if line.period is not None:
            images.append(nodes[:, -2] - line.period if end == 0 else nodes[:, 1] + line.period)
            continue
        away, normal = nodes[:, inside] - nodes[:, here], np.asarray(line.walls[end], dtype=float)
        image = away - 2.0 * normal * (normal @ away) if normal.any() else -away
        images.append(nodes[:, here] + image)
    longer = np.concatenate([images[0][:, None], nodes, images[1][:, None]], axis=1)
    return np.hypot(*np.diff(nodes, axis=1)), np.abs(measure_turns(longer))


def pick_largest(scores: np.ndarray, most: int) -> np.ndarray:
    """Indices of the `most` largest scores above 1, and of those that equal the least of them."""
    above = np.flatnonzero(scores > 1.0)
    if most < 1 or above.size <= most:
        return above if most >= 1 else above[:0]
    least = np.sort(scores[above])[-most]
    return above[scores[above] >= least * (1.0 - TIE)]
