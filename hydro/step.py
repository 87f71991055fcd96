"""One time step, in the order of its phases; the arithmetic is elsewhere.

The state is touched only at the very end: until then a step can be rejected.
"""

from __future__ import annotations

from hydro.block import Block
from hydro.links.exchange import Exchange
from hydro.motion.grid_motion import GridMotion
from hydro.stopwatch import Stopwatch


def make_step(
    blocks: list[Block],
    exchange: Exchange,
    motion: GridMotion,
    t: float,
    dt: float,
    pace: float,
    threads: int,
    watch: Stopwatch,
) -> None:
    """Advance all blocks from t by dt into their `nodes_new` and `state_new`.

    `pace` is dt over the stable step.

    Raises RegridFailure when no valid grid is found; the old state is then untouched.
    """
    # 2 reconstruct and predict along the perimeters
    with watch("sides"):
        for block in blocks:
            block.gather()
        exchange.start()
        exchange.swap("cells")
        exchange.solve("cells")
        for block in blocks:
            for segment in block.segments:
                segment.fill_ghosts(t)
            block.predict(dt)
        exchange.swap("traces")
        # 3 sides: contact states and speeds
        exchange.solve("traces")
        for block in blocks:
            for segment in block.segments:
                segment.fill_speeds(t + 0.5 * dt)
    # 4 key nodes and lines moved, redistributed; 5 interior regridded, convexity proved
    with watch("regrid"):
        motion.move(t, dt, pace)
    # 6 fluxes through the perimeters at mid-time, then swept volumes, fluxes and update inside
    with watch("sides"):
        for block in blocks:
            block.trace(dt)
        exchange.swap("traces")
        for block in blocks:
            for segment in block.segments:
                segment.fill_flux(t + 0.5 * dt)
        exchange.fill_flux(dt)
    with watch("flow"):
        for block in blocks:
            block.update(dt, threads)
