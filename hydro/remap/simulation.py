"""A flow taken up by another simulation of the same set-up with other numbers of cells.

The new simulation comes fresh from its problem.  Its lines are laid on the curves of the old run's,
its grids made inside them by its own regridders, and the states laid on these, block by block.
What is not refused holds for as long as blocks, sides and links are the same; slaves of sliding
contacts have polygons for cells along their side, which do not fit any other grid.

A side's nodes are spread anew along the chords between the old ones.  A new node has, between the
old nodes around it, the place that its value of the spacing has between theirs: where the old line
follows its spacing the new one does, and a line refined without a change of the spacing keeps the
old nodes.  The chords are what the block's volume was made of: a smooth curve through the same
nodes would enclose another one, and the flow would feel it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import map_coordinates

from hydro.block import Block
from hydro.boundary.segment import NodeMotion
from hydro.motion.grid_motion import GridMotion, MeshLaw
from hydro.motion.line import Line
from hydro.remap.conserved import Slivers, remap_state
from hydro.rim import SIDES
from hydro.simulation import Simulation
from regrid.curves import compute_arc_lengths
from regrid.errors import BadInput
from regrid.protocol import call_regridder


def spread_anew(line: np.ndarray, law: np.ndarray, new_law: np.ndarray) -> np.ndarray:
    """Nodes (2, m) on the polyline `line` (2, n) [m], the ends the same.

    law (n,), new_law (m,): spacing laws of both, from 0 to 1, increasing.
    """
    arc = compute_arc_lengths(line)
    positions = PchipInterpolator(law, arc)(new_law) if line.shape[1] > 2 else new_law * arc[-1]
    nodes = np.array([np.interp(positions, arc, row) for row in line])
    nodes[:, 0], nodes[:, -1] = line[:, 0], line[:, -1]
    return nodes


def find_fractional_indices(line: np.ndarray, old_line: np.ndarray) -> np.ndarray:
    """Where the nodes (2, m) of a line lie among those (2, n) of an old one: 0 to n - 1."""
    arc, old_arc = compute_arc_lengths(line), compute_arc_lengths(old_line)
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
    first = along_i[0][:, None] * (1.0 - part_j) + along_i[1][:, None] * part_j
    second = along_j[0][None, :] * (1.0 - part_i) + along_j[1][None, :] * part_i
    return np.array([first, second])


PASSES = 3  # of the regridder over a new grid, as each brings it a step nearer to its own
SAME = 1e-9  # of a grid's size: nodes that depend on time alone


@dataclass(frozen=True)
class RemappedBlock:
    """A block laid on other cells: numbers of cells before and now, and what did not fit."""

    name: str
    before: tuple[int, int]
    now: tuple[int, int]
    slivers: Slivers


def take_over(old: Simulation, new: Simulation) -> list[RemappedBlock]:
    """Give `new`, at its first step, the time, the ledger and the remapped state of `old`.

    Masses, momentum and energy of every block stay the same to round-off.  Raises BadInput where
    the two are not of one set-up, where blocks slide on each other and where the outlines differ;
    RegridFailure where no grid is found in the sides; RunFailure where an average is no state.
    """
    _check_same(old, new)
    if new.motion.mesh == "regrid":
        _lay_sides(old, new)
        for one, other, number in zip(old.blocks, new.blocks, range(len(old.blocks)), strict=True):
            _make_grid(one, other, new, number)
    elif callable(old.motion.mesh) and callable(new.motion.mesh):
        _follow_law(old.blocks, new.blocks, old.motion.mesh, new.motion.mesh, old.t)
    state = dict(new.get_state())
    report = []
    for one, other in zip(old.blocks, new.blocks, strict=True):
        found, void_energy, slivers = remap_state(
            one.name, one.eos, one.geometry.curved, one.nodes, one.state[:, 1:-1, 1:-1],
            one.void_energy, other.nodes,
        )  # fmt: skip
        state[f"{one.name}/nodes"] = other.nodes.copy()
        state[f"{one.name}/state"], state[f"{one.name}/void_energy"] = found, void_energy
        report.append(RemappedBlock(one.name, (one.ni, one.nj), (other.ni, other.nj), slivers))
    new.set_state(
        state
        | {
            "t": old.t,
            "step": old.step,
            "dt": old.dt,
            "stretch_rate": old.clock.stretch_rate,
            **old.ledger.get_state(),
        }
    )
    for block in new.blocks:
        if block.start is not block.state:
            block.start[...] = block.state
        block.update(0.0)  # rates and totals of this state
        block.rates[...] = block.rates_new
    new.clock.rate = new.small_cells.find_first_rate()
    return report


def _check_same(old: Simulation, new: Simulation) -> None:
    """Raise BadInput where the two simulations are not of one set-up, or where something slides."""
    if old.exchange.contacts or new.exchange.contacts:
        segment = (old.exchange.contacts or new.exchange.contacts)[0].slave.segments[0]
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
    pairs = list(zip(old.motion.lines, new.motion.lines, strict=True))
    for before, node in zip(old.motion.key_nodes, new.motion.key_nodes, strict=True):
        for (block, i, j), (other, k, m) in zip(before.members, node.members, strict=True):
            other.nodes_new[:, k, m] = block.nodes[:, i, j]
        if node.tracks and not node.given:
            track = node.tracks[0][0]
            block, i, j = node.members[0]
            here = block.nodes_new[:, i, j]
            node.shift(track.at(track.locate(here)) - here)
    for before, line in pairs:
        _lay_line(before, line)
    for link in new.exchange.links:
        link.swap_line()


def _lay_line(before: Line, line: Line) -> None:
    """The inner nodes of a line between its new ends."""
    target = line.segment.line(line.segment.block.nodes_new)
    if line.segment.motion is NodeMotion.SLIDE:
        if line.track.straight:
            first, last = target[:, :1].copy(), target[:, -1:].copy()
            target[:, 1:-1] = (first + (last - first) * line.law)[:, 1:-1]
        else:
            target[:, 1:-1] = line.track.spread(target[:, 0], target[:, -1], line.law)[:, 1:-1]
        return
    curve = before.segment.line(before.segment.block.nodes)
    spread = spread_anew(curve, before.law, line.law)
    miss = target[:, [0, -1]] - spread[:, [0, -1]]  # ends that went on to a finer track
    spread += miss[:, :1] * (1.0 - line.law) + miss[:, 1:] * line.law
    target[:, 1:-1] = spread[:, 1:-1]


def _make_grid(before: Block, block: Block, new: Simulation, number: int) -> None:
    """The block's grid inside its new sides: the old one sampled, then its regridder over it."""
    sides = {side: block.side_line(side, block.nodes_new).copy() for side in SIDES}
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
    passes: int = PASSES,
) -> np.ndarray:
    """The grid of a block inside the sides of `boundary`, by its own regridder from `nodes`.

    cells (2, ni, nj): whose flow of the block `before` the new cells see.  Raises RegridFailure.
    """
    regridder: Any = motion.regridders[number]
    aware = motion.flow_aware[number]
    if aware is not None and aware.sees_flow:
        fields = before.compute_fields(before.state).items()
        aware.take_step({name: np.ascontiguousarray(f[tuple(cells)]) for name, f in fields}, 1.0)
    more: tuple[np.ndarray, ...] = ()
    if motion.cost_aware[number]:
        more = (np.ascontiguousarray(before.compute_sound_speed(before.state)[tuple(cells)]),)
    boundary = np.ascontiguousarray(boundary)
    for _ in range(passes):
        nodes = call_regridder(regridder, np.ascontiguousarray(nodes), boundary, *more).nodes
    return nodes


def _follow_law(
    blocks: list[Block], new_blocks: list[Block], law: MeshLaw, new_law: MeshLaw, t: float
) -> None:
    """Grids of a prescribed motion at the old time; one that depends on the flow is sampled."""
    for one, other in zip(blocks, new_blocks, strict=True):
        size = np.ptp(one.nodes, axis=(1, 2)).max()
        if np.abs(law(one.name, t) - one.nodes).max() <= SAME * size:
            other.nodes[...] = new_law(other.name, t)
            continue
        sides = {}
        for side in SIDES:
            first = other.side_line(side, other.nodes)
            before = one.side_line(side, one.nodes)
            even = np.linspace(0.0, 1.0, before.shape[1])
            sides[side] = spread_anew(before, even, np.linspace(0.0, 1.0, first.shape[1]))
        places = sample_grid(one.nodes, sides)
        other.nodes[...] = [map_coordinates(row, places, order=1) for row in one.nodes]
