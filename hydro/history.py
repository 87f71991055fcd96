"""The columns of a flow's history, in groups; a new group is one function and one line.

A group is a function that takes the flow after a step and returns numbers by column name, with the
same names at every step.  The groups of COLUMNS are in every history; those of other packages, of
files and of `shockgrid.register` are included if a deck names them in `output.columns`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from shockgrid.hydro.step import Flow
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.measure.quality import measure_worst
from shockgrid.regrid.plug_ins import PlugIns

TIMED_PARTS = ("sides", "regrid", "flow")

ColumnGroup = Callable[[Flow], dict[str, float | int]]


def compute_grid_quality(flow: Flow) -> dict[str, float | int]:
    """The worst cells of all blocks."""
    quality = flow.motion.quality or [measure_worst(block.nodes) for block in flow.blocks]
    sine, aspect, bad_cells, triangles = quality[0]
    for row in quality[1:]:
        sine = row[0] if row[0] < sine else sine
        aspect = row[1] if row[1] > aspect else aspect
        bad_cells = bad_cells + row[2]
        triangles = triangles + row[3]
    return {
        "least_scaled_jacobian": sine,
        "cells_not_convex": int(bad_cells),
        "cells_triangular": int(triangles),
        "worst_aspect": aspect,
    }


def count_regridding(flow: Flow) -> dict[str, float | int]:
    """Activity of the regridders in the step."""
    iterations = node_iterations = sub_moves = rescues = limited = reports = 0
    ratio = math.inf
    for row in flow.motion.counts:
        iterations += row[0]
        node_iterations += row[1]
        sub_moves += row[2]
        rescues += row[3]
        limited += row[4]
        reports += row[5]
        ratio = row[6] if row[6] < ratio else ratio
    return {
        "regrid_iterations": int(iterations),
        "regrid_node_iterations": int(node_iterations),
        "regrid_sub_moves": int(sub_moves),
        "regrid_rescues": int(rescues),
        "regrid_least_corner_ratio": ratio if reports else 1.0,
        "regrid_held_nodes": int(limited),
    }


def count_special_cells(flow: Flow) -> dict[str, float | int]:
    """Numbers of first-order traces, cells with voids, emptied cells, pulled pieces of contacts."""
    first_order = 0
    voided = 0
    emptied = 0
    broken = None  # by laws of spall, if there are any
    for block in flow.blocks:
        if block.stress is not None and block.stress.spall is not None:
            broken = (broken or 0) + block.stress.broken_cells
        sums = block.totals.sums
        first_order += int(sums.first_order)
        if block.kernels.is_first_order:  # all of its faces, each once
            first_order += 2 * block.ni * block.nj
        voided += int(sums.voided)
        emptied += int(sums.emptied)
    row: dict[str, float | int] = {
        "first_order_faces": first_order,
        "voided_cells": voided,
        "emptied_cells": emptied,
    }
    if broken is not None:
        row["broken_cells"] = broken
    if flow.exchange.contacts:
        row["pulled_pieces"] = sum(contact.pulled for contact in flow.exchange.contacts)
    return row


def measure_surfaces(flow: Flow) -> dict[str, float | int]:
    """Energy of the lines with surface tension, if there are any."""
    return {"surface_energy": flow.tension.compute_energy()} if flow.tension.lines else {}


def find_step_limit(flow: Flow) -> dict[str, float | int]:
    """The fastest cell: its block, its indices, and how much it alone shortens the next step."""
    fastest = flow.small_cells.fastest
    return {
        "shared_cells": flow.small_cells.redistributed_count,
        "fastest_block": fastest.block,
        "fastest_i": fastest.i,
        "fastest_j": fastest.j,
        "fastest_over_limit": fastest.rate / flow.clock.rate,
    }


COLUMNS: dict[str, ColumnGroup] = {
    "totals": lambda flow: flow.ledger.compute_row(),
    "grid-quality": compute_grid_quality,
    "regridding": count_regridding,
    "surfaces": measure_surfaces,
    "contacts": lambda flow: flow.meetings.compute_row() if flow.meetings.pairs else {},
    "special-cells": count_special_cells,
    "step-limit": find_step_limit,
    "seconds": lambda flow: flow.stopwatch.take(TIMED_PARTS),
}


def compute_columns(flow: Flow) -> dict[str, float | int]:
    """All columns of the flow after a step."""
    row: dict[str, float | int] = {}
    for compute in COLUMNS.values():
        row |= compute(flow)
    return row


INSTALLED = PlugIns("shockgrid.columns")
REGISTERED: dict[str, ColumnGroup] = {}  # in this process, by `shockgrid.register`


def compute_chosen_columns(evolution: Any, groups: Sequence[ColumnGroup]) -> dict[str, Any]:
    """The columns of chosen groups.

    Raises BadInput if the evolution is not a flow on blocks, or a group does not return a dict.
    """
    if not groups:
        return {}
    flow = getattr(evolution, "flow", None)
    if flow is None:
        raise BadInput(
            "deck: output.columns: groups of columns are for flows on moving blocks alone"
        )
    row: dict[str, Any] = {}
    for compute in groups:
        found = compute(flow)
        if not isinstance(found, dict):
            name = getattr(compute, "__name__", "a group")
            raise BadInput(
                f"deck: output.columns: {name} returned {type(found).__name__}; it must return a "
                "dict of numbers by column name"
            )
        row |= found
    return row
