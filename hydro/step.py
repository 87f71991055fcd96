"""One time step in seven phases, in the order of the numbers; the arithmetic is elsewhere.

Until phase 7 all results go into separate arrays, so that a step can be rejected at no cost.  Body
sources, too, apply their first half to a copy of the state.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

from shockgrid.hydro import phases
from shockgrid.hydro.boundary import OpenSides
from shockgrid.hydro.clock import MOST_STRETCHING, Clock, Stopwatch
from shockgrid.hydro.contacts.meetings import Meetings
from shockgrid.hydro.contacts.voids import Voids
from shockgrid.hydro.ledger import Ledger
from shockgrid.hydro.links import Exchange
from shockgrid.hydro.motion import sides as on_sides
from shockgrid.hydro.motion.grid_motion import GridMotion
from shockgrid.hydro.motion.sides import Sides, StepTime
from shockgrid.hydro.motion.tension import SurfaceTension
from shockgrid.hydro.ranks.blocks import Blocks
from shockgrid.hydro.small_cells import SmallCells
from shockgrid.hydro.sources import BodySource
from shockgrid.regrid.errors import RegridFailure, RunFailure

MOST_RETRIES = 12

# Phase 4, how the nodes along the sides of all blocks move: passes in their order, what each does,
# and why it stands there.  They are in `hydro.motion.sides`.
# Each is left out where the list of this name is empty.
SIDE_PASSES: tuple[tuple[Callable[[Sides, StepTime], None], str, str], ...] = (
    (on_sides.space_contact_points, "followers", "spacing around contact points, by old lengths"),
    (on_sides.turn_mirrors, "turning", "walls at line ends as they lie, where damping mirrors"),
    (on_sides.damp_short_waves, "damped", "additional velocities of lines and their ends"),
    (on_sides.move_key_nodes, "key_nodes", "ends of lines first, by all faces that meet there"),
    (on_sides.move_lines, "moving", "between their ends; along themselves if nothing cuts them"),
    (on_sides.slide_joints, "joints", "ends inside a contact, along its moved lines"),
    (on_sides.move_tied_seams, "tied_seams", "their ends go with contacts, which have moved"),
    (on_sides.lay_followers, "followers", "on their leaders' moved lines; cuts free lines"),
    (on_sides.spread_lines, "lines", "those that were cut, and all that only go with their ends"),
    (on_sides.give_lines, "links", "followers receive the leaders' lines, final but for corners"),
    (on_sides.hold_corners, "guards", "last, because respacing would reopen the held corners"),
)


class Coupling(Protocol):
    """What acts on the sides of blocks from beyond them; three calls a step, in this order.

    dt: length of the step [s]; t: its start for the ghosts, its middle for speeds and fluxes [s].
    Without members, such as links or surfaces that may meet, a coupling does nothing.
    """

    def fill_ghosts(self, t: float, dt: float) -> None:
        """On the old grid, from the cells: the states that stand for what is beyond the sides."""

    def fill_speeds(self, t: float, dt: float) -> None:
        """On the old grid, from the traces at mid-time: contact states, with which lines move."""

    def fill_fluxes(self, t: float, dt: float) -> None:
        """Between both grids, from the traces on the moved faces: fluxes through the sides."""


# The couplings of a flow in the order in which a step calls them, and why each stands there.
COUPLINGS: tuple[tuple[str, str], ...] = (
    ("tension", "surface tension: jumps of the pressure, and tractions, for all contact states"),
    ("exchange", "links and sliding contacts between blocks"),
    ("voids", "pressures in voids, for the free surfaces around them"),
    ("open_sides", "open sides and free surfaces; where these touch, contacts replace them"),
    ("meetings", "contacts between free surfaces that touch, over the states of the free ones"),
)


@dataclass(frozen=True)
class Flow:
    """What a step works on; made once, by `hydro.simulation.Simulation`."""

    blocks: Blocks
    exchange: Exchange
    open_sides: OpenSides
    motion: GridMotion
    meetings: Meetings
    tension: SurfaceTension
    source: BodySource
    ledger: Ledger
    clock: Clock
    small_cells: SmallCells
    stopwatch: Stopwatch

    @property
    def voids(self) -> Voids:
        """Between the surfaces that may meet."""
        return self.meetings.voids

    @cached_property
    def couplings(self) -> list[Coupling]:
        """The members of COUPLINGS, in their order."""
        return [getattr(self, name) for name, _ in COUPLINGS]


@dataclass
class StepRecord:
    """How a step went: what limited it, how often and why it was retried, and whether it is the
    last."""

    dt_limit: str = ""
    retries: int = 0
    reason: RunFailure | None = None
    last: bool = False


@dataclass(frozen=True)
class Touch:
    """Surfaces come to touch before the step is over: it ends there instead, after `dt` [s]."""

    dt: float


def take_step(flow: Flow) -> StepRecord:
    """Advance all blocks by one step.

    Raises RunFailure if no step is valid, down to 2^-MOST_RETRIES of the one that was chosen; the
    state is then untouched.
    """
    record = StepRecord()
    for block in flow.blocks:
        block.kernels.use_first_order(False)
    # 1 dt from the largest rate of all blocks; halved for as long as the step fails, but once at
    # first order before, where that may help
    dt, record.dt_limit = flow.clock.choose_dt()
    first_dt = dt
    while outcome := try_step(flow, dt):
        if isinstance(outcome, Touch):
            dt = outcome.dt
            first_dt = dt
            record.dt_limit = "touch"
            continue
        record.reason = outcome
        record.retries += 1
        if record.retries > MOST_RETRIES:
            raise outcome.tell(
                f"{outcome}, t = {flow.clock.t:.6g} s (step {flow.clock.step}); "
                f"{record.retries} steps were tried, the last of {dt:.3g} s",
                RunFailure,
            )
        if lower_order(flow, outcome):
            dt = first_dt
        else:
            dt = 0.5 * dt
        record.dt_limit = "retry"
    accept_step(flow, dt, record)
    return record


def lower_order(flow: Flow, reason: RunFailure) -> bool:
    """Let all gases take this step at first order, where one has got too cold; False if they do.

    A variation over a cell can take more internal energy out of it than it has, in however short
    a step, where gas expands towards a vacuum; constant cells cannot.
    """
    cause = "cold-gas"
    gases = [block for block in flow.blocks if block.eos.failure_cause == cause]
    if reason.cause != cause or all(block.kernels.is_first_order for block in gases):
        return False
    for block in gases:
        block.kernels.use_first_order(True)
    return True


def try_step(flow: Flow, dt: float) -> RunFailure | Touch | None:
    """Phases 2 to 6, into the new nodes and states; why the step does not stand, or None."""
    fraction = flow.clock.compute_fraction(dt)  # of the stable dt
    flow.small_cells.set_time(flow.clock.t)
    try:
        with agree_on_failures(flow.motion, fraction):
            fill_states_beyond(flow, dt)
            find_contact_speeds(flow, dt)
            touch = move_boundaries(flow, dt, fraction)
        if touch is not None:
            return touch
        # 5 interiors regridded, convexity proved; the new nodes along all sides are shared
        with flow.stopwatch("regrid"):
            flow.motion.regrid(fraction)
        update_states(flow, dt)
    except RegridFailure as failure:
        return failure
    return find_failure(flow)


@contextmanager
def agree_on_failures(motion: GridMotion, fraction: float) -> Iterator[None]:
    """What fails in this block of code on one rank fails on all; others wait in the regridding."""
    try:
        yield
    except RunFailure as failure:
        motion.regrid(fraction, failure)  # raises the first failure of all ranks
        raise


def fill_states_beyond(flow: Flow, dt: float) -> None:
    """Phase 2: what lies beyond all sides, and the cells along them at mid-time."""
    t = flow.clock.t
    with flow.stopwatch("sides"):
        # 2 states beyond all sides; slopes and mid-time states of the cells along them
        flow.exchange.divide_contacts()  # sliding contacts: both lines divided into pieces
        flow.source.start_step(t, dt)  # first half of gravity and heating
        for block in flow.blocks:
            phases.gather(block, t)  # cells along the sides, mirrored in walls
        for coupling in flow.couplings:
            coupling.fill_ghosts(t, dt)
        for block in flow.blocks:
            phases.predict(block, dt)


def find_contact_speeds(flow: Flow, dt: float) -> None:
    """Phase 3: contact states at the faces of moving lines, and so their velocities."""
    with flow.stopwatch("sides"):
        # 3 contact speeds of all sides that move with the flow, from traces at mid-time
        for coupling in flow.couplings:
            coupling.fill_speeds(flow.clock.t + 0.5 * dt, dt)


def move_boundaries(flow: Flow, dt: float, fraction: float) -> Touch | None:
    """Phase 4; the shorter step, if surfaces come to touch within this one."""
    # 4 nodes along the sides moved; surfaces that have come to touch laid on each other.
    # History: motion of the sides and regridding are one column
    with flow.stopwatch("regrid"):
        move_sides(flow.motion, StepTime(flow.clock.t, dt, fraction))
        shorter = flow.meetings.meet(dt, dt / fraction)
    return None if shorter is None else Touch(shorter)


def update_states(flow: Flow, dt: float) -> None:
    """Phase 6: fluxes through the moved faces, and the new states."""
    with flow.stopwatch("sides"):
        # 6 fluxes through the sides, from traces on the moved faces
        for block in flow.blocks:
            phases.trace(block, dt)  # with the fluxes of walls and open sides
        for coupling in flow.couplings:
            coupling.fill_fluxes(flow.clock.t + 0.5 * dt, dt)
    with flow.stopwatch("flow"):
        # then the inside: slopes, traces, swept volumes, fluxes, new states; small cells share
        flow.blocks.update(dt)
        if flow.blocks.solid_pieces:
            flow.blocks.relax(dt)
        flow.small_cells.redistribute_states(flow.clock.cfl / dt, dt)
        if flow.blocks.spalls:
            flow.blocks.open_voids(dt)


def move_sides(motion: GridMotion, step: StepTime) -> None:
    """Phase 4; a mesh that is given has its sides with all its other nodes."""
    if motion.mesh != "regrid":
        motion.follow_mesh(step)
        return
    for move, moved, _ in SIDE_PASSES:
        if getattr(motion.sides, moved):
            move(motion.sides, step)


def find_failure(flow: Flow) -> RunFailure | None:
    """Why the new state cannot stand, or None; else its rates are known then."""
    small_cells = flow.small_cells
    try:
        small_cells.scanned = flow.blocks.check_new_states(small_cells.scan)
    except RunFailure as failure:
        return failure
    if flow.motion.sides.stretching > 2.0 * MOST_STRETCHING:
        return RunFailure(
            "lines: neighbouring nodes of a moving line would come too far in one step",
            cause="line-torn",
        )
    return None


def accept_step(flow: Flow, dt: float, record: StepRecord) -> None:
    """Phase 7 of an accepted step: the new becomes the current state; totals and time."""
    # 7 the new grid and state become the current ones; second half of the sources; ledger, clock
    for block in flow.blocks:
        block.accept()
    flow.exchange.accept()
    flow.meetings.accept()
    flow.source.end_step(flow.clock.t, dt)
    if flow.source.function is not None:
        flow.ledger.add_source(flow.source.gained)
    flow.ledger.add_boundary(dt)
    flow.ledger.count_energy_of_voids(flow.voids.work, flow.voids.energy_left)
    rate = flow.small_cells.find_rate()
    record.last = flow.clock.tick(dt, record.dt_limit, rate, flow.motion.sides.stretching)
