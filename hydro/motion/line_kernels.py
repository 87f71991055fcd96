"""Kernels of a line on a block's side: moved with faces, short waves damped, spread, written.

They read and write the block's nodes themselves: the line of a segment is that of its side
(a number, in the order of SIDES) from node `start` on.
"""

from __future__ import annotations

import numpy as np

from hydro.perimeter.rows import AREA_X, AREA_Y, SLIP, SURFACE_U, SURFACE_V
from regrid.curves import fill_redistributed
from regrid.jit import compiled_once, kernel


@compiled_once
def find_node(side, k, ni, nj):
    """Indices (i, j) of node k of a side, counted in the order of SIDES."""
    if side == 0:
        return 0, k
    if side == 1:
        return ni, k
    if side == 2:
        return k, 0
    return k, nj


@kernel
def spread_line(nodes, side, start, law):
    """Spread nodes start.. of a side by a law (n,) on the straight line between the two ends."""
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    count = law.shape[0]
    i, j = find_node(side, start, ni, nj)
    i_end, j_end = find_node(side, start + count - 1, ni, nj)
    for c in range(2):
        first = nodes[c, i, j]
        last = nodes[c, i_end, j_end]
        for k in range(1, count - 1):
            i_here, j_here = find_node(side, start + k, ni, nj)
            nodes[c, i_here, j_here] = first * (1.0 - law[k]) + last * law[k]


@kernel
def move_line(nodes, nodes_new, side, start, faces, surface, damping, dt, first, out):
    """Nodes of a segment moved with the contact velocities of its faces; returns the stretching.

    The ends are those of the new nodes.  Node velocity: the contact velocities of the two faces
    beside it, interpolated by distance; exact for a uniform flow through a curved line and for
    plane flow.  The trap: asking for the node that satisfies both normal speeds (the intersection
    of the moved faces) lets every kink of a stretching line grow, at an axis of symmetry into a
    spike.  nodes, nodes_new (2, ni + 1, nj + 1), of a `side` from its node `start` on; first: the
    perimeter's number of the first face; damping: added velocities against short waves.  damping,
    out: the segment's nodes (2, n).  Theory F6.2.
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    count = out.shape[1]
    for end in range(2):
        k = end * (count - 1)
        i, j = find_node(side, start + k, ni, nj)
        out[0, k] = nodes_new[0, i, j]
        out[1, k] = nodes_new[1, i, j]
    for node in range(1, count - 1):
        k = first + node
        i, j = find_node(side, start + node, ni, nj)
        a_x, a_y = faces[AREA_X, k - 1], faces[AREA_Y, k - 1]
        b_x, b_y = faces[AREA_X, k], faces[AREA_Y, k]
        length_a = (a_x * a_x + a_y * a_y) ** 0.5
        length_b = (b_x * b_x + b_y * b_y) ** 0.5
        weight_a = length_b / (length_a + length_b)
        weight_b = length_a / (length_a + length_b)
        for q in range(2):
            speed = weight_a * surface[SURFACE_U + q, k - 1] + weight_b * surface[SURFACE_U + q, k]
            out[q, node] = nodes[q, i, j] + dt * (damping[q, node] + speed)
    most = 0.0
    i, j = find_node(side, start, ni, nj)
    for k in range(count - 1):
        i_next, j_next = find_node(side, start + k + 1, ni, nj)
        step_x = nodes[0, i_next, j_next] - nodes[0, i, j]
        step_y = nodes[1, i_next, j_next] - nodes[1, i, j]
        length = (step_x * step_x + step_y * step_y) ** 0.5
        dx = (out[0, k + 1] - nodes[0, i_next, j_next]) - (out[0, k] - nodes[0, i, j])
        dy = (out[1, k + 1] - nodes[1, i_next, j_next]) - (out[1, k] - nodes[1, i, j])
        ratio = (dx * dx + dy * dy) ** 0.5 / length
        most = ratio if ratio > most else most
        i, j = i_next, j_next
    return most


@kernel
def shift_line(nodes, side, start, way_x, way_y, out):
    """The inner nodes (2, n) of a segment, moved by a way, into `out`; arguments: `move_line`."""
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    for k in range(1, out.shape[1] - 1):
        i, j = find_node(side, start + k, ni, nj)
        out[0, k] = nodes[0, i, j] + way_x
        out[1, k] = nodes[1, i, j] + way_y


@kernel
def settle_line(
    nodes, side, start, moved, law, keys, spline, relax, closed, wall_first, wall_last, work, out
):
    """Spread the moved nodes (2, n) by the law between the new ends and write them to `nodes`.

    Arguments from `law` on as in `fill_redistributed`, and what it returns; not spread where
    `relax` is 0.
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    count = moved.shape[1]
    for end in range(2):
        k = end * (count - 1)
        i, j = find_node(side, start + k, ni, nj)
        moved[0, k] = nodes[0, i, j]
        moved[1, k] = nodes[1, i, j]
    failed = -1
    if relax > 0.0:
        failed = fill_redistributed(
            moved, law, keys, spline, relax, closed, wall_first, wall_last, work, out
        )
    for k in range(count):
        i, j = find_node(side, start + k, ni, nj)
        nodes[0, i, j] = out[0, k] if relax > 0.0 else moved[0, k]
        nodes[1, i, j] = out[1, k] if relax > 0.0 else moved[1, k]
    return failed


@kernel
def fill_extended(nodes, side, start, wall_first, wall_last, out):
    """A line's nodes with two images (2, n + 4) beyond each end: mirrored in the walls there.

    A wall is given by its unit normal; (0, 0) is a free end, where they go through the end itself.
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    count = out.shape[1] - 4
    for k in range(count):
        i, j = find_node(side, start + k, ni, nj)
        out[0, k + 2] = nodes[0, i, j]
        out[1, k + 2] = nodes[1, i, j]
    for end in range(2):
        normal_x, normal_y = wall_first if end == 0 else wall_last
        inwards = 1 if end == 0 else -1
        at = 2 if end == 0 else count + 1
        for n in range(1, 3):
            away_x = out[0, at + n * inwards] - out[0, at]
            away_y = out[1, at + n * inwards] - out[1, at]
            if normal_x == 0.0 and normal_y == 0.0:
                out[0, at - n * inwards] = out[0, at] - away_x
                out[1, at - n * inwards] = out[1, at] - away_y
            else:
                across = normal_x * away_x + normal_y * away_y
                out[0, at - n * inwards] = out[0, at] + away_x - 2.0 * normal_x * across
                out[1, at - n * inwards] = out[1, at] + away_y - 2.0 * normal_y * across


@kernel
def fill_line_damping(line, surface, start, strength, bend, most, out):
    """Velocities that damp the shortest waves of a sliding contact; out (2, n).

        w = -strength × V / spacing × (fourth difference, normal part) / 16,     theory F6.7

    with V = slip + speed of the contact relative to the line's mean.  Where materials slip, waves
    of many nodes still roll up into kinks that no cell beside the line can follow: the strength
    grows by 1 + (turn / bend)² with the turn of the line at the node [rad], so that what is bent
    sharper than `bend` a node is taken back.
    line (2, n + 4): the nodes with two images beyond each end; most: largest rate [1/s].
    """
    count = out.shape[1]
    mean_x = 0.0
    mean_y = 0.0
    for k in range(start, start + count - 1):
        mean_x += surface[SURFACE_U, k]
        mean_y += surface[SURFACE_V, k]
    mean_x /= count - 1
    mean_y /= count - 1
    for k in range(count):
        m = k + 2
        tx = line[0, m + 1] - line[0, m - 1]
        ty = line[1, m + 1] - line[1, m - 1]
        square = tx * tx + ty * ty
        fourth_x = (
            (line[0, m + 2] + line[0, m - 2])
            - 4.0 * (line[0, m + 1] + line[0, m - 1])
            + 6.0 * line[0, m]
        )
        fourth_y = (
            (line[1, m + 2] + line[1, m - 2])
            - 4.0 * (line[1, m + 1] + line[1, m - 1])
            + 6.0 * line[1, m]
        )
        speed = 0.0
        for face in (max(start, start + k - 1), min(start + count - 2, start + k)):
            away_x = surface[SURFACE_U, face] - mean_x
            away_y = surface[SURFACE_V, face] - mean_y
            speed += 0.5 * (surface[SLIP, face] + (away_x * away_x + away_y * away_y) ** 0.5)
        spacing = 0.5 * square**0.5
        rate = strength * speed / (16.0 * spacing)
        ax = line[0, m] - line[0, m - 1]
        ay = line[1, m] - line[1, m - 1]
        bx = line[0, m + 1] - line[0, m]
        by = line[1, m + 1] - line[1, m]
        turn = np.arctan2(ax * by - ay * bx, ax * bx + ay * by) / bend
        rate *= 1.0 + turn * turn
        rate = rate if rate < most else most
        along = (fourth_x * ty - fourth_y * tx) / square
        out[0, k] = -rate * along * ty
        out[1, k] = rate * along * tx
