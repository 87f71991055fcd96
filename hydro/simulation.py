"""A flow simulation: blocks, links and the march in time, with steps rejected when they fail."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from shockgrid.hydro import phases
from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import OpenSides
from shockgrid.hydro.clock import Clock, Stopwatch
from shockgrid.hydro.contacts.meetings import Meetings
from shockgrid.hydro.contacts.start import check_overlaps
from shockgrid.hydro.contacts.voids import FACES_IN_STATE, VOIDS_IN_STATE
from shockgrid.hydro.formulas.geometry import find_geometry
from shockgrid.hydro.history import compute_columns
from shockgrid.hydro.ledger import Ledger
from shockgrid.hydro.links import Exchange, Link, name_materials
from shockgrid.hydro.mixture.phases import check_geometry
from shockgrid.hydro.motion.following import ZoneFollowing
from shockgrid.hydro.motion.grid_motion import GridMotion, MeshMotion
from shockgrid.hydro.motion.line import Line, LineRule
from shockgrid.hydro.motion.overlaps import Overlaps
from shockgrid.hydro.motion.tension import SurfaceTension
from shockgrid.hydro.perimeter.contacts import AXIS
from shockgrid.hydro.ranks.blocks import Blocks
from shockgrid.hydro.sliding.contact import SlidingContact
from shockgrid.hydro.small_cells import SmallCells
from shockgrid.hydro.sources import BodySource, SourceFunction
from shockgrid.hydro.step import Flow, take_step
from shockgrid.hydro.workers import Workers
from shockgrid.regrid.compilation.first_calls import is_interpreting
from shockgrid.regrid.errors import BadInput, Place, RunFailure, suggest
from shockgrid.regrid.sides import SIDE_NAMES

LEAST_STEP_PART = 1e-9  # of the first stable step: a shorter one will not bring the run to its end
# the same where the flow can go on without the line that makes the steps short, times the part of
# the run that is left: what is left would take fifty times as many steps as all did at first
LEAST_STEP_PART_BEFORE_HANDOVER = 0.02
COLLAPSING_STEP_PART = 1e-4  # the same: so short steps show that a grid cannot follow
# why two blocks became one, in the history: at a given time; else the cause of a failure
AT_ITS_TIME = "time"
SMALL_CELLS = 0.05  # part of a block's cells that may be too small for a step
# that a state has before its first step
START_COLUMNS = ("total_", "surface_", "least", "worst", "cells")

# what is made anew with other blocks
REBUILT_PARTS = (
    "_blocks",
    "_shared",
    "_overlaps",
    "exchange",
    "motion",
    "meetings",
    "tension",
    "_body_source",
    "ledger",
    "small_cells",
    "_flow",
)


class Refining(Protocol):
    """What adds and takes away grid lines; `hydro.remap.flow` says how."""

    rebuild: Callable[[list, list], tuple[list[Block], list, Callable[[], object] | None]]

    def make_first_nodes(self, count: int) -> list[np.ndarray]:
        """First grids with `count` columns of cells."""
        ...

    def choose(self, step: int, lines: Sequence[Line]) -> np.ndarray | None:
        """After a step, where in numbers of the present columns the new lines lie; None: stay."""
        ...

    def lay(
        self, places: np.ndarray, blocks: Sequence[Block], motion: GridMotion, t: float
    ) -> list[tuple[np.ndarray, dict[str, np.ndarray]]]:
        """Nodes and what cells hold (`Block.held_arrays`) of all blocks; `motion` has the new."""
        ...


class Joining(Protocol):
    """What makes one block of two materials of two blocks; `hydro.remap.merging` says how."""

    first_nodes: np.ndarray | None
    name: str
    joined: Mapping[str, str]  # labels of materials that become one, and its label
    following: ZoneFollowing | None  # spaces the sides of the new block

    def is_due(self, t: float) -> bool:
        """Whether it is time [s] for it, and it has not been done yet."""
        ...

    def merge(self, blocks: Sequence[Block]) -> tuple[list[Block], list, Callable[[], object]]:
        """The new block with the states of both, its links, and what makes its regridder."""
        ...

    def lay(self, state: Any) -> tuple[list[Block], list, Callable[[], object]] | None:
        """The same of a state of `Simulation.get_state`; None where both blocks are in it."""
        ...


class Simulation:
    """Blocks marched together to `t_end`; obeys `problems.evolution.Evolution`.

    blocks with their segments put and joined; `links` of the joined segments; `mesh`: "regrid",
    "fixed" or a motion `(block name, t) -> nodes`; `make_regridder`: called once a block; `cfl`:
    part of the time in which waves cross the fastest cell, their rate being summed over both grid
    directions (1 is the limit of the unsplit scheme); `source`: gravity or heating
    (`hydro.sources`); `geometry`: "plane", or "axisymmetric" with x along the axis and y the radius
    (`hydro.formulas.geometry`; all integrals are then per radian); `refining`: adds grid lines on
    the way (`hydro.remap.flow`), None: the cells stay as many as they are; `void_fill`: pressure
    [Pa] and gamma of the gas that a void between surfaces holds when it closes, None: nothing;
    `find_end`: called after every step, gives words for a run that has come to its end before
    `t_end`; `find_thin_place`: called with a block that lets the time step collapse, gives words
    for a place where it is thin; `handover`: lays both blocks on one of two materials on the way
    (`hydro.remap.merging`).  Raises BadInput for sides that are not covered once by segments, and
    for blocks that lie on each other.
    """

    lists_in_state = (FACES_IN_STATE, VOIDS_IN_STATE)

    def __init__(
        self,
        blocks: list[Block],
        links: list[Link | SlidingContact],
        *,
        t_end: float,
        cfl: float = 0.8,
        small_cells: float | None = None,
        mesh: str | MeshMotion = "regrid",
        make_regridder: Callable[[], object] | None = None,
        line_rule: LineRule | None = None,
        source: SourceFunction | None = None,
        geometry: str = "plane",
        threads: int | None = 1,
        refining: Refining | None = None,
        void_fill: tuple[float, float] | None = None,
        find_end: Callable[[Simulation], str | None] | None = None,
        find_thin_place: Callable[[Block], str | None] | None = None,
        handover: Joining | None = None,
    ):
        self.geometry = find_geometry(geometry)
        _check_parts(blocks, links)
        _check_positive("t_end", t_end, " s")
        _check_positive("cfl", cfl)
        self._wanted_threads = threads
        self._mesh = mesh
        self._line_rule = line_rule or LineRule()
        self._source = source
        self._void_fill = void_fill
        self._find_end = find_end
        self._find_thin_place = find_thin_place
        self.handover = handover
        self.refining = refining
        self._counts_cells = refining is not None
        self._joined = {} if handover is None else handover.joined
        self._processors: int | None = None  # for the threads of this rank
        self._handed_over = ""  # why, in the row of the step in which it was
        self._connect(blocks, links, make_regridder)
        check_overlaps(blocks, links)
        if self.meetings.set_in_contact():
            self._connect(blocks, links, make_regridder)
        self._overlaps.check_pistons(float(t_end))
        if refining is not None:  # contacts stay as thick as they are on the first cells
            thickness = [contact.thickness for contact in self.motion.sides.thick_contacts]
            self._line_rule = replace(self._line_rule, thickness=max(thickness, default=None))
        self.ledger = Ledger(blocks, self._joined)
        self.stopwatch = Stopwatch()
        self.last_reason: RunFailure | None = None  # why a step was rejected last
        self.finished: str | None = None
        if not is_interpreting():  # built to be looked at, it needs no rates and totals
            self._update_rates()
        if small_cells is None:  # a mesh that is given has the cells that it is to have
            small_cells = SMALL_CELLS if mesh == "regrid" else 0.0
        respacing = self._line_rule.respacing  # the cells that are finer until then are wanted
        self.small_cells = SmallCells(
            self._shared, small_cells, respacing.start if respacing else 0.0
        )
        rate = np.inf if is_interpreting() else self.small_cells.find_first_rate(0.0)
        self.clock = Clock(t_end=float(t_end), cfl=float(cfl), rate=rate)
        self._make_flow()

    def _connect(
        self,
        blocks: list[Block],
        links: list[Link | SlidingContact],
        make_regridder: Callable[[], object] | None,
    ) -> None:
        """Check blocks and links, and make what passes between them and moves their grids."""
        for block in blocks:
            block.set_geometry(self.geometry)
            if block.mixed is not None:
                check_geometry(block)
            _check_cover(block)
            _check_axis(block)
        _check_links(blocks, links)
        name_materials(blocks, links)
        self._overlaps = Overlaps(blocks, links)
        self._overlaps.check_start()
        for link in links:
            if isinstance(link, SlidingContact):
                link.set_geometry(self.geometry)
        self._blocks = blocks
        self.exchange = Exchange(links)
        cells = [block.ni * block.nj for block in blocks]
        self._shared = Blocks(blocks, Workers(cells, self._wanted_threads))
        make_regridder = make_regridder or _make_barrier
        self.motion = GridMotion(
            self._shared, self.exchange, self._mesh, make_regridder, self._line_rule
        )
        self.meetings = Meetings(blocks, links, self.motion, self.geometry, self._void_fill)
        self.tension = SurfaceTension(blocks, self.exchange, self.motion)
        if self._mesh != "fixed":
            self._overlaps.watch(all_segments=callable(self._mesh))
        self._body_source = BodySource(self._shared, self._source)
        self.exchange.divide_contacts()

    def _update_rates(self) -> None:
        """Rates and totals of states that no step has made."""
        for block in self._blocks:
            phases.measure_rates(block)

    def _make_flow(self) -> None:
        self._flow = Flow(
            self._shared,
            self.exchange,
            OpenSides(self._shared),
            self.motion,
            self.meetings,
            self.tension,
            self._body_source,
            self.ledger,
            self.clock,
            self.small_cells,
            self.stopwatch,
        )

    @property
    def blocks(self) -> list[Block]:
        """The whole blocks; with several ranks they are collected from their owners."""
        self._shared.collect()
        return self._blocks

    def __getitem__(self, name: str) -> Block:
        """The block of this name: `simulation["gas"].rho`; BadInput for an unknown one."""
        for block in self.blocks:
            if block.name == name:
                return block
        names = [block.name for block in self.blocks]
        raise BadInput(f"there is no block {name!r}{suggest(str(name), names)}")

    @property
    def flow(self) -> Flow:
        """What a step works on, with whole blocks."""
        self.collect()
        return self._flow

    def collect(self) -> None:
        """Make all blocks whole here, where other ranks have computed them; for the first rank."""
        self._shared.collect()

    def use_ranks(self, ranks: Blocks, processors: int | None = None) -> None:
        """From now on compute the pieces of `ranks` alone; all ranks have the same state.

        processors: as many are there for this rank, None for all that the process may use.  Raises
        BadInput where blocks are cut that a body source acts on, which is summed over whole blocks,
        and where grid lines are added during the run.
        """
        if ranks.cuts and self._flow.source.function is not None:
            raise BadInput("blocks that a body source acts on cannot be cut among ranks")
        if self.refining is not None and ranks.size > 1:
            raise BadInput(
                "only one process can add grid lines during a run; set refine = false, or run "
                "without MPI"
            )
        cells = [(last - first) * self._blocks[n].nj for n, first, last in ranks.pieces]
        ranks.workers = Workers(cells or [1], self._wanted_threads, processors)
        self._processors = processors
        self._shared = ranks
        self.small_cells.blocks = ranks
        self._body_source.blocks = ranks
        self.motion.use_ranks(ranks)
        self._flow = replace(self._flow, blocks=ranks)

    @property
    def workers(self) -> Workers:
        """Threads over blocks and inside them."""
        return self._shared.workers

    @property
    def t(self) -> float:
        """Time [s]."""
        return self.clock.t

    @property
    def step(self) -> int:
        """Number of the last step."""
        return self.clock.step

    @property
    def dt(self) -> float:
        """Length of the last step [s]."""
        return self.clock.dt

    @property
    def t_end(self) -> float:
        """End of the run [s]."""
        return self.clock.t_end

    def advance(self) -> dict:
        """One step; returns its history row.  Raises RunFailure with block, cell and time."""
        if self.finished:
            raise BadInput(f"the run is at its end already: {self.finished}")
        clock = self.clock
        # one step, or a failure that all ranks know
        self._shared.begin_step()
        if self.tension.lines:
            clock.tension_dt = self.tension.find_step()
        while True:
            try:
                if self._line_rule.following is not None:
                    self._line_rule.following.look(self._shared)
                self._check_collapse()
                touching = self.meetings.find(clock.t, clock.step)
                self._overlaps.check(clock.t, clock.step, touching)
                record = take_step(self._flow)
                break
            except RunFailure as failure:  # all ranks have agreed on it
                self._go_on_after(failure)
        self.last_reason = record.reason or self.last_reason
        # at the end, or with other grid lines from now on
        if record.last:
            self.finished = "t_end reached"
        elif self.refining is not None:
            self._refine(self.refining)
        elif self.handover is not None and self.handover.is_due(clock.t):
            self.hand_over()
            self._handed_over = AT_ITS_TIME
        row = self.compute_row(record.dt_limit, record.retries)
        self._handed_over = ""
        self._note_end()  # within the step: every rank has what it reads
        self._shared.end_step()
        return row

    def _go_on_after(self, failure: RunFailure) -> None:
        """Lay both materials on one grid where the flow ends with their line, or say why not."""
        if self.handover is None or self.handover.first_nodes is not None:
            self._shared.end_step()
            raise failure
        self.last_reason = failure
        try:
            self.hand_over()
        except (BadInput, RunFailure):
            self._shared.end_step()
            raise failure from None
        self._handed_over = failure.cause or "failure"

    def _note_end(self) -> None:
        if self.finished is None and self._find_end is not None:
            self.finished = self._find_end(self)

    def _refine(self, refining: Refining) -> None:
        """Add or take away grid lines where it is time and a grid is found for them."""
        places = refining.choose(self.step, self.motion.sides.lines)
        if places is None:
            return
        kept = self._keep_parts()
        # the new blocks are made by the problem, from states; their grids then come from `lay`
        old = self._blocks
        inside = [block.state[:, 1:-1, 1:-1][..., places[:-1].astype(int)] for block in old]
        self._lay_cells(refining, places.size - 1, inside)
        try:
            laid_blocks = refining.lay(places, old, self.motion, self.t)
        except RunFailure:
            self._put_back(kept)
            return
        for block, (nodes, held) in zip(self._blocks, laid_blocks, strict=True):
            block.nodes[...] = block.nodes_new[...] = nodes
            for name, array in held.items():
                block.get_inside(name)[...] = array
        self.motion.counts = kept["motion"].counts  # of the step that is over
        self._update_rates()
        self.clock.rate = self.small_cells.find_first_rate(self.t)

    def _keep_parts(self) -> dict[str, Any]:
        """The blocks and all that is made with them, to be put back where no new ones are found."""
        return {name: getattr(self, name) for name in REBUILT_PARTS}

    def _put_back(self, kept: dict[str, Any]) -> None:
        for name, part in kept.items():
            setattr(self, name, part)

    def _lay_cells(self, refining: Refining, count: int, states: list) -> None:
        """Rebuild the blocks with so many columns, on grids sampled from the first ones."""
        blocks, links, make_regridder = refining.rebuild(refining.make_first_nodes(count), states)
        self._connect(blocks, links, make_regridder)
        ledger = self.ledger
        self.ledger = Ledger(blocks, self._joined)
        self.ledger.set_state(ledger.get_state())
        small = self.small_cells
        self.small_cells = SmallCells(self._shared, small.allowed_fraction, small.start)
        self._make_flow()

    def hand_over(self) -> None:
        """From now on both materials are in one block, and the line between them is a field.

        Raises RunFailure where no grid is found for it, and nothing has changed.
        """
        assert self.handover is not None
        kept = self._keep_parts()
        line_rule = self._line_rule
        ranks = self._shared
        ranks.share()  # all ranks lay the same blocks, from the same numbers
        try:
            self._join_blocks(*self.handover.merge(self._blocks))
        except (BadInput, RunFailure):
            self._put_back(kept)
            self._line_rule = line_rule
            self.handover.first_nodes = None
            raise
        self.motion.counts = kept["motion"].counts  # of the step that is over
        self._update_rates()
        self.clock.rate = self.small_cells.find_first_rate(self.t)
        if ranks.size > 1:
            self.use_ranks(ranks.make_for(self._blocks), self._processors)
        # what the old cells and the line had asked of the step
        self.clock.retry_dt = np.inf
        self.clock.stretch_rate = 0.0

    def _join_blocks(
        self, blocks: list[Block], links: list, make_regridder: Callable[[], object]
    ) -> None:
        """March these blocks from now on."""
        following = None if self.handover is None else self.handover.following
        self._line_rule = replace(self._line_rule, respacing=None, following=following)
        self._connect(blocks, links, make_regridder)
        ledger = self.ledger
        self.ledger = Ledger(blocks, self._joined)
        self.ledger.set_state(ledger.get_state())
        self.small_cells = SmallCells(self._shared, self.small_cells.allowed_fraction, 0.0)
        self._make_flow()

    def adopt_cells(self, state) -> None:
        """Have as many cells as a state of `get_state`, where lines may come and go."""
        if self.handover is not None and self.handover.first_nodes is None:
            joined = self.handover.lay(state)
            if joined is not None:
                self._join_blocks(*joined)
        if self.refining is None:
            return
        states = [state.get(f"{block.name}/state") for block in self._blocks]
        if any(array is None for array in states):
            return  # told by who reads restart points
        counts = {array.shape[2] for array in states}
        if len(counts) == 1 and counts != {self._blocks[0].nj}:
            self._lay_cells(self.refining, counts.pop(), states)

    def _check_collapse(self) -> None:
        """Raise RunFailure where the next step would be too short to bring the run to its end.

        It names the reason for which longer steps were rejected, or the cell with the largest rate.
        """
        if self._find_thin_place is not None:
            self._check_thin_place(self._find_thin_place)
        clock = self.clock
        dt, dt_limit = clock.choose_dt()
        can_hand_over = self.handover is not None and self.handover.first_nodes is None
        least_part = LEAST_STEP_PART
        if can_hand_over:
            part_left = (clock.t_end - clock.t) / clock.t_end
            least_part = max(least_part, LEAST_STEP_PART_BEFORE_HANDOVER * part_left)
        if dt >= least_part * clock.first_stable_dt or dt_limit in ("t_end", "start"):
            return
        when = f"t = {clock.t:.6g} s (step {clock.step})"
        if dt_limit == "retry" and self.last_reason:
            raise self.last_reason.tell(
                f"{self.last_reason}, {when}; only steps down to {dt:.3g} s were possible at last",
                RunFailure,
            )
        fastest = self.small_cells.fastest
        name = self._blocks[fastest.block].name
        raise RunFailure(
            f"flow: the time step has collapsed to {dt:.3g} s in block {name!r} (waves cross cell "
            f"i={fastest.i}, j={fastest.j} fastest), {when}",
            cause="collapse",
            place=Place(name, (fastest.i, fastest.j)),
        )

    def _check_thin_place(self, find_thin_place: Callable[[Block], str | None]) -> None:
        """Raise RunFailure where the step collapses in a block that is too thin to be followed."""
        block = self._find_collapsing_block()
        if block is None:
            return
        thin_place = find_thin_place(block)
        if thin_place:
            clock = self.clock
            raise RunFailure(
                f"flow: the time step collapses as {thin_place}; "
                f"t = {clock.t:.6g} s (step {clock.step})",
                cause="collapse",
                place=Place(block.name),
            )

    def _find_collapsing_block(self) -> Block | None:
        """The block whose grid lets no step happen that gets the run anywhere, if there is one."""
        clock = self.clock
        possible = min(clock.retry_dt, clock.cfl / clock.rate)
        if possible >= COLLAPSING_STEP_PART * clock.first_stable_dt:
            return None
        place = self.last_reason.place if self.last_reason is not None else None
        if clock.retry_dt < np.inf and place is not None:
            return next((block for block in self._blocks if block.name == place.block), None)
        return self._blocks[self.small_cells.fastest.block]

    def start_row(self) -> dict:
        """History columns of the state before the first step."""
        row = self.compute_row("start", 0)
        return {name: row[name] for name in row if name.startswith(START_COLUMNS)}

    def compute_row(self, dt_limit: str, retries: int) -> dict:
        """The history row of the current state."""
        row = {
            "t": self.clock.t,
            "dt": self.clock.dt,
            "dt_limit": dt_limit,
            "retries": retries,
            **compute_columns(self._flow),
        }
        if self.handover is not None:
            row["handover"] = self._handed_over
        if self._counts_cells:
            row["cells"] = sum(block.ni * block.nj for block in self._blocks)
        return row

    def get_state(self) -> dict:
        """All that the next step depends on."""
        state: dict[str, Any] = {
            **self.clock.get_state(),
            **self.ledger.get_state(),
            **self.meetings.get_state(),
        }
        for number, contact in enumerate(self.exchange.contacts):
            state[f"contact{number}/fixed"] = contact.fixed.copy()
        if self.handover is not None and self.handover.first_nodes is not None:
            state[f"{self.handover.name}/first_nodes"] = self.handover.first_nodes
        for block in self.blocks:
            for name in block.step_arrays:
                state[f"{block.name}/{name}"] = block.get_inside(name).copy()
        return state

    def set_state(self, state) -> None:
        """Take up a state of `get_state` of the same blocks."""
        self.adopt_cells(state)
        self.clock.set_state(state)
        self.ledger.set_state(state)
        self.meetings.set_state(state)
        self.motion.quality = None
        self.finished = "t_end reached" if self.t >= self.t_end else None
        for number, contact in enumerate(self.exchange.contacts):
            contact.fixed[:] = state[f"contact{number}/fixed"]
        for block in self.blocks:
            for name in block.step_arrays:
                block.get_inside(name)[...] = state[f"{block.name}/{name}"]
        self.small_cells.find_fastest()
        self._note_end()


def _make_barrier():
    from shockgrid.regrid.registry import make_regridder

    return make_regridder("barrier")


def _check_positive(name: str, value: object, unit: str = "") -> None:
    """Raise BadInput for what is no number greater than 0."""
    if not isinstance(value, int | float | np.number) or not value > 0.0:
        raise BadInput(f"{name} is {value!r}{unit}; it must be a positive number")


def _check_parts(blocks: Any, links: Any) -> None:
    """There are blocks, each of its own name, and links are links; raises BadInput otherwise."""
    if not isinstance(blocks, list | tuple) or not blocks:
        raise BadInput(
            f"a simulation is of a list of blocks, one at least; it was given {blocks!r}"
        )
    for block in blocks:
        if not isinstance(block, Block):
            raise BadInput(f"a simulation is of blocks, and {block!r} is none")
    names = [block.name for block in blocks]
    twice = [name for name in dict.fromkeys(names) if names.count(name) > 1]
    if twice:
        raise BadInput(f"{names.count(twice[0])} blocks are called {twice[0]!r}: each has its name")
    if not isinstance(links, list | tuple):
        raise BadInput(f"the links of a simulation are a list, [] for none; it was given {links!r}")
    for link in links:
        if not isinstance(link, Link | SlidingContact):
            raise BadInput(f"links are what `join` and `slide` return, and {link!r} is none")


def _check_links(blocks: list[Block], links: list[Link | SlidingContact]) -> None:
    """Every segment that needs a partner is in exactly one link; raises BadInput otherwise."""
    block_ids = {id(block) for block in blocks}
    for segment in (segment for link in links for segment in link.segments):
        if id(segment.block) not in block_ids:
            raise BadInput(f"{segment} is linked, and its block is not among the simulation's")
    linked = [id(segment) for link in links for segment in link.segments]
    for block in blocks:
        for segment in block.segments:
            if segment.linked and linked.count(id(segment)) != 1:
                raise BadInput(
                    f"{segment}: a segment of kind {segment.kind!r} needs one partner, made by "
                    "`join` or `slide` and given to the simulation with the links"
                )


def _check_axis(block: Block) -> None:
    """Faces on the axis of axisymmetric flow, and no others, are axis segments; else BadInput."""
    for segment in block.segments:
        on_axis = not segment.line(block.nodes)[1].any()
        if segment.wall == AXIS and not block.geometry.curved:
            raise BadInput(f"{segment}: plane flow has no axis; put a 'wall' there")
        if on_axis and segment.wall != AXIS and block.geometry.curved:
            raise BadInput(
                f"{segment}: a {segment.kind} segment lies on the axis y = 0, where nothing can "
                "pass; put an 'axis' segment there"
            )


def _check_cover(block: Block) -> None:
    """Every face of a side belongs to exactly one segment; raises BadInput otherwise."""
    for side in SIDE_NAMES:
        segments = sorted((s for s in block.segments if s.side == side), key=lambda s: s.start)
        next_face = 0
        count = block.side_faces(side)[1]
        for segment in segments:
            if segment.start != next_face:
                problem = (
                    "overlaps another" if segment.start < next_face else "leaves a hole before it"
                )
                raise BadInput(
                    f"block {block.name!r}, side {side}: the {segment.kind} segment on faces "
                    f"{segment.start} to {segment.stop} {problem} (face {next_face} comes next)"
                )
            next_face = segment.stop
        if next_face != count:
            raise BadInput(
                f"block {block.name!r}, side {side}: no segment covers the faces {next_face} "
                f"to {count}"
            )
