"""One time step in seven phases, in the order of the numbers; the arithmetic is elsewhere.

Until phase 7 all results go into separate arrays, so that a step can be rejected at no cost.  Body
sources, too, apply their first half to a copy of the state.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from hydro.clock import MOST_STRETCHING, Clock, Stopwatch
from hydro.contacts.meetings import Meetings
from hydro.ledger import Ledger
from hydro.links import Exchange
from hydro.motion import sides as on_sides
from hydro.motion.grid_motion import GridMotion
from hydro.motion.sides import Sides, Span
from hydro.motion.tension import SurfaceTension
from hydro.perimeter.contacts import AT_CELLS, AT_FLUX, AT_TRACES
from hydro.ranks.blocks import Blocks
from hydro.small_cells import SmallCells
from hydro.sources import BodySource
from regrid.errors import RegridFailure, RunFailure

MOST_RETRIES = 12

# Phase 4, how the nodes along the sides of all blocks move: passes in their order, what each does,
# and why it stands there.  They are in `hydro.motion.sides`.
# Each is left out where the list of this name is empty.
SIDE_PASSES: tuple[tuple[Callable[[Sides, Span], None], str, str], ...] = (
    (on_sides.space_contact_points, "followers", "spacing around contact points, by old lengths"),
    (on_sides.turn_mirrors, "turning", "walls at line ends as they lie, where damping mirrors"),
    (on_sides.damp_short_waves, "damped", "additional velocities of lines and their ends"),
    (on_sides.move_key_nodes, "key_nodes", "ends of lines first, by all faces that meet there"),
    (on_sides.move_lines, "moving", "between their ends; along themselves if nothing cuts them"),
    (on_sides.slide_joints, "joints", "ends inside a contact, along its moved lines"),
    (on_sides.move_carried_seams, "carried_seams", "their ends go with contacts, which have moved"),
    (on_sides.lay_followers, "followers", "on their leaders' moved lines; cuts free lines"),
    (on_sides.spread_lines, "lines", "those that were cut, and all that only go with their ends"),
    (on_sides.give_lines, "links", "followers receive the leaders' lines, final but for corners"),
    (on_sides.hold_corners, "guards", "last, because respacing would reopen the held corners"),
)


@dataclass(frozen=True)
class Flow:
    """What a step works on; made once, by `hydro.simulation.Simulation`."""

    blocks: Blocks
    exchange: Exchange
    motion: GridMotion
    meetings: Meetings
    tension: SurfaceTension
    source: BodySource
    ledger: Ledger
    clock: Clock
    small_cells: SmallCells
    watch: Stopwatch


@dataclass
class StepRecord:
    """How a step went: what limited it, how often and why it was cut, is it the end?"""

    limit: str = ""
    retries: int = 0
    reason: RunFailure | None = None
    last: bool = False


def take_step(flow: Flow) -> StepRecord:
    """Advance all blocks by one step.

    Raises RunFailure if no step down to a few thousandths of the stable one is valid; the state is
    then untouched.
    """
    record = StepRecord()
    for block in flow.blocks:
        block.use_first_order(False)
    # 1 dt from the largest rate of all blocks; halved for as long as the step fails
    dt, record.limit = flow.clock.choose_dt()
    first_dt = dt
    while reason := try_step(flow, dt):
        if isinstance(reason, Touch):
            first_dt = dt = float(reason)
            record.limit = "touch"
            continue
        record.reason = reason
        record.retries += 1
        if record.retries > MOST_RETRIES:
            raise reason.tell(
                f"{reason}, t = {flow.clock.t:.6g} s (step {flow.clock.step}); dt was cut "
                f"{MOST_RETRIES} times to {dt:.3g} s without success",
                RunFailure,
            )
        dt = first_dt if lower_order(flow, reason) else 0.5 * dt
        record.limit = "retry"
    accept_step(flow, dt, record)
    return record


def lower_order(flow: Flow, reason: RunFailure) -> bool:
    """Let all gases take this step at first order, where one has got too cold; False if they do.

    A variation over a cell can take more internal energy out of it than it has, in however short
    a step, where gas expands towards a vacuum; constant cells cannot.
    """
    cause = "cold-gas"
    gases = [block for block in flow.blocks if block.eos.failure_cause == cause]
    if reason.cause != cause or all(block.is_first_order for block in gases):
        return False
    for block in gases:
        block.use_first_order(True)
    return True


class Touch(float):
    """The shorter step [s] that ends where surfaces come to touch."""


def try_step(flow: Flow, dt: float) -> RunFailure | Touch | None:
    """Phases 2 to 6, into the new nodes and states; why the step does not stand, or None."""
    blocks = flow.blocks
    exchange = flow.exchange
    motion = flow.motion
    watch = flow.watch
    meetings = flow.meetings
    tension = flow.tension
    # is there any of them?
    touches = bool(meetings.pairs)
    pulls = bool(tension.lines)
    # agreed: do all ranks hear of what fails?
    sides = watch("sides")
    agreed = False
    t = flow.clock.t
    middle = flow.clock.t + 0.5 * dt
    flow.small_cells.set_time(t)
    fraction = flow.clock.compute_fraction(dt)  # of the stable step
    try:
        with sides:
            # 2 states beyond all sides; slopes and mid-time states of the cells along them
            exchange.cut_contacts()  # sliding contacts: both lines cut into pieces
            flow.source.start_step(t, dt)  # first half of gravity and heating
            for block in blocks:
                block.gather(t)  # cells along the sides, mirrored in walls
            if pulls:
                tension.fill_jumps(new=False)  # of the pressure, by surface tension
            exchange.solve(AT_CELLS, dt)  # ghosts beyond links and sliding contacts
            for block in blocks:
                block.fill_ghosts(t)  # beyond open sides and free surfaces
            if touches:
                meetings.fill_ghosts(t)  # beyond facets of surfaces that touch
            for block in blocks:
                block.predict(dt)
            # 3 contact speeds of all sides that move with the flow, from traces at mid-time
            exchange.solve(AT_TRACES, dt)
            for block in blocks:
                block.fill_speeds(middle)  # free surfaces; states beyond inflow sides
            if touches:
                meetings.fill_speeds(middle)
        with watch("regrid"):
            # 4 nodes along the sides moved; surfaces that have come to touch laid on each other
            move_sides(motion, Span(t, dt, fraction))
            if touches and (shorter := meetings.meet(dt, dt / fraction)):
                return Touch(shorter)
            # 5 interiors regridded, convexity proved; the new nodes along all sides are shared
            agreed = True
            motion.regrid(fraction)
        with sides:
            # 6 fluxes through the sides, from traces on the moved faces
            for block in blocks:
                block.trace(dt)  # with the fluxes of walls and open sides
            if pulls:
                tension.fill_jumps(new=True)
            for block in blocks:
                block.fill_flux(middle)  # of free surfaces
            exchange.solve(AT_FLUX, dt)  # of links and sliding contacts
            if touches:
                meetings.fill_flux(middle, dt)  # of facets
            if pulls:
                tension.add_rest()  # what of surface tension is no jump of the pressure
        with watch("flow"):
            # then the inside: slopes, traces, swept volumes, fluxes, new states; small cells share
            blocks.update(dt)
            flow.small_cells.share_states(flow.clock.cfl / dt, dt)
    except RunFailure as failure:
        reason = failure if agreed else agree_on(flow, fraction, failure)
        if not isinstance(reason, RegridFailure):
            raise reason from None
        return reason
    return find_failure(flow)


def move_sides(motion: GridMotion, span: Span) -> None:
    """Phase 4; a mesh that is given has its sides with all its other nodes."""
    if motion.mesh != "regrid":
        motion.follow_mesh(span)
        return
    for move, moved, _ in SIDE_PASSES:
        if getattr(motion, moved):
            move(motion, span)


def agree_on(flow: Flow, fraction: float, failure: RunFailure) -> RunFailure:
    """Tell the other ranks of a failure before the regridding; the one that counts for all."""
    try:
        flow.motion.regrid(fraction, failure)
    except RunFailure as first:
        return first
    return failure


def find_failure(flow: Flow) -> RunFailure | None:
    """Why the new state cannot stand, or None; else its rates are known then."""
    small_cells = flow.small_cells
    try:
        small_cells.scanned = flow.blocks.check_new_states(small_cells.scan)
    except RunFailure as failure:
        return failure
    if flow.motion.stretching > 2.0 * MOST_STRETCHING:
        return RunFailure(
            "lines: neighbouring nodes of a moving line would come too far in one step",
            cause="line-torn",
        )
    return None


def accept_step(flow: Flow, dt: float, record: StepRecord) -> None:
    """Phase 7 of an accepted step."""
    # 7 the new grid and state become the current ones; second half of the sources; ledger, clock
    for block in flow.blocks:
        block.accept()
    flow.exchange.accept()
    if flow.meetings.pairs:
        flow.meetings.accept()
    flow.source.end_step(flow.clock.t, dt)
    if flow.source.law is not None:
        flow.ledger.add_source(flow.source.gained)
    flow.ledger.add_boundary(dt)
    rate = flow.small_cells.find_rate()
    record.last = flow.clock.tick(dt, record.limit, rate, flow.motion.stretching)
