"""Motion of the grid in a step: its sides (`hydro.motion.sides`), then the interior of every block.

The interior is rebuilt by the regridder of the block, or the nodes follow a prescribed motion.
Only the new nodes are written, so a step can still be rejected.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.links import Exchange
from shockgrid.hydro.motion.line import LineRule
from shockgrid.hydro.motion.sides import Sides, StepTime
from shockgrid.hydro.ranks.blocks import Blocks
from shockgrid.hydro.sliding.polygons import LEAST_VOLUME_LEFT, make_find_crushed
from shockgrid.regrid.errors import BadInput, Place, RegridFailure, RunFailure
from shockgrid.regrid.measure.crossings import find_crossing
from shockgrid.regrid.measure.quality import find_bad_cells, measure_worst, say_not_convex
from shockgrid.regrid.node_speeds import MotionLimiter
from shockgrid.regrid.protocol import (
    RegridReport,
    call_regridder,
    check_regridder,
    find_flow_aware,
    sees_cost,
)

MOST_EXCESS = 0.3  # motion of a node not required by the boundary, in cell heights per full step

SPARING_HALVINGS = 5  # of that motion, where it would crush a polygon cell
LARGEST_LINK_GAP = (
    1e-12  # over a line's extent: linked lines that a motion moves farther apart fail
)

QUALITY_NUMBERS = 4  # of `measure_worst`
NO_COUNTS = (0, 0, 0, 0, 0, 0, math.inf)  # of a block that was not regridded

MeshMotion = Callable[[str, float], np.ndarray]


class GridMotion:
    """Moves the grids of blocks: "regrid" (default), "fixed" or a motion (block, t) -> nodes.

    sides: the lines and key nodes along the blocks' sides; there are none where a mesh is given.
    """

    def __init__(
        self,
        blocks: Blocks,
        exchange: Exchange,
        mesh: str | MeshMotion,
        make_regridder: Callable[[], object] | None,
        rule: LineRule,
    ):
        if not (mesh in ("regrid", "fixed") or callable(mesh)):
            raise BadInput(f"mesh is {mesh!r}; it must be 'regrid', 'fixed' or a function")
        self.mesh = mesh
        self.exchange = exchange
        self.regridders = _make_regridders(make_regridder, blocks) if mesh == "regrid" else []
        self.use_ranks(blocks)
        self.flow_aware = [find_flow_aware(regridder) for regridder in self.regridders]
        self.cost_aware = [sees_cost(regridder) for regridder in self.regridders]
        self.reports: list[RegridReport | None] = [None] * len(blocks)
        self.limiters = [MotionLimiter(block.nodes.shape) for block in blocks]
        self._limited = [0] * len(blocks)
        # of all blocks after a step: `measure_worst`, `_count`
        self.quality: list | None = None
        self.counts: list = [NO_COUNTS] * len(blocks)
        self.sides = Sides(blocks if mesh == "regrid" else (), exchange, rule)
        self._has_followers = mesh == "regrid" and any(block.is_follower for block in blocks)
        if mesh == "regrid":
            self._find_free_sides()
        else:
            _refuse_flow(blocks, mesh)

    def use_ranks(self, blocks: Blocks) -> None:
        """Regrid those of these blocks that are here alone, by their workers."""
        self.blocks = blocks
        for regridder in self.regridders:
            if hasattr(regridder, "threads"):
                regridder.threads = blocks.workers.inside

    def _find_free_sides(self) -> None:
        """Tell regridders that place sides' nodes which sides nobody else sees."""
        owners = [aware for aware in self.flow_aware if aware is not None and aware.owns_sides]
        if not owners:
            return
        for block, aware in zip(self.blocks, self.flow_aware, strict=True):
            if aware is not None:
                aware.free_sides = self.sides.find_free_sides(block)
        if not any(aware.free_sides for aware in owners):
            raise BadInput(
                "regridder: boundary 'equidistributed' needs a side that lies whole on a straight "
                "wall; here no side does, so take 'given'"
            )

    def follow_mesh(self, step: StepTime) -> None:
        """Fill all new nodes of a prescribed mesh; RegridFailure for a motion that tangles."""
        for block in (self.blocks[number] for number in self.blocks.own):
            if callable(self.mesh):
                block.nodes_new[...] = self.mesh(block.name, step.t + step.dt)
                self._check_mesh(block)
            elif self.quality is None:  # else both arrays hold the fixed grid already
                block.nodes_new[...] = block.nodes

    @staticmethod
    def _check_mesh(block: Block) -> None:
        """The grid of a prescribed motion is convex; RegridFailure if not."""
        bad_cells = find_bad_cells(block.nodes_new)
        if len(bad_cells):
            i, j = (int(index) for index in bad_cells[0])
            raise RegridFailure(
                f"mesh motion: block {block.name!r}: {say_not_convex(len(bad_cells))}, the first "
                f"is i={i}, j={j}",
                cause="mesh-law",
                place=Place(block.name, (i, j)),
            )

    def _check_lines(self) -> None:
        """Grids of a prescribed motion agree on linked sides; RegridFailure if not."""
        for link in self.exchange.links:
            line = link.leader.line(link.leader.block.nodes_new)
            follower_line = link.follower.line(link.follower.block.nodes_new)
            gap = np.abs(link.arrange_for_follower(line) - follower_line).max()
            if gap > LARGEST_LINK_GAP * np.ptp(line, axis=1).max():
                raise RegridFailure(
                    f"mesh motion: {link.leader} and {link.follower} are {gap:.1e} m apart",
                    cause="mesh-law",
                    place=Place(link.leader.block.name),
                )

    def regrid(self, fraction: float = 1.0, failure: RunFailure | None = None) -> None:
        """Fill the interior of every block's new nodes from its new sides, each by its owner.

        failure: why this rank cannot take part; all ranks have to come here.  Raises the first
        failure of all ranks: RegridFailure when no valid grid is found.
        """
        if self.mesh == "regrid":  # whether a rank has failed or not
            seen = [aware is not None and aware.sees_flow for aware in self.flow_aware]
            self.blocks.bring_starts(self.cost_aware, seen)
        number = -1 if failure is None or not callable(self.mesh) else self._find_number(failure)
        if failure is None:
            number, failure = self._regrid_own(fraction)
        # quality and counts of this rank's grids: known from the regridder, or measured
        own_reports = []
        quality_before = self.quality
        for own_number in self.blocks.own if failure is None else ():
            report = self.reports[own_number] if self.mesh == "regrid" else None
            quality = None
            if report is not None and not self._limited[own_number]:
                quality = report.quality
            if self.mesh == "fixed" and quality_before is not None:
                quality = quality_before[own_number]
            quality = quality or measure_worst(self.blocks[own_number].nodes_new)
            own_reports += [(*quality, *self._count(own_number))]
        # those of all ranks
        self.quality = []
        self.counts = []
        for numbers in self.blocks.exchange_nodes(own_reports, number, failure):
            self.quality += [numbers[:QUALITY_NUMBERS]]
            self.counts += [numbers[QUALITY_NUMBERS:]]
        if callable(self.mesh):
            self._check_lines()

    def _regrid_own(self, fraction: float) -> tuple[int, RunFailure | None]:
        """Regrid the blocks that are here; the first failure, and its place in the order of all."""
        own_numbers = self.blocks.own
        number = 0
        if self.mesh == "regrid":
            try:
                self.blocks.workers.run(
                    lambda n: self._regrid_block(own_numbers[n], fraction), len(own_numbers)
                )
            except RegridFailure as own_failure:
                return self._find_number(own_failure), own_failure
        try:
            for contact in self.exchange.contacts:
                contact.measure_new_polygons()
            for number in own_numbers if self._has_followers else ():
                if self.blocks[number].is_follower:
                    self._spare_polygons(number, MOST_EXCESS * min(1.0, fraction))
        except RegridFailure as own_failure:
            return len(self.blocks) + number, own_failure
        return 0, None

    def _count(self, number: int) -> tuple[float, ...]:
        """What regridding a block took in the step: iterations, of nodes, sub-moves, rescues, nodes
        held back, reports; and the least corner ratio."""
        report = self.reports[number]
        limited = self._limited[number]
        if report is None:
            return (*NO_COUNTS[:4], limited, *NO_COUNTS[5:])
        return (
            report.iterations, report.node_iterations, report.sub_moves, report.rescues, limited, 1,
            report.least_corner_ratio,
        )  # fmt: skip

    def _find_number(self, failure: RunFailure) -> int:
        """The number of the block that a failure names, -1 where it names none."""
        names = [block.name for block in self.blocks]
        place = failure.place
        return names.index(place.block) if place is not None and place.block in names else -1

    def _regrid_block(self, number: int, fraction: float) -> None:
        block = self.blocks[number]
        regridder = self.regridders[number]
        self._limited[number] = 0
        flow_aware = self.flow_aware[number]
        if flow_aware is not None and flow_aware.sees_flow:
            flow_aware.take_step(block.compute_fields(block.start), min(1.0, fraction))
        sound_speeds = (block.compute_sound_speed(block.start),) if self.cost_aware[number] else ()
        try:
            result = call_regridder(
                regridder, block.nodes, block.nodes_new, *sound_speeds,
                where=f"block {block.name!r}", in_place=True,
            )  # fmt: skip
        except RegridFailure as failure:
            failure.block = block.name
            if failure.cause == "lines-cross" and crosses_seam(block):
                failure.cause = "seam-crossed"
            raise
        nodes = result.nodes
        largest_motion = MOST_EXCESS * min(1.0, fraction)
        strayed = result.report.strayed
        if strayed is None or strayed > largest_motion:
            nodes, self._limited[number] = self.limiters[number].limit(
                block.nodes, nodes, largest_motion
            )
        if nodes is not block.nodes_new:
            block.nodes_new[...] = nodes
        self.reports[number] = result.report

    def _spare_polygons(self, number: int, largest_motion: float) -> None:
        """Move less of a follower's interior where its polygon cells would be crushed.

        Raises RegridFailure where a cell would be left no volume even so.
        """
        block = self.blocks[number]
        find_crushed = make_find_crushed(block.geometry)
        rebuilt = None
        for halvings in range(SPARING_HALVINGS + 1):
            volume_left, i, j = find_crushed(
                block.nodes, block.nodes_new, block.excess_volume, block.excess_volume_new
            )
            if volume_left >= LEAST_VOLUME_LEFT:
                return
            if halvings == SPARING_HALVINGS:
                break
            if rebuilt is None:
                rebuilt = block.nodes_new.copy()
            largest_motion *= 0.5
            nodes, self._limited[number] = self.limiters[number].limit(
                block.nodes, rebuilt, largest_motion
            )
            block.nodes_new[...] = nodes
        if volume_left <= 0.0:
            raise RegridFailure(
                f"sliding: the line of the other block takes all of cell i={i}, j={j}",
                block=block.name,
                cell=(int(i), int(j)),
                cause="contact-lost",
            )


def crosses_seam(block: Block) -> bool:
    """Whether one of the two lines that cross along the new sides of a block is a seam."""
    for side, node in find_crossing(block.nodes_new) or ():
        for segment in block.segments:
            if segment.side == side and segment.start <= node <= segment.stop:
                if segment.is_inner_seam:
                    return True
    return False


def _make_regridders(make_regridder, blocks: list[Block]) -> list[Any]:
    """One a block; BadInput for what makes none."""
    if not callable(make_regridder):
        raise BadInput(
            f"make_regridder is {make_regridder!r}: a function that makes a regridder is wanted, "
            "such as lambda: shockgrid.make_regridder('barrier')"
        )
    made = [make_regridder() for _ in blocks]
    for regridder, block in zip(made, blocks, strict=True):
        check_regridder(regridder, "what make_regridder returns")
        if hasattr(regridder, "take_first_grid"):
            regridder.take_first_grid(block.nodes)
    return made


def _refuse_flow(blocks: list[Block], mesh) -> None:
    for block in blocks:
        for segment in block.segments:
            if mesh == "fixed" and segment.moves:
                raise BadInput(
                    f"{segment}: a segment of kind {segment.kind!r} moves; "
                    "the mesh cannot be 'fixed'"
                )
