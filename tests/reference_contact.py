"""Contacts of bodies and the motion of lines, beside `tests/reference_step.py`, in plain numpy.

Plane flow.  The follower's nodes lie on the leader's line, which it covers in part; the nodes of
both cut what they share into facets, each with its own Riemann problem (theory F16):

    1 cut       facets between the follower's nodes and the leader's between them          F16.1
    2 solve     contact states; closed where the pressure is that of the gap at least      F16.2
    3 cover     means over closed and free parts of each face: what moves the lines        F16.4
    4 fluxes    pressure and work of closed facets, and friction                           F16.3, 5
    5 motion    nodes between the speeds of their faces, or along a body's surface      F6.2, 16.9
"""

from __future__ import annotations

import numpy as np

from reference_sliding import (
    SlidingContact,
    dot,
    find_curve_normals,
    find_free_speed,
    find_points,
    find_positions,
    solve_contact,
    turn_right,
)


class BodyContact(SlidingContact):
    """A contact of two free surfaces with empty gaps, at one time.

    lines, states: of leader and follower, (2, n + 1), each with its outside on the right, and
    traces (5, n): rho, u, v, p, c²; laws: wave laws of both materials.
    """

    def __init__(self, lines, states, laws):
        self.lines = lines
        self.states = states
        self.laws = laws
        self.cut_facets()
        self.solve_facets()

    def cut_facets(self):
        line, follower = self.lines
        positions = find_positions(line, follower)
        inner = np.arange(np.ceil(positions.min()), np.floor(positions.max()) + 1.0)
        cuts = np.unique(np.concatenate((inner, positions)))
        middles = 0.5 * (cuts[1:] + cuts[:-1])
        self.leader = middles.astype(int)
        # the follower runs the other way
        rising = np.searchsorted(positions[::-1], middles) - 1
        self.follower = len(positions) - 2 - rising
        points = find_points(line, cuts)
        self.area = turn_right(np.diff(points))
        self.point = 0.5 * (points[:, 1:] + points[:, :-1])
        on_follower = np.array(
            [
                0.5 * sum(self.find_parts(points[:, k : k + 2], b))
                for k, b in enumerate(self.follower)
            ]
        )
        normal = find_curve_normals(line, middles)
        normal = normal - find_curve_normals(follower, self.follower + on_follower)
        self.normal = normal / np.hypot(*normal)
        self.middles = middles

    def find_parts(self, points, face):
        """Parts of one of the follower's faces at which two points are nearest to it."""
        start = self.lines[1][:, face, None]
        way = self.lines[1][:, face + 1, None] - start
        return np.clip(dot(points - start, way) / dot(way, way), 0.0, 1.0)

    def solve_facets(self):
        found = []
        for states, line, faces, law in zip(
            self.states, self.lines, (self.leader, self.follower), self.laws, strict=True
        ):
            rho, u, v, p, c2 = self.find_states_at_pieces(states, line, faces)
            found.append((rho, dot((u, v), self.normal), p, np.sqrt(c2), law))
        one, two = found
        self.pressure, speed = solve_contact(*one, *two)
        self.closed = self.pressure >= 0.0
        self.excess = speed - one[1], -(speed - two[1])

    def cover(self, number):
        """Pressure and outward normal speed (n,) of one side's faces, free where nothing closes."""
        faces = (self.leader, self.follower)[number]
        line = self.lines[number]
        rho, u, v, p, c2 = self.states[number]
        length = np.hypot(*np.diff(line))
        own = dot((u, v), turn_right(np.diff(line)) / length)
        free = find_free_speed(rho, own, p, np.sqrt(c2), self.laws[number], 0.0) - own
        part = np.where(self.closed, np.hypot(*self.area), 0.0) / length[faces]
        count = length.size
        covered = np.bincount(faces, part, count)
        # chords of the follower are a little shorter than what they cover
        scale = 1.0 / np.maximum(covered, 1.0)
        bare = np.maximum(0.0, 1.0 - covered)
        pressure = scale * np.bincount(faces, part * self.pressure, count)
        excess = bare * free + scale * np.bincount(faces, part * self.excess[number], count)
        return pressure, own + excess

    def find_fluxes(self, moved, dt, friction, cells):
        """Fluxes of momentum and energy (3, n) out of the faces of both sides.

        moved (2, m + 1): way of the leader's nodes in dt; cells: (rho, u, v, c, depth) of both.
        """
        sweep = dot(find_points(moved, self.middles), self.area) / dt
        force = np.where(self.closed, self.pressure, 0.0)
        parts = np.stack((*(force * self.area), force * sweep))
        rubbed, works = self.rub(friction, cells, dt)
        parts += np.where(self.closed, np.stack((*rubbed, works)), 0.0)
        fluxes = []
        for faces, sign, line in zip(
            (self.leader, self.follower), (1, -1), self.lines, strict=True
        ):
            flux = np.zeros((3, line.shape[1] - 1))
            np.add.at(flux.T, faces, sign * parts.T)
            fluxes.append(flux)
        return fluxes

    def rub(self, friction, cells, dt):
        """Force of friction out of the leader's facets (2, n), and its work in a second."""
        along = np.stack((-self.normal[1], self.normal[0]))
        (rho, u, v, c, depth), (rho_2, u_2, v_2, c_2, depth_2) = (
            [row[faces] for row in rows]
            for rows, faces in zip(cells, (self.leader, self.follower), strict=True)
        )
        inverse = 1.0 / (rho * depth)
        inverse_2 = 1.0 / (rho_2 * depth_2)
        own = dot((u, v), along)
        other = dot((u_2, v_2), along)
        stops = np.abs(other - own) / (dt * (inverse + inverse_2))
        push = np.sign(other - own) * np.minimum(friction * self.pressure, stops)
        own = own + 0.5 * dt * push * inverse
        other = other - 0.5 * dt * push * inverse_2
        part = rho * c / (rho * c + rho_2 * c_2)
        force = -push * np.hypot(*self.area)
        return force * along, force * (own + part * (other - own))


def move_nodes(line, speeds, dt):
    """A line's inner nodes (2, n - 1) with the velocities (2, n) of its faces (theory F6.2)."""
    length = np.hypot(*np.diff(line))
    before, after = length[:-1], length[1:]
    speed = (after * speeds[:, :-1] + before * speeds[:, 1:]) / (before + after)
    return line[:, 1:-1] + dt * speed


def respace_nodes(line, positions, most):
    """Inner nodes moved to arc lengths (n + 1,), parallel to their neighbours' chords (F16.9).

    By `most` of the face ahead at most.
    """
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line)))])
    way = np.clip((positions - arc)[1:-1], -most * np.diff(arc)[:-1], most * np.diff(arc)[1:])
    return line[:, 1:-1] + way / (arc[2:] - arc[:-2]) * (line[:, 2:] - line[:, :-2])
