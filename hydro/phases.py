"""The phases of a step on one block: each calls a kernel with the block's arrays.

In the order in which a step needs them: cells along the sides, their predictions, traces on the
moved faces, the new state.  What lies beyond the sides comes from the couplings of `hydro.step`
between them.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.rim import AREA_CENTRE, NORMAL
from shockgrid.hydro.workers import LEAST_INSIDE
from shockgrid.regrid.measure.corners import compute_centres


def gather(block: Block, t: float = 0.0) -> None:
    """Compute faces at the old time, perimeter cell states, and ghosts beyond walls."""
    plan = block.plan
    kernels = block.kernels
    for number, wall in plan.pistons:
        plan.wall_speeds[number] = wall.velocity(t)
    if block.mixed is not None:
        block.mixed.gather(block)
        return
    kernels.sides.start_sides.entry(
        block.start, block.nodes, block.parameters, plan.inwards, plan.walls, plan.wall_speeds,
        kernels.scratch, block.rim.rows,
    )  # fmt: skip
    if block.transport.count:
        block.transport.gather(block)
    if block.stress is not None:
        block.stress.start(block)
    if block.body_acceleration is not None:
        _add_weight(block, block.body_acceleration)


def _add_weight(block: Block, acceleration: np.ndarray) -> None:
    """Hydrostatic ghosts: pressure mirrored about that of a layer at rest on the wall."""
    rim = block.rim
    normal = rim.rows[NORMAL]
    centres = block.gather_perimeter(compute_centres(block.nodes))
    across = (acceleration * normal).sum(axis=0) / (normal * normal).sum(axis=0)
    depth = ((rim.rows[AREA_CENTRE] - centres) * normal).sum(axis=0)
    for first, last, _ in block.plan.walls:
        rim.p_ghost[first:last] += (2.0 * rim.rho * across * depth)[first:last]


def predict(block: Block, dt: float) -> None:
    """From the ghosts: mid-time predictions, and traces at the moving faces half a step on."""
    if block.mixed is not None:
        block.mixed.predict(block, 0.5 * dt)
        return
    kernels = block.kernels
    if block.stress is not None:
        block.stress.predict(block, dt)
    kernels.sides.predict_sides.entry(
        _list_old(block), 0.5 * dt, block.parameters, block.plan.flowing_spans, kernels.scratch,
        block.rim.rows,
    )  # fmt: skip
    if block.stress is not None:
        block.stress.trace_moving(block)
    elif block.transport.count:
        block.transport.predict(block, 0.5 * dt)


def trace(block: Block, dt: float) -> None:
    """From the new nodes: mid-time faces, their traces, and fluxes that need nothing else."""
    if block.mixed is not None:
        block.mixed.trace(block, dt)
        return
    plan = block.plan
    block.kernels.sides.trace_sides.entry(
        block.nodes, block.nodes_new, 1.0 / dt, block.parameters, block.wave_law, plan.walls,
        plan.opened, block.rim.rows,
    )  # fmt: skip
    if block.transport.count:
        block.transport.trace(block)
    if block.stress is not None:
        block.stress.trace(block)


def update(block: Block, dt: float, threads: int = 1) -> None:
    """From the fluxes through the perimeter: the new state and its totals.

    In a cut block: the rows of this process only, without polygon cells.
    """
    if block.mixed is not None:
        block.mixed.update(block, dt)
        return
    kernels = block.kernels
    if len(block.rows) * block.nj < LEAST_INSIDE:
        threads = 1
    if threads > 1:
        kernels.use_threads(threads)
    block.totals.start_update()
    if block.stress is not None:
        block.stress.prepare(block)
    advance = kernels.flow.advance_threaded if threads > 1 else kernels.flow.advance
    advance.entry(
        _list_old(block), (*_list_new(block), *block.transport.masses), block.rim.rows, dt,
        block.parameters, kernels.scratch, block.tiles, block.totals.of_tiles,
    )  # fmt: skip
    if block.transport.count:
        block.transport.carry(block, dt)
    if block.is_follower and not block.is_cut:
        fill_polygons(block)


def measure_rates(block: Block) -> None:
    """Rates and totals of a state that no step has made: those after an update over no time."""
    update(block, dt=0.0)
    block.rates[...] = block.rates_new


def fill_polygons(block: Block) -> None:
    """Add the parts of polygon cells beyond their straight faces to the new state."""
    excess = block.excess_volume, block.excess_volume_new
    block.kernels.sides.fill_polygons(
        _list_old(block), _list_new(block), excess, block.parameters, block.totals.rest
    )


def relax(block: Block, dt: float) -> None:
    """Of a solid, with the new state known: its new stress."""
    assert block.stress is not None
    block.stress.relax(block, dt)


def open_voids(block: Block, dt: float) -> int:
    """Last of all, by the law of spall of a solid; returns how many cells are broken.

    What gives cells a pressure of their density and energy, such as polygons and redistribution,
    knows nothing of the law.
    """
    assert block.stress is not None
    return block.stress.spall_new_cells(block, dt)


def _list_old(block: Block) -> tuple[Any, ...]:
    """Kernel input at the start of the step: what cells hold (HELD_ARRAYS), then nodes.

    Of a solid, then the arrays of its stress.
    """
    if block.stress is not None:
        # one by one: kernels with threads take no tuple within a tuple
        return *block.list_starts(), block.nodes, *block.stress.arrays
    return *block.list_starts(), block.nodes


def _list_new(block: Block) -> tuple[np.ndarray, ...]:
    """Kernel output for known new nodes: the same arrays, then rates and crowding."""
    return *block.list_new(), block.nodes_new, block.rates_new, block.crowding
