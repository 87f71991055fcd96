"""Sums over the cells of a block: value, gradient and Hessian of the functional (theory R14).

The lines' weights `way_i` (n2+1, n3+1), `way_j` (n1+1, n3+1), `way_k` (n1+1, n2+1) are those of an
edge in ONE of its four cells.  Edges in a face have fewer cells, which touches nodes of the
boundary alone; their residual is not used.

The traps: a row of cells adds to four rows of nodes, so that rows are done in one fixed order; and
`strength` is frozen in a step, so that a search along it compares the same functional.
"""

from __future__ import annotations

import math

from regrid.hexahedra.corner_rows import (
    BLOCKS,
    EDGE,
    FLUX,
    INVERSE,
    LEAST,
    OUT,
    SPAN,
    SQUARE,
    STRAIGHT,
    SUM,
    SYMMETRIC,
    TURN,
    VALUE,
    VECTOR,
    WEIGHT,
    fill_corner_blocks,
    fill_corner_product,
    fill_corner_values,
    fill_edge_weights,
    fill_edges,
    fill_triple_products,
    find_corner_rows,
)
from regrid.jit import kernel

SHARP = 0.3  # corner sine below which the barrier is strengthened
ENERGY, GRADIENT, MATRIX = 0, 1, 2


@kernel(allocates=False)
def fill_strength(nodes, inverse_i, inverse_j, inverse_k, epsilon, most, strength, Z):
    """Weight e of the barrier in every cell (n1, n2, n3) by its least corner sine (R14.3)."""
    n1, n2, n3 = strength.shape
    for i in range(n1):
        for j in range(n2):
            fill_edges(nodes, inverse_i, inverse_j, inverse_k, i, j, EDGE, Z)
            for edge in range(8):
                row, square = EDGE + edge * VECTOR, SQUARE + edge * SPAN
                for k in range(n3 + 1 if edge < 4 else n3):
                    x, y, z = Z[row + k], Z[row + SPAN + k], Z[row + 2 * SPAN + k]
                    Z[square + k] = x * x + y * y + z * z
            for k in range(n3):
                Z[LEAST + k] = 1.0
            for corner in range(8):
                u, v, w, c = find_corner_rows(corner)
                fill_triple_products(
                    Z, EDGE + u * VECTOR + c, EDGE + v * VECTOR + c, EDGE + w * VECTOR, n3
                )
                uu, vv, ww = SQUARE + u * SPAN + c, SQUARE + v * SPAN + c, SQUARE + w * SPAN
                for k in range(n3):
                    det = Z[VALUE + k]
                    sine2 = det * abs(det) / (Z[uu + k] * Z[vv + k] * Z[ww + k])
                    Z[LEAST + k] = min(Z[LEAST + k], sine2)
            out = strength[i, j]
            for k in range(n3):
                sine = math.sqrt(max(Z[LEAST + k], 1e-300))
                out[k] = epsilon * min(most, max(1.0, SHARP / sine))


@kernel(allocates=False)
def add_rows(Z, source, weight, target, n):
    """Add a row, times a row of weights, to another one."""
    for k in range(n):
        Z[target + k] += Z[source + k] * Z[weight + k]


@kernel(allocates=False)
def clear_rows(Z, first, count):
    """Zeros into `count` numbers of the scratch."""
    for k in range(first, first + count):
        Z[k] = 0.0


@kernel(allocates=False)
def add_to_nodes(Z, edges, i, j, n, out):
    """The forces along the eight rows of edges, with the straight lines', to four rows of nodes."""
    for edge in range(8):
        inverse, straight = INVERSE + edge * SPAN, STRAIGHT + edge * SPAN
        for component in range(3):
            row = FLUX + edge * VECTOR + component * SPAN
            vector = edges + edge * VECTOR + component * SPAN
            for k in range(n + 1 if edge < 4 else n):
                Z[row + k] = Z[row + k] * Z[inverse + k] + Z[straight + k] * Z[vector + k]
    for a in range(2):
        for b in range(2):
            sign_i, sign_j = 2.0 * a - 1.0, 2.0 * b - 1.0
            for component in range(3):
                along_i = FLUX + b * VECTOR + component * SPAN
                along_j = FLUX + (2 + a) * VECTOR + component * SPAN
                along_k = FLUX + (4 + 2 * a + b) * VECTOR + component * SPAN
                row = out[component, i + a, j + b]
                for k in range(n + 1):
                    row[k] += sign_i * Z[along_i + k] + sign_j * Z[along_j + k]
                for k in range(1, n):
                    row[k] += Z[along_k + k - 1] - Z[along_k + k]


@kernel(allocates=False)
def add_blocks_to_nodes(Z, i, j, n, own, ahead):
    """The blocks of the eight rows of edges to four rows of nodes, and of those along i, `ahead`."""
    for edge in range(8):
        inverse, straight = INVERSE + edge * SPAN, STRAIGHT + edge * SPAN
        for entry in range(6):
            row = BLOCKS + edge * SYMMETRIC + entry * SPAN
            unit = 1.0 if entry == 0 or entry == 3 or entry == 5 else 0.0
            for k in range(n + 1 if edge < 4 else n):
                g = Z[inverse + k]
                Z[row + k] = g * (Z[row + k] * g + unit * Z[straight + k])
    for entry in range(6):
        for b in range(2):
            along_i = BLOCKS + b * SYMMETRIC + entry * SPAN
            row = ahead[entry, i, j + b]
            for k in range(n + 1):
                row[k] += Z[along_i + k]
            for a in range(2):
                along_j = BLOCKS + (2 + a) * SYMMETRIC + entry * SPAN
                along_k = BLOCKS + (4 + 2 * a + b) * SYMMETRIC + entry * SPAN
                row = own[entry, i + a, j + b]
                for k in range(n + 1):
                    row[k] += Z[along_i + k] + Z[along_j + k]
                for k in range(1, n):
                    row[k] += Z[along_k + k - 1] + Z[along_k + k]


@kernel(allocates=False)
def assemble(
    nodes, inverse_i, inverse_j, inverse_k, way_i, way_j, way_k, strength, scale, area_weight, e2,
    work, gradient, own, ahead, planes, Z,
):  # fmt: skip
    """Value of J, and by `work` its gradient (3, nodes) and the line solve's blocks (6, nodes).

    `planes` (n1) takes the part of each plane of cells, summed over i by the caller's `sum()`.
    """
    n1, n2, n = strength.shape
    for i in range(n1):
        total = 0.0
        for j in range(n2):
            fill_edges(nodes, inverse_i, inverse_j, inverse_k, i, j, EDGE, Z)
            fill_edge_weights(
                inverse_i, inverse_j, inverse_k, way_i, way_j, way_k, i, j, n, Z
            )  # fmt: skip
            cells = strength[i, j]
            for k in range(n):
                Z[WEIGHT + k] = 0.125 * scale * cells[k]
                Z[SUM + k] = 0.0
            if work >= GRADIENT:
                clear_rows(Z, FLUX, 24 * SPAN)
            if work >= MATRIX:
                clear_rows(Z, BLOCKS, 48 * SPAN)
            for corner in range(8):
                u, v, w, c = find_corner_rows(corner)
                one, two = EDGE + u * VECTOR + c, EDGE + v * VECTOR + c
                three = EDGE + w * VECTOR
                fill_corner_values(Z, one, two, three, n, area_weight, e2)
                add_rows(Z, VALUE, WEIGHT, SUM, n)
                if work >= GRADIENT:
                    for component in range(3):
                        at = FLUX + component * SPAN
                        source = OUT + component * SPAN
                        add_rows(Z, source, WEIGHT, at + u * VECTOR + c, n)
                        add_rows(Z, source + VECTOR, WEIGHT, at + v * VECTOR + c, n)
                        add_rows(Z, source + 2 * VECTOR, WEIGHT, at + w * VECTOR, n)
                if work >= MATRIX:
                    fill_corner_blocks(Z, one, two, three, OUT, n, area_weight, e2)
                    for entry in range(6):
                        at = BLOCKS + u * SYMMETRIC + c + entry * SPAN
                        add_rows(Z, OUT + entry * SPAN, WEIGHT, at, n)
                    fill_corner_blocks(Z, two, three, one, OUT, n, area_weight, e2)
                    for entry in range(6):
                        at = BLOCKS + v * SYMMETRIC + c + entry * SPAN
                        add_rows(Z, OUT + entry * SPAN, WEIGHT, at, n)
                    fill_corner_blocks(Z, three, one, two, OUT, n, area_weight, e2)
                    for entry in range(6):
                        at = BLOCKS + w * SYMMETRIC + entry * SPAN
                        add_rows(Z, OUT + entry * SPAN, WEIGHT, at, n)
            for k in range(n):
                total += Z[SUM + k]
            if work == ENERGY:
                total += sum_straight(Z, n)
            if work >= GRADIENT:
                add_to_nodes(Z, EDGE, i, j, n, gradient)
            if work >= MATRIX:
                add_blocks_to_nodes(Z, i, j, n, own, ahead)
        planes[i] = total


@kernel(allocates=False)
def sum_straight(Z, n):
    """The straight lines' part of J in a row of cells: half of weight over length times length²."""
    total = 0.0
    for edge in range(8):
        row = EDGE + edge * VECTOR
        inverse, straight = INVERSE + edge * SPAN, STRAIGHT + edge * SPAN
        for k in range(n + 1 if edge < 4 else n):
            x, y, z = Z[row + k], Z[row + SPAN + k], Z[row + 2 * SPAN + k]
            total += 0.5 * Z[straight + k] / Z[inverse + k] * (x * x + y * y + z * z)
    return total


@kernel(allocates=False)
def fill_product(
    nodes, direction, inverse_i, inverse_j, inverse_k, way_i, way_j, way_k, strength, scale,
    area_weight, e2, out, Z,
):  # fmt: skip
    """`out` = Hessian on `nodes` times `direction`, both (3, nodes); of the boundary, nothing."""
    n1, n2, n = strength.shape
    for component in range(3):
        for i in range(n1 + 1):
            for j in range(n2 + 1):
                row = out[component, i, j]
                for k in range(n + 1):
                    row[k] = 0.0
    for i in range(n1):
        for j in range(n2):
            fill_edges(nodes, inverse_i, inverse_j, inverse_k, i, j, EDGE, Z)
            fill_edges(direction, inverse_i, inverse_j, inverse_k, i, j, TURN, Z)
            fill_edge_weights(
                inverse_i, inverse_j, inverse_k, way_i, way_j, way_k, i, j, n, Z
            )  # fmt: skip
            cells = strength[i, j]
            for k in range(n):
                Z[WEIGHT + k] = 0.125 * scale * cells[k]
            clear_rows(Z, FLUX, 24 * SPAN)
            for corner in range(8):
                u, v, w, c = find_corner_rows(corner)
                one, two = EDGE + u * VECTOR + c, EDGE + v * VECTOR + c
                fill_corner_product(Z, one, two, EDGE + w * VECTOR, n, area_weight, e2)
                for component in range(3):
                    at = FLUX + component * SPAN
                    source = OUT + component * SPAN
                    add_rows(Z, source, WEIGHT, at + u * VECTOR + c, n)
                    add_rows(Z, source + VECTOR, WEIGHT, at + v * VECTOR + c, n)
                    add_rows(Z, source + 2 * VECTOR, WEIGHT, at + w * VECTOR, n)
            add_to_nodes(Z, TURN, i, j, n, out)


@kernel(allocates=False)
def compare_corners(nodes, old, inverse_i, inverse_j, inverse_k, shape, Z):
    """Least ratio of a corner's volume to that in `old`, and the least scaled volume.

    A ratio of a corner that is not positive in `old` is that of its scaled volume itself.
    """
    n1, n2, n = shape
    ratio, least = math.inf, math.inf
    for i in range(n1):
        for j in range(n2):
            fill_edges(nodes, inverse_i, inverse_j, inverse_k, i, j, EDGE, Z)
            fill_edges(old, inverse_i, inverse_j, inverse_k, i, j, TURN, Z)
            for k in range(n):
                Z[LEAST + k] = math.inf
                Z[SUM + k] = math.inf
            for corner in range(8):
                u, v, w, c = find_corner_rows(corner)
                fill_triple_products(
                    Z, TURN + u * VECTOR + c, TURN + v * VECTOR + c, TURN + w * VECTOR, n
                )
                for k in range(n):
                    Z[OUT + k] = Z[VALUE + k]
                fill_triple_products(
                    Z, EDGE + u * VECTOR + c, EDGE + v * VECTOR + c, EDGE + w * VECTOR, n
                )
                for k in range(n):
                    was = Z[OUT + k]
                    part = Z[VALUE + k] / (was if was > 0.0 else 1.0)
                    Z[LEAST + k] = min(Z[LEAST + k], part)
                    Z[SUM + k] = min(Z[SUM + k], Z[VALUE + k])
            for k in range(n):
                # not min(): a volume that is no number must not be lost
                if not Z[LEAST + k] >= ratio:
                    ratio = Z[LEAST + k]
                if not Z[SUM + k] >= least:
                    least = Z[SUM + k]
    return ratio, least


@kernel(allocates=False)
def halve_steps(nodes, old, inverse_i, inverse_j, inverse_k, floor, part, Z):
    """Halve `part` (nodes) where a corner keeps less than `floor` of its volume; how many corners.

    A corner below its floor in `old` already (`floor` of nothing) is not looked at.
    """
    n1, n2, n = part.shape[0] - 1, part.shape[1] - 1, part.shape[2] - 1
    short = 0
    for i in range(n1):
        for j in range(n2):
            fill_edges(nodes, inverse_i, inverse_j, inverse_k, i, j, EDGE, Z)
            fill_edges(old, inverse_i, inverse_j, inverse_k, i, j, TURN, Z)
            for corner in range(8):
                u, v, w, c = find_corner_rows(corner)
                a, b = corner & 1, (corner >> 1) & 1
                fill_triple_products(
                    Z, TURN + u * VECTOR + c, TURN + v * VECTOR + c, TURN + w * VECTOR, n
                )
                for k in range(n):
                    Z[OUT + k] = Z[VALUE + k]
                fill_triple_products(
                    Z, EDGE + u * VECTOR + c, EDGE + v * VECTOR + c, EDGE + w * VECTOR, n
                )
                for k in range(n):
                    if not Z[VALUE + k] >= floor * Z[OUT + k]:
                        short += 1
                        for p, q, r in (
                            (i + a, j + b, k + c),
                            (i + 1 - a, j + b, k + c),
                            (i + a, j + 1 - b, k + c),
                            (i + a, j + b, k + 1 - c),
                        ):
                            part[p, q, r] *= 0.5
    return short
