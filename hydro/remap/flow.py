"""A flow goes on with other numbers of cells: in another simulation, or refined on the way.

The new simulation comes fresh from its problem.  Its lines are laid on the curves of the old run's,
its grids made inside them by its own regridders, and the states laid on these, block by block.
What is not refused holds for as long as blocks, sides and links are the same; followers of sliding
contacts have polygons for cells along their side, which do not fit any other grid.

A side's nodes are respaced along the chords between the old ones.  A new node has, between the
old nodes around it, the place that its value of the spacing has between theirs: where the old line
follows its spacing the new one does, and a line refined without a change of the spacing keeps the
old nodes.  The chords are what the block's volume was made of: a smooth curve through the same
nodes would enclose another one, and the flow would feel it.

Refined on the way (`Refinement`) are blocks with the same lines j = const, which run through their
interfaces from block to block.  Where a segment of an interface has grown long, or the line turns
sharply beside it, the column of cells on both sides is split; where a line has become straight and
its segments short, one goes (theory F12.6).  What is chosen depends on the nodes and the step
alone, and simulation and blocks are rebuilt by the problem's own rules, with first grids that are
the first ones sampled: a restart, which knows nothing but the nodes, comes to the same.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import map_coordinates

from shockgrid.hydro import phases
from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import NodeMotion
from shockgrid.hydro.motion.grid_motion import GridMotion, MeshMotion
from shockgrid.hydro.motion.line import Line, StraightLine
from shockgrid.hydro.remap.conserved import Slivers, remap_state
from shockgrid.hydro.rows import HELD_ARRAYS
from shockgrid.hydro.simulation import Simulation
from shockgrid.regrid.curves import compute_arc_lengths
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.measure.quality import measure_turns
from shockgrid.regrid.protocol import call_regridder
from shockgrid.regrid.sides import SIDE_NAMES

NEW_GRID_PASSES = 3  # of the regridder over a new grid, as each brings it a step nearer to its own
SAME_GRID_DISTANCE = 1e-9  # of a grid's size: nodes that depend on time alone
STEPS_PER_LINE_CHECK = 50  # steps from one look at the lines to the next
LONGEST_COLUMN_EDGE = 3.0  # edges of the first ones' mean from which on a column is split
SHARPEST = np.radians(15.0)  # turn at a node from which on the columns beside it are split
LEAST_SPLIT = 0.3  # of the first edges' mean: shorter ones are not split for a turn's sake
CALM_LIMIT_PART = 0.5  # part of both limits below which all edges and turns are before a line goes
LONGEST_MERGED = 1.0  # edge of two merged columns, of the first mean
MOST_CHANGED_COLUMNS = 0.125  # part of all columns that are split or merged at once
MOST_COLUMN_GROWTH = 8  # times the first count of columns
SETTLING_PASSES = 10  # of the regridders, so that grids settle before they move again
MIRROR_TIE = 1e-6  # mirror images are chosen together


def respace_line(line: np.ndarray, spacing: np.ndarray, new_spacing: np.ndarray) -> np.ndarray:
    """Nodes (2, m) on the polyline `line` (2, n) [m], the ends the same.

    spacing (n,), new_spacing (m,): of both, from 0 to 1, increasing.
    """
    arc = compute_arc_lengths(line)
    positions = (
        PchipInterpolator(spacing, arc)(new_spacing) if line.shape[1] > 2 else new_spacing * arc[-1]
    )
    nodes = np.array([np.interp(positions, arc, row) for row in line])
    nodes[:, 0] = line[:, 0]
    nodes[:, -1] = line[:, -1]
    return nodes


def find_fractional_indices(line: np.ndarray, old_line: np.ndarray) -> np.ndarray:
    """Where the nodes (2, m) of a line lie among those (2, n) of an old one: 0 to n - 1."""
    arc = compute_arc_lengths(line)
    old_arc = compute_arc_lengths(old_line)
    return np.interp(arc / arc[-1], old_arc / old_arc[-1], np.arange(float(old_arc.size)))


def sample_grid(old: np.ndarray, sides: dict[str, np.ndarray]) -> np.ndarray:
    """Fractional indices (2, mi+1, mj+1) of a new grid's nodes in an old one (2, ni+1, nj+1).

    sides: the new grid's four lines by name, along which the indices are those of the arc length.
    """
    ends = (0, -1)
    names_i, names_j = ("j_min", "j_max"), ("i_min", "i_max")
    find = find_fractional_indices
    along_i = [find(sides[s], old[:, :, e]) for s, e in zip(names_i, ends, strict=True)]
    along_j = [find(sides[s], old[:, e, :]) for s, e in zip(names_j, ends, strict=True)]
    part_i = np.linspace(0.0, 1.0, along_i[0].size)[:, None]
    part_j = np.linspace(0.0, 1.0, along_j[0].size)[None, :]
    along_i_mixed = along_i[0][:, None] * (1.0 - part_j) + along_i[1][:, None] * part_j
    along_j_mixed = along_j[0][None, :] * (1.0 - part_i) + along_j[1][None, :] * part_i
    return np.array([along_i_mixed, along_j_mixed])


@dataclass(frozen=True)
class RemappedBlock:
    """A block laid on other cells: numbers of cells before and now, and what did not fit."""

    name: str
    before: tuple[int, int]
    now: tuple[int, int]
    slivers: Slivers


def _remap_block(block: Block, nodes: np.ndarray) -> tuple[dict[str, np.ndarray], Slivers]:
    """What the cells of a block hold on new nodes (2, mi+1, mj+1): see `remap_state`."""
    held = {name: block.get_inside(name) for name in block.held_arrays}
    new_held, slivers = remap_state(
        block.name, block.eos, block.geometry.curved, block.nodes, held, nodes
    )
    if block.stress is not None:
        cells = [new_held[name] for name in HELD_ARRAYS]
        block.stress.spall_again(block.eos, cells, new_held["carried"], nodes)
    return new_held, slivers


def take_over(old: Simulation, new: Simulation) -> list[RemappedBlock]:
    """Give `new`, at its first step, the time, the ledger and the remapped state of `old`.

    Masses, momentum and energy of every block stay the same to round-off.  Raises BadInput where
    the two are not of one set-up, where blocks slide on each other and where the outlines differ;
    RegridFailure where no grid is found in the sides; RunFailure where an average is no state.
    """
    _check_same(old, new)
    # the grid at this time
    if new.motion.mesh == "regrid":
        _lay_sides(old, new)
        for old_block, new_block, number in zip(
            old.blocks, new.blocks, range(len(old.blocks)), strict=True
        ):
            _make_grid(old_block, new_block, new, number)
    elif callable(old.motion.mesh) and callable(new.motion.mesh):
        _follow_mesh(old.blocks, new.blocks, old.motion.mesh, new.motion.mesh, old.t)
    # the state on it (theory F12)
    state = dict(new.get_state())
    report = []
    for old_block, new_block in zip(old.blocks, new.blocks, strict=True):
        held, slivers = _remap_block(old_block, new_block.nodes)
        state[f"{old_block.name}/nodes"] = new_block.nodes.copy()
        for name, array in held.items():
            state[f"{old_block.name}/{name}"] = array
        report.append(
            RemappedBlock(
                old_block.name, (old_block.ni, old_block.nj), (new_block.ni, new_block.nj), slivers
            )
        )
    # with the old time, totals and contacts
    new.set_state(
        state
        | {
            **old.clock.get_state(),
            **old.ledger.get_state(),
            **old.meetings.get_state_for(new.meetings),
        }
    )
    # rates and totals of the new cells
    for block in new.blocks:
        block.copy_start()
        phases.measure_rates(block)
    new.clock.retry_dt = np.inf  # it was for the old cells
    new.clock.rate = new.small_cells.find_first_rate(old.t)
    return report


def _check_same(old: Simulation, new: Simulation) -> None:
    """Raise BadInput where the two simulations are not of one set-up, or where something slides."""
    if old.exchange.contacts or new.exchange.contacts:
        segment = (old.exchange.contacts or new.exchange.contacts)[0].follower.segments[0]
        raise BadInput(
            f"{segment}: it slides on another block, and the cells of such a side are polygons "
            "that do not fit another grid; begin a new run with the cells wanted"
        )

    def describe(simulation):
        return [
            (block.name, [(s.side, s.kind) for s in block.segments]) for block in simulation.blocks
        ]

    if describe(old) != describe(new):
        raise BadInput(
            "with these cells the deck has other blocks or sides than the run; begin a new run"
        )


def _lay_sides(old: Simulation, new: Simulation) -> None:
    """Fill the sides of the new blocks' `nodes_new`: key nodes, lines between them, followers."""
    pairs = list(zip(old.motion.sides.lines, new.motion.sides.lines, strict=True))
    for before, node in zip(old.motion.sides.key_nodes, new.motion.sides.key_nodes, strict=True):
        for (block, i, j), (other, k, m) in zip(before.members, node.members, strict=True):
            other.nodes_new[:, k, m] = block.nodes[:, i, j]
        if node.tracks and not node.given:
            track = node.tracks[0][0]
            block, i, j = node.members[0]
            here = block.nodes_new[:, i, j]
            node.shift(track.at(track.locate(here)) - here)
    for before, line in pairs:
        _lay_line(before, line, old.t)
    for link in new.exchange.links:
        link.copy_line_to_follower()


def _lay_line(before: Line, line: Line, t: float) -> None:
    """The inner nodes of a line between its new ends, by the spacings at t [s]."""
    spacing = line.find_spacing(t)
    target = line.segment.line(line.segment.block.nodes_new)
    if line.segment.motion is NodeMotion.SLIDE:
        if line.track.straight:
            first = target[:, :1].copy()
            last = target[:, -1:].copy()
            target[:, 1:-1] = (first + (last - first) * spacing)[:, 1:-1]
        else:
            target[:, 1:-1] = line.track.spread(target[:, 0], target[:, -1], spacing)[:, 1:-1]
        return
    curve = before.segment.line(before.segment.block.nodes)
    spread = respace_line(curve, before.find_spacing(t), spacing)
    end_gaps = target[:, [0, -1]] - spread[:, [0, -1]]  # ends that went on to a finer track
    spread += end_gaps[:, :1] * (1.0 - spacing) + end_gaps[:, 1:] * spacing
    target[:, 1:-1] = spread[:, 1:-1]


def _make_grid(before: Block, block: Block, new: Simulation, number: int) -> None:
    """The block's grid inside its new sides: the old one sampled, then its regridder over it."""
    sides = {side: block.side_line(side, block.nodes_new).copy() for side in SIDE_NAMES}
    places = sample_grid(before.nodes, sides)
    nodes = np.array([map_coordinates(row, places, order=1) for row in before.nodes])
    for side, line in sides.items():
        block.side_line(side, nodes)[...] = line
    cells = np.minimum(
        0.25 * (places[:, :-1, :-1] + places[:, 1:, :-1] + places[:, :-1, 1:] + places[:, 1:, 1:]),
        np.array(before.rates.shape)[:, None, None] - 1.0,
    ).astype(int)  # fmt: skip
    block.nodes[...] = settle_grid(new.motion, number, before, cells, nodes, block.nodes_new)


def settle_grid(
    motion: GridMotion,
    number: int,
    before: Block,
    cells: np.ndarray,
    nodes: np.ndarray,
    boundary: np.ndarray,
    passes: int = NEW_GRID_PASSES,
) -> np.ndarray:
    """The grid of a block inside the sides of `boundary`, by its own regridder from `nodes`.

    cells (2, ni, nj): whose flow of the block `before` the new cells see.  Raises RegridFailure.
    """
    regridder: Any = motion.regridders[number]
    flow_aware = motion.flow_aware[number]
    if flow_aware is not None and flow_aware.sees_flow:
        fields = before.compute_fields(before.state).items()
        flow_aware.take_step(
            {name: np.ascontiguousarray(f[tuple(cells)]) for name, f in fields}, 1.0
        )
    sound_speeds: tuple[np.ndarray, ...] = ()
    if motion.cost_aware[number]:
        sound_speeds = (
            np.ascontiguousarray(before.compute_sound_speed(before.state)[tuple(cells)]),
        )
    boundary = np.ascontiguousarray(boundary)
    for _ in range(passes):
        nodes = call_regridder(
            regridder, np.ascontiguousarray(nodes), boundary, *sound_speeds
        ).nodes
    return nodes


def _follow_mesh(
    blocks: list[Block],
    new_blocks: list[Block],
    motion: MeshMotion,
    new_motion: MeshMotion,
    t: float,
) -> None:
    """Grids of a prescribed motion at the old time; one that depends on the flow is sampled."""
    for old_block, new_block in zip(blocks, new_blocks, strict=True):
        size = np.ptp(old_block.nodes, axis=(1, 2)).max()
        if np.abs(motion(old_block.name, t) - old_block.nodes).max() <= SAME_GRID_DISTANCE * size:
            new_block.nodes[...] = new_motion(new_block.name, t)
            continue
        sides = {}
        for side in SIDE_NAMES:
            first = new_block.side_line(side, new_block.nodes)
            before = old_block.side_line(side, old_block.nodes)
            even = np.linspace(0.0, 1.0, before.shape[1])
            sides[side] = respace_line(before, even, np.linspace(0.0, 1.0, first.shape[1]))
        places = sample_grid(old_block.nodes, sides)
        new_block.nodes[...] = [map_coordinates(row, places, order=1) for row in old_block.nodes]


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
        if step % STEPS_PER_LINE_CHECK:
            return None
        lines = [line for line in lines if line.segment.is_thick]
        count = lines[0].segment.block.nj
        # by column, over all lines: above 1 where it is too long or bends too sharply (F12.6)
        split_score = np.zeros(count)
        # by inner line between columns: above 1 where they are too long for one, or bent
        merge_score = np.zeros(count - 1)
        for line in lines:
            edges, turns = measure_line(line)
            first = line.segment.line(self.first[line.segment.block.name])
            edges = edges / (np.hypot(*np.diff(first, axis=1)).sum() / self.first_count)
            sharpness = np.where(edges > LEAST_SPLIT, np.maximum(turns[:-1], turns[1:]), 0.0)
            split_score = np.maximum(
                split_score, np.maximum(edges / LONGEST_COLUMN_EDGE, sharpness / SHARPEST)
            )
            summed_turns = turns[:-2] + turns[1:-1] + turns[2:]
            merged_length = (edges[:-1] + edges[1:]) / LONGEST_MERGED
            merge_score = np.maximum(
                merge_score, np.maximum(merged_length, summed_turns / (CALM_LIMIT_PART * SHARPEST))
            )
        # lines are added where they are wanted most, so many at once
        most_changes = max(1, int(MOST_CHANGED_COLUMNS * count))
        columns = pick_largest(
            split_score, min(most_changes, MOST_COLUMN_GROWTH * self.first_count - count)
        )
        if columns.size:
            return np.sort(np.append(np.arange(count + 1), columns + 0.5))
        if count == self.first_count or split_score.max() > CALM_LIMIT_PART:
            return None
        # otherwise lines go that are needed least, no two neighbours at once
        neighbour_score = np.minimum(
            np.append(merge_score[1:], np.inf), np.insert(merge_score[:-1], 0, np.inf)
        )
        merge_score = np.where(
            merge_score < neighbour_score * (1.0 - MIRROR_TIE), merge_score, np.inf
        )
        merge_ease = 1.0 / np.maximum(merge_score, MIRROR_TIE)
        removed = 1 + pick_largest(merge_ease, min(most_changes, count - self.first_count))
        fits = 0 < removed.size <= count - self.first_count
        return np.delete(np.arange(count + 1.0), removed) if fits else None

    def lay(
        self, places: np.ndarray, blocks: Sequence[Block], motion: GridMotion, t: float
    ) -> list[tuple[np.ndarray, dict[str, np.ndarray]]]:
        """Nodes, and what cells hold (`Block.held_arrays`), of all blocks on lines at these places.

        The nodes of interfaces stay, or lie half way between two of them; straight sides are spread
        by their spacings at t [s], and the grids inside settle before they get the states.
        `motion`: of the new blocks.  Raises RunFailure, and nothing has changed.
        """
        for old_block, new_block in zip(blocks, motion.blocks, strict=True):
            new_block.nodes_new[...] = sample_lines(old_block.nodes, places)
        for line in motion.sides.lines:
            if isinstance(line, StraightLine) and line.track.straight:
                line.spread_straight(t)
        laid_blocks = []
        old_columns = places[:-1].astype(int)
        for number, (old_block, new_block) in enumerate(zip(blocks, motion.blocks, strict=True)):
            cells = np.array(np.meshgrid(np.arange(old_block.ni), old_columns, indexing="ij"))
            first = sample_lines(old_block.nodes, places)
            sides = new_block.nodes_new
            nodes = settle_grid(
                motion, number, old_block, cells, first, sides, SETTLING_PASSES
            ).copy()
            held, _ = _remap_block(old_block, nodes)
            laid_blocks.append((nodes, held))
        return laid_blocks


def sample_lines(nodes: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Lines j = const (2, ni+1, n) at places in numbers of columns, between those of `nodes`."""
    before = np.minimum(places.astype(int), nodes.shape[2] - 2)
    fraction = places - before
    return nodes[:, :, before] * (1.0 - fraction) + nodes[:, :, before + 1] * fraction


def measure_line(line: Line) -> tuple[np.ndarray, np.ndarray]:
    """Edges (n,) [m] of a line and turns (n + 1,) at all its nodes [rad], those of ends between
    it and its image."""
    nodes = line.segment.line(line.segment.block.nodes)
    images = []
    for end, (here, inside) in enumerate(((0, 1), (-1, -2))):
        if line.period is not None:
            images.append(nodes[:, -2] - line.period if end == 0 else nodes[:, 1] + line.period)
            continue
        away = nodes[:, inside] - nodes[:, here]
        normal = np.asarray(line.walls[end], dtype=float)
        image = away - 2.0 * normal * (normal @ away) if normal.any() else -away
        images.append(nodes[:, here] + image)
    longer = np.concatenate([images[0][:, None], nodes, images[1][:, None]], axis=1)
    return np.hypot(*np.diff(nodes, axis=1)), np.abs(measure_turns(longer))


def pick_largest(scores: np.ndarray, count: int) -> np.ndarray:
    """Indices of the `count` largest scores above 1, and of those that equal the least of them."""
    above = np.flatnonzero(scores > 1.0)
    if count < 1 or above.size <= count:
        return above if count >= 1 else above[:0]
    smallest_picked = np.sort(scores[above])[-count]
    return above[scores[above] >= smallest_picked * (1.0 - MIRROR_TIE)]
