"""Sliding contacts of the plain step in `tests/reference_step.py`: lines whose nodes do not match.

Plane flow, one segment a side, both in the same order.  The leader's line is the contact's; the
follower's nodes lie on it.  Nodes of both cut it into pieces, each with its own Riemann problem:

    1 cut       the leader's line at its own nodes and at the follower's                  theory F4
    2 slopes    of velocity and pressure from face to face of each side
    3 solve     contact states of the pieces; one under tension, or without a follower, is a surface
    4 surface   means over each side's faces: what the ghosts are made of
    5 fluxes    the pieces' pressure; what passes where the follower's nodes slide: closing faces

A follower's cell is a polygon: nodes of the leader between its own two are corners of it.
"""

from __future__ import annotations

import itertools

import numpy as np

from shockgrid.hydro.formulas import riemann

solve_contact = np.vectorize(
    lambda rho, w, p, c, law, *other: riemann.compute_contact((rho, w, p, c, law), other, 0.0),
    excluded={4, 9},
)
find_free_speed = np.vectorize(riemann.compute_speed_at_pressure, excluded={4})


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1]


def turn_right(a):
    return np.stack((a[1], -a[0]))


def find_positions(line, points):
    """Where on a line the points lie: the number of a face plus the part of it behind the point."""
    start = line[:, None, :-1]
    way = np.diff(line)[:, None]
    part = np.clip(dot(points[:, :, None] - start, way) / dot(way, way), 0.0, 1.0)
    miss = points[:, :, None] - start - part * way
    face = np.argmin(dot(miss, miss), axis=1)
    found = face + np.take_along_axis(part, face[:, None], 1)[:, 0]
    return np.where(np.abs(found - np.round(found)) < 1e-9, np.round(found), found)


def find_points(line, positions):
    face = np.minimum(positions.astype(int), line.shape[1] - 2)
    return line[:, face] + (positions - face) * np.diff(line)[:, face]


def find_mean(before, after):
    """Van Leer's mean of two vectors (n, ...), 0 where they point apart."""
    with np.errstate(all="ignore"):
        a, b = (np.sqrt(np.sum(q * q, axis=0)) for q in (before, after))
        mean = (b * before + a * after) / (a + b)
    return np.where(np.sum(before * after, axis=0) > 0.0, mean, 0.0)


def find_curve_normals(line, positions):
    """Normals, to the right, of the curve that a line stands for; of length 1 or a little less."""
    normal = turn_right(np.diff(line))
    normal = normal / np.hypot(*normal)
    bend = 0.5 * np.clip(10.0 * (dot(normal[:, 1:], normal[:, :-1]) - 0.8), 0.0, 1.0)
    start = normal.copy()
    end = normal.copy()
    change = bend * np.diff(normal)
    start[:, 1:] -= change
    end[:, :-1] += change
    face = np.minimum(positions.astype(int), normal.shape[1] - 1)
    return start[:, face] + (positions - face) * (end - start)[:, face]


class SlidingContact:
    """A contact in a step; `one` and `two` are the sides of leader and follower."""

    def __init__(self, contact, one, two, dt):
        self.sides = (one, two)
        self.dt = dt
        self.sign = 1.0 if one.name in ("i_max", "j_min") else -1.0  # outwards: to the right or not
        free = [end < 0 for end in contact.fixed]  # ends of the follower that are contact points
        self.part_at_first = 0.0 if not free[0] else 1.0 if not free[1] else 0.5
        self.lines, self.lines_new = (
            [side.find_line(getattr(side.patch.block, name)) for side in self.sides]
            for name in ("nodes", "nodes_new")
        )
        self.extra, self.extra_new = (self.measure_extra(*q) for q in (self.lines, self.lines_new))
        two.take(two.patch.extra)[...] = self.extra
        two.take(two.patch.extra_new)[...] = self.extra_new

    def measure_extra(self, line, follower):
        """What the follower's polygons have beyond their straight faces, towards the leader."""
        positions = find_positions(line, follower)
        found = []
        for k, (start, stop) in enumerate(itertools.pairwise(positions)):
            corners = line[:, int(start) + 1 : int(np.ceil(stop))]
            x, y = (
                np.column_stack((follower[:, k], corners, follower[:, k + 1]))
                - follower[:, k, None]
            )
            found.append(-0.5 * self.sign * np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]))
        return np.array(found)

    def cut(self, lines, moved):
        """The pieces: their faces on both sides, -1 for none, areas, sweeps, middles, normals."""
        line, follower = lines
        positions = find_positions(line, follower)
        cuts = np.unique(np.concatenate((np.arange(line.shape[1]), positions)))
        middles = 0.5 * (cuts[1:] + cuts[:-1])
        self.leader = middles.astype(int)
        self.follower = np.searchsorted(positions, middles) - 1
        self.follower[self.follower == len(positions) - 1] = -1
        self.area = self.sign * turn_right(np.diff(find_points(line, cuts)))
        self.sweep = dot(find_points(moved, middles), self.area) / self.dt
        self.point = find_points(line, middles)
        # normals of the curve that the line stands for: at nodes means, but for sharp corners
        turned = self.sign * find_curve_normals(line, middles)
        self.normal = turned / np.hypot(*turned)
        return positions

    def find_states_at_pieces(self, states, line, faces):
        """States (rho, u, v, p, c²) of a side's faces, with slopes, at the pieces' middles."""
        middles = 0.5 * (line[:, 1:] + line[:, :-1])
        slopes = np.zeros_like(states)
        steps = np.diff(states) / np.hypot(*np.diff(middles))
        for rows in (slice(1, 3), slice(3, 4)):  # the velocity as a vector
            slopes[rows, 1:-1] = find_mean(steps[rows, :-1], steps[rows, 1:])
        along = np.zeros_like(middles)
        along[:, 1:-1] = middles[:, 2:] - middles[:, :-2]
        along[:, 1:-1] /= np.hypot(*along[:, 1:-1])
        way = dot(self.point - middles[:, faces], along[:, faces])
        return states[:, faces] + way * slopes[:, faces]

    def solve(self, find, lines):
        """Pressures of the pieces, and what the contact's speed exceeds either side's own by."""
        found = []
        for side, line, faces in zip(self.sides, lines, (self.leader, self.follower), strict=True):
            rho, u, v, p, c2 = self.find_states_at_pieces(find(side), line, faces)
            w = dot((u, v), self.normal)
            found.append((rho, w, p, np.sqrt(c2), side.patch.block.wave_law))
        one, two = found
        pressure, speed = solve_contact(*one, *two)
        bare = (self.follower < 0) | (pressure < 0.0)
        speed_two = speed
        if bare.any():
            rho, w, p, c, law = two
            speed = np.where(bare, find_free_speed(*one, 0.0), speed)
            speed_two = np.where(bare, -find_free_speed(rho, -w, p, c, law, 0.0), speed_two)
        return np.where(bare, 0.0, pressure), (speed - one[1], speed_two - two[1])

    def find_surface(self, asking, normal):
        """Pressure and outward normal speed of one side's faces, from the cells."""
        self.cut(self.lines, 0.0 * self.lines[0])
        pressure, excess = self.solve(lambda side: side.find_state_at_face(), self.lines)
        number = self.sides.index(asking)
        faces = (self.leader, self.follower)[number]
        own = asking.find_state_at_face()[1:3]
        sign = (1.0, -1.0)[number]
        there = faces >= 0
        length = np.bincount(faces[there], np.hypot(*self.area)[there])
        pressure, excess = (
            np.bincount(faces[there], (q * np.hypot(*self.area))[there]) / length
            for q in (pressure, excess[number])
        )
        return pressure, dot(own, normal) + sign * excess

    def find_flux(self, asking):
        """Fluxes (5, n) out of one side's faces; the last row, for the axis, is not needed."""
        lines = [0.5 * (a + b) for a, b in zip(self.lines, self.lines_new, strict=True)]
        positions = self.cut(lines, self.lines_new[0] - self.lines[0])
        find = lambda side: side.find_trace()[[0, 1, 2, 3, 5]]  # noqa: E731
        pressure, _ = self.solve(find, lines)
        zero = 0.0 * pressure
        parts = np.stack((zero, *(pressure * self.area), pressure * self.sweep, zero))
        number = self.sides.index(asking)
        faces, sign = ((self.leader, 1.0), (self.follower, -1.0))[number]
        flux = np.zeros((5, asking.segment.stop - asking.segment.start))
        np.add.at(flux.T, faces[faces >= 0], sign * parts.T[faces >= 0])
        if number == 1:
            through = self.find_closing_flux(lines, positions)
            flux[:, 1:] += through
            flux[:, :-1] -= through
        return flux

    def find_closing_flux(self, lines, positions):
        """What passes from each follower's cell, but the first, to the one before it."""
        two = self.sides[1]
        area = -self.sign * turn_right(find_points(lines[0], positions) - lines[1])[:, 1:-1]
        rho, u, v, p, e, *_ = trace = two.find_trace()
        grows = (self.extra_new - self.extra) / self.dt
        grows += two.sign * two.take(two.patch.faces[two.axis][1])
        under = self.follower >= 0
        grows += np.bincount(self.follower[under], self.sweep[under])
        swept = self.part_at_first * np.sum(grows) - np.cumsum(grows)[:-1]
        u, v, p = (0.5 * (q[1:] + q[:-1]) for q in (u, v, p))
        rate = u * area[0] + v * area[1] - swept
        rho, u_up, v_up, _, e, *_ = np.where(rate > 0.0, trace[:, 1:], trace[:, :-1])
        mass = rho * rate
        work = p * (u * area[0] + v * area[1])
        total = e + 0.5 * (u_up**2 + v_up**2)
        momentum = mass * u_up + p * area[0], mass * v_up + p * area[1]
        return np.stack((mass, *momentum, mass * total + work, 0.0 * p))
