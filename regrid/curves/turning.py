"""Spacing of a line's nodes by its length and by how much it turns (theory R9.2).

An even spacing makes a polygon of a roll.  Here every segment may turn by TURN: a line's nodes go
where it bends, the rest by its first spacing, of which at least LEAST_EVEN stays.
"""

from __future__ import annotations

import numpy as np

from regrid.jit import kernel

TURN = np.radians(10.0)  # that one segment takes where nodes suffice
LEAST_EVEN = 0.3  # least part of the nodes that keep the first spacing
SMOOTHINGS = 3  # of the turning, over neighbouring segments


@kernel
def fill_turning(line, closed, wall_first, wall_last, wanted):
    """How many segments every segment's turning asks for: wanted (n - 1,); line, ends as below."""
    count = line.shape[1]
    edges = count - 1
    turn = np.empty(count)
    for k in range(count):
        before, after = max(k - 1, 0), min(k, edges - 1)
        if closed and (k == 0 or k == edges):
            before, after = edges - 1, 0
        ax, ay = line[0, before + 1] - line[0, before], line[1, before + 1] - line[1, before]
        bx, by = line[0, after + 1] - line[0, after], line[1, after + 1] - line[1, after]
        if before == after:  # an end: its mirror image's segment, along and across the normal
            nx, ny = wall_first if k == 0 else wall_last
            along, across = abs(nx * ax + ny * ay), abs(nx * ay - ny * ax)
            turn[k] = 2.0 * np.arctan2(across, along)
            if nx == 0.0 and ny == 0.0:
                turn[k] = 0.0
        else:
            turn[k] = abs(np.arctan2(ax * by - ay * bx, ax * bx + ay * by))
    for k in range(edges):
        wanted[k] = 0.5 * (turn[k] + turn[k + 1]) / TURN
    for _ in range(SMOOTHINGS):
        start, last = wanted[0], wanted[edges - 1]
        before = last if closed else start
        for k in range(edges):
            after = wanted[k + 1] if k + 1 < edges else (start if closed else last)
            here = wanted[k]
            wanted[k] = 0.5 * here + 0.25 * (before + after)
            before = here


@kernel
def fill_turning_law(line, first, turning, closed, wall_first, wall_last, shortest, law):
    """Spacing law (n,) of a line (2, n): places by length from 0 to 1.

    `first` (n,) is the law where the line bends no more than it did at first, when it had
    `turning` (n - 1,), see `fill_turning`: a line that only moves along keeps its nodes, so that a
    uniform flow along a bent line stays uniform.  `shortest` [m]: turning asks for no shorter
    segments.  The line is closed (its last node is the first or its periodic image), or ends on
    walls, given by their unit normals, at its own mirror image; (0, 0) is a free end.
    """
    count = line.shape[1]
    edges = count - 1
    arc, wanted = np.empty(count), np.empty(edges)
    arc[0] = 0.0
    for k in range(edges):
        step_x, step_y = line[0, k + 1] - line[0, k], line[1, k + 1] - line[1, k]
        arc[k + 1] = arc[k] + (step_x * step_x + step_y * step_y) ** 0.5
    fill_turning(line, closed, wall_first, wall_last, wanted)
    for k in range(edges):
        wanted[k] = max(wanted[k] - turning[k], 0.0)
    total = 0.0
    for k in range(edges):
        wanted[k] = min(wanted[k], (arc[k + 1] - arc[k]) / shortest)
        total += wanted[k]
    even = max(1.0 - total / edges, LEAST_EVEN)
    scale = edges / (even * edges + total)
    # the number of segments up to node k, and the places where it is whole
    law[0], law[edges] = 0.0, 1.0
    done, following, place = 0.0, 1, 0
    before = 0.0
    for k in range(edges):
        reached = arc[k + 1] / arc[edges]
        while place < edges - 1 and first[place + 1] < reached:
            place += 1
        evenly = place + (reached - first[place]) / (first[place + 1] - first[place])
        done += wanted[k]
        after = scale * (even * evenly + done)
        while following < edges and following <= after:
            part = (following - before) / (after - before)
            law[following] = (arc[k] + part * (arc[k + 1] - arc[k])) / arc[edges]
            following += 1
        before = after
    for k in range(following, edges):  # round-off at the end
        law[k] = 1.0 - (edges - k) * (1.0 - law[following - 1]) / (edges - following + 1)
