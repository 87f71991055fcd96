"""Kernels of a moving line: nodes move with faces, short waves are damped, stretching measured."""

from __future__ import annotations

import numpy as np

from hydro.perimeter.rows import AREA_X, AREA_Y, SLIP, SURFACE_U, SURFACE_V
from regrid.jit import kernel


@kernel
def move_line(line, faces, surface, damping, dt, start, stop, out):
    """Nodes of a segment, but its two ends, moved with the contact velocities of its faces.

    Node velocity: the contact velocities of the two faces beside it, interpolated by distance;
    exact for a uniform flow through a curved line and for plane flow.  The trap: asking for the
    node that satisfies both normal speeds (the intersection of the moved faces) lets every kink
    of a stretching line grow, at an axis of symmetry into a spike.  damping: added velocities.
    line, damping, out: the segment's nodes (2, stop - start + 1).  Theory F6.2.
    """
    for k in range(start + 1, stop):
        length_a = (faces[AREA_X, k - 1] ** 2 + faces[AREA_Y, k - 1] ** 2) ** 0.5
        length_b = (faces[AREA_X, k] ** 2 + faces[AREA_Y, k] ** 2) ** 0.5
        weight_a = length_b / (length_a + length_b)
        weight_b = length_a / (length_a + length_b)
        node = k - start
        for q in range(2):
            speed = weight_a * surface[SURFACE_U + q, k - 1] + weight_b * surface[SURFACE_U + q, k]
            out[q, node] = line[q, node] + dt * (damping[q, node] + speed)


@kernel
def fill_line_damping(line, surface, start, strength, bend, most, out):
    """Velocities that damp the shortest waves of an unstable contact; out (2, n).

    A contact of no thickness is unstable at every wavelength, the shorter the faster: after a
    shock (Richtmyer and Meshkov) and where materials slip (Kelvin and Helmholtz).  Waves of a few
    nodes then grow out of rounding errors and shock noise, the more the finer the grid.  A layer
    as thick as a cell has no such waves; the line is given that layer's cut-off,

        w = -strength × V / spacing × (fourth difference, normal part) / 16,     theory F6.3

    with V = slip + speed of the contact relative to the line's mean: zero in a uniform flow, the
    same in every frame, and on a wave of 20 nodes a hundred times weaker than the growth.
    Where materials slip, longer waves still roll up into kinks that no cell beside the line can
    follow: the strength grows by 1 + (turn / bend)² with the turn of the line at the node [rad], so
    that what is bent sharper than `bend` a node is taken back; bend 0 leaves it.
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
        if bend > 0.0:
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


@kernel
def measure_stretching(line, moved):
    """Largest relative displacement of neighbouring nodes over their distance on a line."""
    most = 0.0
    for k in range(line.shape[1] - 1):
        length = ((line[0, k + 1] - line[0, k]) ** 2 + (line[1, k + 1] - line[1, k]) ** 2) ** 0.5
        dx = (moved[0, k + 1] - line[0, k + 1]) - (moved[0, k] - line[0, k])
        dy = (moved[1, k + 1] - line[1, k + 1]) - (moved[1, k] - line[1, k])
        ratio = (dx * dx + dy * dy) ** 0.5 / length
        most = ratio if ratio > most else most
    return most
