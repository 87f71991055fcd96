"""Smoothing of contacts: velocities of their nodes by which the shortest waves decay.

Contacts between linked blocks have a thickness (theory F6.3): waves shorter than its cut-off decay,
longer ones grow.  Sliding contacts lose their waves of a few nodes only (theory F6.7).

A contact of no thickness is unstable at every wavelength, the shorter the faster: after a shock
(Richtmyer and Meshkov) and where materials slip (Kelvin and Helmholtz).  Waves of a few nodes then
grow out of round-off and shock noise, the more the finer the grid.  A linked contact is given the
cut-off of a layer of the thickness delta,

    normal velocity = -V delta^3 d/ds (d curvature / ds),

V the mean slip plus speed of the line's faces beside their mean: a wave of number k decays at the
rate V delta^3 k^4.  The solve along the line is implicit, so that delta may be many nodes long; it
moves as much area to one side as to the other and leaves straight lines and circles alone.
"""

from __future__ import annotations

import numpy as np

from shockgrid.hydro.motion.line import Line
from shockgrid.hydro.rim import SLIP, U_STAR, V_STAR
from shockgrid.regrid.curves import FREE_END
from shockgrid.regrid.jit import compiled_once, kernel
from shockgrid.regrid.sides import find_node

THICK_CELLS = 0.75  # default thickness of a contact, in its initial cells
SHORTEST_TURNED_SEGMENT = 0.25  # segment required by turning, in thicknesses of its contact
# of sliding lines: strength, and turn [rad]; see `fill_sliding_damping`
SLIDING_DAMPING = 4.0
SURFACE_DAMPING = 12.0  # strength of surfaces of bodies that have met; see `fill_surface_damping`
SLIDING_BEND_ANGLE = 0.35
MOST_DAMPING = 0.03  # part of a fourth difference that sliding lines lose in a step: stable
# least sine of half the angle between two segments: where a line folds back on itself
FOLDED_LINE_SINE = 1e-3
HALF_BAND = 4  # of a closed line's matrix, its nodes numbered from both sides of the first one
SETTLED_PASS_CHANGE = 1e-15  # change of a pass over the largest way
MOST_PASSES = 40  # that take the square of the displacement out of the area; 3 or 4 do


@compiled_once
def find_band_place(k, count, closed):
    """Place of unknown k in the order of elimination: along an open line, from node 0 both ways
    around a closed one."""
    if not closed:
        return k
    return 2 * k - 1 if 0 < k <= count // 2 else 2 * ((count - k) % count)


@compiled_once
def solve_along(main, next_one, next_two, right, closed, backwards, band, out):
    """Solve the symmetric system with these diagonals (n,), from one end or the other.

    next_one, next_two: the couplings of k with k + 1 and k + 2, round a closed line.  band
    (n, HALF_BAND + 2) is scratch: L D L^T row by row.
    """
    count = main.shape[0]
    band[:, :] = 0.0
    # the diagonals and the right side, in the order of elimination
    for k in range(count):
        place = (count - k) % count if closed else count - 1 - k
        row = find_band_place(place if backwards else k, count, closed)
        band[row, 0] = main[k]
        band[row, HALF_BAND + 1] = right[k]
    # the couplings, each into the later of its two rows
    for k in range(count):
        for step in range(1, 3):
            other_place = k + step
            if other_place >= count:
                if not closed:
                    continue
                other_place -= count
            value = next_one[k] if step == 1 else next_two[k]
            own_place = k
            if backwards:
                own_place = (count - k) % count if closed else count - 1 - k
                other_place = (count - other_place) % count if closed else count - 1 - other_place
            row = find_band_place(own_place, count, closed)
            column = find_band_place(other_place, count, closed)
            band[max(row, column), abs(row - column)] += value
    # factors L and D, and the right side through L
    for row in range(count):
        low = max(0, row - HALF_BAND)
        for column in range(low, row):
            value = band[row, row - column]
            for m in range(max(low, column - HALF_BAND), column):
                value -= band[row, row - m] * band[m, 0] * band[column, column - m]
            band[row, row - column] = value / band[column, 0]
        for column in range(low, row):
            factor = band[row, row - column]
            band[row, 0] -= factor * factor * band[column, 0]
            band[row, HALF_BAND + 1] -= factor * band[column, HALF_BAND + 1]
    # back through L^T
    for row in range(count - 1, -1, -1):
        value = band[row, HALF_BAND + 1] / band[row, 0]
        for later in range(row + 1, min(count, row + HALF_BAND + 1)):
            value -= band[later, later - row] * band[later, HALF_BAND + 1]
        band[row, HALF_BAND + 1] = value
    # the solution, in the line's order
    for k in range(count):
        place = (count - k) % count if closed else count - 1 - k
        row = find_band_place(place if backwards else k, count, closed)
        out[k] = band[row, HALF_BAND + 1]


@compiled_once
def measure_lengths(nodes):
    """Lengths (n,) of the segments between nodes (2, n + 1)."""
    lengths = np.empty(nodes.shape[1] - 1)
    for k in range(lengths.shape[0]):
        step_x, step_y = nodes[0, k + 1] - nodes[0, k], nodes[1, k + 1] - nodes[1, k]
        lengths[k] = (step_x * step_x + step_y * step_y) ** 0.5
    return lengths


@compiled_once
def measure_nodes(nodes, lengths, closed, wall_first, wall_last):
    """Half spans m, 1/m (0 at held nodes), curvatures and normals (2, n) of a line's nodes.

    See `fill_thickness_displacement`.
    """
    edges = lengths.shape[0]
    count = edges if closed else edges + 1
    half_span = np.empty(count)
    inverse = np.empty(count)
    curvature = np.empty(count)
    normal = np.empty((2, count))
    for k in range(count):
        end = not closed and (k == 0 or k == edges)
        after = k if k < edges else edges - 1
        before = k - 1 if k > 0 else (edges - 1 if closed else 0)
        ax, ay = nodes[0, before + 1] - nodes[0, before], nodes[1, before + 1] - nodes[1, before]
        bx, by = nodes[0, after + 1] - nodes[0, after], nodes[1, after + 1] - nodes[1, after]
        end_weight = 1.0
        if end:
            nx, ny = wall_first if k == 0 else wall_last
            end_weight = 0.5 if nx != 0.0 or ny != 0.0 else 0.0
            if k == 0:  # the mirror image's segment, walked the same way
                across = 2.0 * (nx * bx + ny * by)
                ax, ay = across * nx - bx, across * ny - by
            else:
                across = 2.0 * (nx * ax + ny * ay)
                bx, by = across * nx - ax, across * ny - ay
        tx, ty = 0.5 * (ax + bx), 0.5 * (ay + by)
        width = (tx * tx + ty * ty) ** 0.5
        width = max(width, FOLDED_LINE_SINE * (lengths[before] + lengths[after]))
        normal[0, k] = -ty / width
        normal[1, k] = tx / width
        half_span[k] = end_weight * width
        inverse[k] = 1.0 / half_span[k] if end_weight > 0.0 else 0.0
        curvature[k] = 0.0
        if end_weight > 0.0:
            curvature[k] = (ax * by - ay * bx) / (lengths[before] * lengths[after] * width)
    return half_span, inverse, curvature, normal


@compiled_once
def make_system(inverse_lengths, half_span, inverse, curvature, closed, strength):
    """Diagonals for `solve_along` and right side of the system of `fill_thickness_displacement`.

    inverse_lengths: 1/h of the segments.
    """
    edges = inverse_lengths.shape[0]
    count = half_span.shape[0]
    main = np.zeros(count)
    next_one = np.zeros(count)
    next_two = np.zeros(count)
    right = np.empty(count)
    middle = np.empty(count)
    # the main diagonal; the curvature's differences
    for k in range(count):
        inverse_before = (
            inverse_lengths[k - 1] if k > 0 else (inverse_lengths[edges - 1] if closed else 0.0)
        )
        inverse_after = inverse_lengths[k] if k < edges else 0.0
        node_before = (k - 1) % count
        node_after = (k + 1) % count
        middle[k] = -(inverse_before + inverse_after)
        main[k] = half_span[k] + strength * (
            (
                inverse_before * inverse_before * inverse[node_before]
                + inverse_after * inverse_after * inverse[node_after]
            )
            + middle[k] * middle[k] * inverse[k]
        )
        right[k] = -strength * (
            inverse_before * (curvature[node_before] - curvature[k])
            + inverse_after * (curvature[node_after] - curvature[k])
        )
        if inverse[k] == 0.0:
            main[k] = 1.0
            right[k] = 0.0
    # couplings with the next node and the one after it
    for k in range(count):
        if not closed and k == count - 1:
            break
        next_node = (k + 1) % count
        second_next = (k + 2) % count
        inverse_beyond = inverse_lengths[next_node] if next_node < edges else 0.0
        if inverse[k] > 0.0 and inverse[next_node] > 0.0:
            next_one[k] = (
                strength
                * inverse_lengths[k]
                * (middle[k] * inverse[k] + middle[next_node] * inverse[next_node])
            )
        if inverse[k] > 0.0 and inverse[second_next] > 0.0 and (closed or k + 2 < count):
            next_two[k] = strength * (inverse_lengths[k] * inverse_beyond) * inverse[next_node]
    return main, next_one, next_two, right


@compiled_once
def keep_area(base, normal, inverse, edges, closed):
    """The ways along the normals, near `base`, by which the line sweeps no area in all.

    The segments sweep a square of the ways beyond the sum of m phi; passes take it out.
    """
    count = base.shape[0]
    displacement = base.copy()
    swept = np.empty(count)
    largest = 0.0
    for k in range(count):
        largest = max(largest, abs(displacement[k]))
    for _ in range(MOST_PASSES):
        change = 0.0
        for k in range(edges):
            node = k
            node_after = (k + 1) % count
            swept[k] = (
                normal[0, node] * normal[1, node_after] - normal[1, node] * normal[0, node_after]
            )
            swept[k] *= 0.25 * displacement[node] * displacement[node_after]
        for k in range(count):
            before = swept[k - 1] if k > 0 else (swept[edges - 1] if closed else 0.0)
            after = swept[k] if k < edges else 0.0
            new = base[k] + (before + after) * inverse[k]
            change = max(change, abs(new - displacement[k]))
            displacement[k] = new
        if change <= SETTLED_PASS_CHANGE * largest:
            break
    return displacement


@kernel
def fill_thickness_displacement(nodes, closed, wall_first, wall_last, strength, out):
    """Ways (2, n) of a line's nodes in a step; `strength` is V delta^3 dt [m4].

    With phi the way along the normal, m the distance between a node's neighbours over two, h the
    lengths of the segments and D the difference of slopes, (D f)_k = [f / h]_(k+1/2) - (k-1/2),

        (M + strength D M^-1 D) phi = -strength D kappa,                      theory F6.4

    kappa the curvature of the circle through a node and its neighbours.  The matrix is symmetric
    and has five diagonals; the sum of m phi is zero.  It is solved from both ends: the mean is the
    same for the line's mirror image.  nodes (2, n): of a closed line the last one is the first or
    its periodic image.  An open end lies on a wall of that unit normal, where the line goes on as
    its mirror image, or is held, (0, 0).
    """
    lengths = measure_lengths(nodes)
    edges = lengths.shape[0]
    half_span, inverse, curvature, normal = measure_nodes(
        nodes, lengths, closed, wall_first, wall_last
    )
    main, next_one, next_two, right = make_system(
        1.0 / lengths, half_span, inverse, curvature, closed, strength
    )
    count = half_span.shape[0]
    forwards, backwards = np.empty(count), np.empty(count)
    band = np.empty((count, HALF_BAND + 2))
    solve_along(main, next_one, next_two, right, closed, False, band, forwards)
    solve_along(main, next_one, next_two, right, closed, True, band, backwards)
    displacement = keep_area(0.5 * (forwards + backwards), normal, inverse, edges, closed)
    for k in range(nodes.shape[1]):
        for c in range(2):
            out[c, k] = displacement[k % count] * normal[c, k % count]


@compiled_once(allocates=False)
def sum_evenly(values, weights):
    """The sum of products (n,), the same from either end."""
    total = 0.0
    for k in range(values.shape[0]):
        total += values[k] * weights[k] + values[-1 - k] * weights[-1 - k]
    return 0.5 * total


@kernel
def measure_line_speed(nodes, faces, walls):
    """Mean over a line of the slip and of its faces' speed beside their mean [m/s].

    nodes (2, n + 1); faces (3, n): velocity of the contact and slip.  Walls at the ends as in
    `fill_thickness_displacement`: across them the line and its images have their own speed for a
    mean.
    """
    count = faces.shape[1]
    weights = np.ones(count)
    lengths = measure_lengths(nodes)
    lengths /= sum_evenly(weights, lengths)
    mean_x, mean_y = sum_evenly(faces[0], lengths), sum_evenly(faces[1], lengths)
    end_x = 0.0
    end_y = 0.0
    ends = 0
    for (nx, ny), end_face, next_face in ((walls[0], 0, 1), (walls[1], -1, -2)):
        if nx != 0.0 or ny != 0.0:
            end_x += 1.5 * faces[0, end_face] - 0.5 * faces[0, next_face]
            end_y += 1.5 * faces[1, end_face] - 0.5 * faces[1, next_face]
            ends += 1
    for nx, ny in walls:
        if nx != 0.0 or ny != 0.0:
            across = (end_x / ends - mean_x) * nx + (end_y / ends - mean_y) * ny
            mean_x, mean_y = mean_x + across * nx, mean_y + across * ny
    for k in range(count):
        u, v = faces[0, k] - mean_x, faces[1, k] - mean_y
        weights[k] = abs(faces[2, k]) + (u * u + v * v) ** 0.5
    return sum_evenly(weights, lengths)


@kernel(allocates=False)
def gather_line(nodes, location, rim, start, backwards, line, faces):
    """Nodes and faces (contact velocity and slip) of a block's line, from `start` on.

    location: of `hydro.motion.line.Line`; `backwards`: from its last node to its first.
    """
    ni, nj = nodes.shape[1] - 1, nodes.shape[2] - 1
    side, first_node, count, first, _ = location
    for k in range(count):
        place = count - 1 - k if backwards else k
        i, j = find_node(side, first_node + place, 0, ni, nj)
        line[0, start + k] = nodes[0, i, j]
        line[1, start + k] = nodes[1, i, j]
    for k in range(count - 1):
        face = first + (count - 2 - k if backwards else k)
        for q in range(2):
            faces[q, start + k] = rim[U_STAR + q, face]
        faces[2, start + k] = rim[SLIP, face]


@kernel(allocates=False)
def extract_line(speeds, start, backwards, out):
    """Those of the `speeds` that belong to one line, from `start` on, in its own order."""
    count = out.shape[1]
    for k in range(count):
        place = start + (count - 1 - k if backwards else k)
        out[0, k] = speeds[0, place]
        out[1, k] = speeds[1, place]


@kernel
def fill_speeds(nodes, faces, closed, walls, thickness_cubed, dt, out):
    """Velocities (2, n) that let short waves decay; `thickness_cubed`: that of the thickness [m3].

    Other arguments as in `measure_line_speed` and `fill_thickness_displacement`.
    """
    strength = measure_line_speed(nodes, faces, walls) * thickness_cubed * dt
    if not strength > 0.0:
        out[...] = 0.0
        return
    fill_thickness_displacement(nodes, closed, walls[0], walls[1], strength, out)
    for k in range(out.shape[1]):
        for c in range(2):
            out[c, k] /= dt


@compiled_once
def damp_node(line, node, speed, bend_angle, largest_rate):
    """The velocity that lets the shortest waves decay at node `node` of a line (2, n).

    speed: strength times V [m/s]; bend_angle [rad], largest_rate [1/s]: see `fill_sliding_damping`.
    """
    # direction of the line and its fourth difference
    tx = line[0, node + 1] - line[0, node - 1]
    ty = line[1, node + 1] - line[1, node - 1]
    square = tx * tx + ty * ty
    fourth_x = (
        (line[0, node + 2] + line[0, node - 2])
        - 4.0 * (line[0, node + 1] + line[0, node - 1])
        + 6.0 * line[0, node]
    )
    fourth_y = (
        (line[1, node + 2] + line[1, node - 2])
        - 4.0 * (line[1, node + 1] + line[1, node - 1])
        + 6.0 * line[1, node]
    )
    spacing = 0.5 * square**0.5
    rate = speed / (16.0 * spacing)
    # stronger where the line turns
    ax = line[0, node] - line[0, node - 1]
    ay = line[1, node] - line[1, node - 1]
    bx = line[0, node + 1] - line[0, node]
    by = line[1, node + 1] - line[1, node]
    turn = np.arctan2(ax * by - ay * bx, ax * bx + ay * by) / bend_angle
    rate *= 1.0 + turn * turn
    rate = rate if rate < largest_rate else largest_rate
    # normal part only
    fourth_across = (fourth_x * ty - fourth_y * tx) / square
    return -rate * fourth_across * ty, rate * fourth_across * tx


@kernel
def fill_sliding_damping(line, rim, start, strength, bend_angle, largest_rate, out):
    """Velocities that damp the shortest waves of a sliding contact; out (2, n).

        w = -strength × V / spacing × (fourth difference, normal part) / 16,     theory F6.7

    with V = slip + speed of the contact relative to the line's mean.  Where materials slip, waves
    of many nodes still roll up into kinks that no cell beside the line can follow: the strength
    grows by 1 + (turn / bend_angle)² with the turn of the line at the node [rad], so that what is
    bent sharper than `bend_angle` a node is taken back.
    line (2, n + 4): the nodes with two images beyond each end; largest_rate [1/s].
    """
    count = out.shape[1]
    # the line's mean velocity
    mean_x = 0.0
    mean_y = 0.0
    for k in range(start, start + count - 1):
        mean_x += rim[U_STAR, k]
        mean_y += rim[V_STAR, k]
    mean_x /= count - 1
    mean_y /= count - 1
    for k in range(count):
        node = k + 2
        # V: slip and speed relative to the mean, over both faces
        speed = 0.0
        for face in (max(start, start + k - 1), min(start + count - 2, start + k)):
            away_x = rim[U_STAR, face] - mean_x
            away_y = rim[V_STAR, face] - mean_y
            speed += 0.5 * (rim[SLIP, face] + (away_x * away_x + away_y * away_y) ** 0.5)
        out[0, k], out[1, k] = damp_node(line, node, strength * speed, bend_angle, largest_rate)


@kernel
def fill_surface_damping(line, rim, start, held, strength, bend_angle, largest_rate, out):
    """Velocities that damp the shortest waves of a body's surface; out (2, n).

    As for a sliding contact, with the speed of the four faces around a node beside their mean for
    V.  None for nodes that are `held` (n,), and for nodes without two more on either side, up to
    a held one: where a surface comes to lie on another one, and at its ends, it has kinks.
    """
    count = out.shape[1]
    out[:, :] = 0.0
    for k in range(2, count - 2):
        if held[k - 1] or held[k] or held[k + 1]:
            continue
        # mean velocity of the four faces, and how fast the faces are beside it
        first = start + k - 2
        mean_x = 0.0
        mean_y = 0.0
        for face in range(first, first + 4):
            mean_x += 0.25 * rim[U_STAR, face]
            mean_y += 0.25 * rim[V_STAR, face]
        speed = 0.0
        for face in range(first, first + 4):
            away_x = rim[U_STAR, face] - mean_x
            away_y = rim[V_STAR, face] - mean_y
            speed += 0.25 * (away_x * away_x + away_y * away_y) ** 0.5
        out[0, k], out[1, k] = damp_node(line, k + 2, strength * speed, bend_angle, largest_rate)


class SlidingLine:
    """A line of a sliding contact, whose shortest waves decay."""

    def __init__(self, line: Line):
        self.line = line

    def damp(self, dt: float) -> None:
        """Fill the velocities of the line's nodes, of its ends too, that let short waves decay."""
        segment = self.line.segment
        fill_sliding_damping(
            self.line.extend(),
            segment.block.rim.rows,
            segment.first,
            SLIDING_DAMPING,
            SLIDING_BEND_ANGLE,
            MOST_DAMPING / dt,
            self.line.damping,
        )


class SurfaceLine:
    """A body's surface, whose shortest waves decay where it lies on no other one.

    `held` (n + 1,): which of its nodes lie on another surface.
    """

    def __init__(self, line: Line):
        self.line = line
        self.held = np.zeros(line.damping.shape[1], dtype=np.bool_)

    def damp(self, dt: float) -> None:
        """Fill the velocities of the line's nodes that let short waves decay."""
        segment = self.line.segment
        fill_surface_damping(
            self.line.extend(),
            segment.block.rim.rows,
            segment.first,
            self.held,
            SURFACE_DAMPING,
            SLIDING_BEND_ANGLE,
            MOST_DAMPING / dt,
            self.line.damping,
        )


class ThickContact:
    """A contact whose shortest waves decay: one line, or lines that go on smoothly into each other.

    `parts`: the lines in order, each with whether it is walked backwards; `closed`: does the last
    one end where the first begins, or at its periodic image?
    """

    def __init__(self, lines_in_order: list[tuple[Line, bool]], closed: bool):
        self.parts = lines_in_order
        self.closed = closed
        self.counts = np.cumsum([0] + [line.damping.shape[1] - 1 for line, _ in lines_in_order])
        self.nodes = np.empty((2, int(self.counts[-1]) + 1))
        self.way = np.empty_like(self.nodes)
        self.faces = np.empty((3, int(self.counts[-1])))
        first = [
            length for line, _ in lines_in_order for length in np.hypot(*np.diff(line.track.nodes))
        ]
        thickness = lines_in_order[0][0].rule.thickness
        default_thickness = THICK_CELLS * float(np.mean(first))
        self.thickness = default_thickness if thickness is None else float(thickness)
        for line, _ in lines_in_order:
            line.closed = closed and len(lines_in_order) == 1
            if len(lines_in_order) == 1 and (closed or FREE_END not in line.walls):
                # where lines meet their steps would jump
                line.space_by_turning(SHORTEST_TURNED_SEGMENT * self.thickness)

    def find_walls(self) -> tuple:
        """Unit normals of the walls at both ends, (0, 0) where there is none."""
        first, first_backwards = self.parts[0]
        last, last_backwards = self.parts[-1]
        return first.walls[1 if first_backwards else 0], last.walls[0 if last_backwards else 1]

    def damp(self, dt: float) -> None:
        """Fill the velocities of the lines' nodes that let short waves decay."""
        for (line, backwards), start in zip(self.parts, self.counts, strict=False):
            block = line.segment.block
            gather_line(
                block.nodes, line.location, block.rim.rows, int(start), backwards, self.nodes,
                self.faces,
            )  # fmt: skip
        fill_speeds.entry(
            self.nodes, self.faces, self.closed, self.find_walls(), self.thickness**3, dt, self.way
        )
        for (line, backwards), start in zip(self.parts, self.counts, strict=False):
            extract_line(self.way, int(start), backwards, line.damping)


def find_thick_contacts(lines: list[Line]) -> list[ThickContact]:
    """The contacts of all lines, each from one end to the other."""
    contacts = []
    left = {id(line): line for line in lines}
    for line in lines:
        if id(line) not in left:
            continue
        # back to where the contact begins, or once around
        here = line
        end = 0
        while here.neighbours[end] is not None:
            here, end = here.neighbours[end][0], 1 - here.neighbours[end][1]
            if here is line:
                break
        begins = here.neighbours[end] is None
        lines_in_order: list[tuple[Line, bool]] = []
        entry = end if begins else 0
        if not begins:
            here = line
        while id(here) in left:
            del left[id(here)]
            lines_in_order.append((here, entry == 1))
            following = here.neighbours[1 - entry]
            if following is None:
                break
            here, entry = following
        contacts.append(ThickContact(lines_in_order, not begins or line.period is not None))
    return contacts
