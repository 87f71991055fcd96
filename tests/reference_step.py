"""One step of the flow in plain numpy: what `hydro/` computes, written to be read, not to be fast.

Given are blocks of cells with averages of density, velocity and pressure, their nodes before and
after the step, what lies beyond their sides, and dt.  `take_step` makes the new averages:

    1 measure      volumes, centres and lengths of cells; what faces sweep as they move
    2 ghosts       states beyond each side, for the slopes: walls mirror, contacts are solved
    3 reconstruct  limited slopes along both grid lines, half a step in time     theory F3.3-F3.6
    4 trace        states at the faces at mid-time
    5 fluxes       HLLC or HLL where material passes, else the contact's pressure    F3.7-F4.5
    6 update       old amounts less what flowed out, over the new volumes                     F3.2

Arrays are (component, i, j) or (component, n) along a side.  In `curved` flow x is the axis and y
the radius, and all integrals are weighted by y (theory F9); they are taken at two Gauss points,
which is exact here and needs no closed form.  Formulas of single numbers are those of
`hydro/formulas`.  Left out: how nodes move (they are given), surface tension, body
forces, small cells.  Sliding contacts are in `tests/reference_sliding.py`.
`tests/verification/scheme/test_reference_step.py` compares.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from reference_sliding import SlidingContact, dot, find_free_speed, solve_contact
from shockgrid.hydro.eos.base import make_least_pressure
from shockgrid.hydro.formulas import riemann
from shockgrid.hydro.formulas.reconstruction import (
    FIRST_ORDER_LIMITER,
    LOW_MACH,
    RELAXED,
    choose_limit,
)

GAUSS = 0.5 - 0.5 / 3.0**0.5, 0.5 + 0.5 / 3.0**0.5
SIDES = ("i_min", "i_max", "j_min", "j_max")
TINY = 1e-300
Trace = namedtuple("Trace", "rho u v p e c2 hll acoustic part")  # rows of what is traced to faces
find_wall_pressure = np.vectorize(riemann.compute_wave_pressure, excluded={3})


def take_step(blocks, links, t, dt, curved=False, contacts=(), carry=None, kinds=None):
    """New states (4, ni, nj) and void energies of all blocks, in their order.

    With `carry` of `reference_carried`: then also the new values of carried fields.  kinds: the
    classes of patches and sides, if these are no fluids (`reference_solid`).

    A block has `nodes`, `nodes_new`, `state` (4, ni + 2, nj + 2), whose ghosts are not read,
    `void_energy`, `eos`, `limiter`, `is_first_order`, `flux_name` and `segments`.
    """
    make_patch, make_side = kinds or (Patch, Side)
    patches = [make_patch(block, dt, curved) for block in blocks]
    sides = {id(s): make_side(patch, s) for patch in patches for s in patch.block.segments}
    for link in links:
        one = sides[id(link.leader)]
        two = sides[id(link.follower)]
        one.partner = two
        two.partner = one
        one.reverse = link.reverse
        two.reverse = link.reverse
    for contact in contacts:
        one, two = (sides[id(segment)] for segment in contact.segments)
        one.contact = two.contact = SlidingContact(contact, one, two, dt)
    for side in sides.values():
        side.fill_ghosts(t)
    for patch in patches:
        patch.reconstruct()
        patch.fill_inner_fluxes()
    for side in sides.values():
        side.fill_flux(t + 0.5 * dt)
    found = [patch.update() for patch in patches]
    if carry is None:
        return found
    carried = carry(patches, list(sides.values()))
    return [(*one, values) for one, values in zip(found, carried, strict=True)]


def cross(a, b):
    return a[0] * b[1] - a[1] * b[0]


def lower(field, axis):
    """All rows along an axis but the last: of faces those before the cells."""
    return field[..., :-1, :] if axis == "i" else field[..., :-1]


def upper(field, axis):
    """All rows along an axis but the first: of faces those after the cells."""
    return field[..., 1:, :] if axis == "i" else field[..., 1:]


def find_corners(nodes):
    """Corners a, b, c, d of all cells, counter-clockwise from (i, j)."""
    return nodes[:, :-1, :-1], nodes[:, 1:, :-1], nodes[:, 1:, 1:], nodes[:, :-1, 1:]


def find_mid_lines(nodes):
    """Vectors between the midpoints of opposite faces, along i and along j."""
    a, b, c, d = find_corners(nodes)
    return 0.5 * ((b + c) - (a + d)), 0.5 * ((d + c) - (a + b))


def find_edges(nodes, axis):
    """Both ends of the faces whose normals, to the right from end to end, point along an axis."""
    return (nodes[:, :, :-1], nodes[:, :, 1:]) if axis == "i" else (nodes[:, 1:], nodes[:, :-1])


def measure_cells(nodes, curved):
    """Volumes, and the places where averages belong: in plane flow the middles."""
    a, b, c, d = find_corners(nodes)
    volume = 0.0
    moment = 0.0
    for s in GAUSS:
        for r in GAUSS:
            point = (1 - s) * ((1 - r) * a + r * d) + s * ((1 - r) * b + r * c)
            area = 0.25 * cross((1 - r) * (b - a) + r * (c - d), (1 - s) * (d - a) + s * (c - b))
            weight = area * point[1] if curved else area
            volume = volume + weight
            moment = moment + weight * point
    return volume, moment / volume if curved else 0.25 * (a + b + c + d)


def measure_faces(nodes, nodes_new, axis, dt, curved):
    """Normal times area and volume swept per time, means over the step; centre at mid-time.

    Swept volumes so add up to what cells grow, whatever the motion (theory F3.1, F9.2).
    """
    a, b = find_edges(nodes, axis)
    a_new, b_new = find_edges(nodes_new, axis)
    normal = 0.0
    sweep = 0.0
    for r in GAUSS:  # times
        start, end = a + r * (a_new - a), b + r * (b_new - b)
        right = np.stack((end[1] - start[1], start[0] - end[0]))
        for s in GAUSS:  # places
            weight = 0.25 * ((1 - s) * start + s * end)[1] if curved else 0.25
            normal = normal + weight * right
            sweep = sweep + weight * dot(right, (1 - s) * (a_new - a) + s * (b_new - b)) / dt
    edge = 0.5 * (b - a + b_new - a_new)
    middle = 0.25 * (a + b + a_new + b_new)
    return normal, sweep, middle + edge * edge[1] / (12.0 * middle[1] + TINY) if curved else middle


def fade(jump, calm, strong):
    """1 up to the jump `calm`, 0 from `strong` on, smooth between."""
    part = np.clip((jump - calm) / (strong - calm), 0.0, 1.0)
    return (1.0 - part) ** 2 * (1.0 + 2.0 * part)


def compute_flux(left, right, normal, sweep):
    """Mass, momentum x and y, energy per time between traces (9, ...), and the pressure in it."""
    left, right = Trace(*left), Trace(*right)
    square = dot(normal, normal)
    rough = left.hll + right.hll > 0.0
    w_l, w_r = (dot((k.u, k.v), normal) - sweep for k in (left, right))  # times the length
    kept = np.where(rough, 1.0, np.maximum(left.acoustic, right.acoustic))  # theory F3.12
    w_l, w_r = w_l + 0.5 * (1.0 - kept) * (w_r - w_l), w_r - 0.5 * (1.0 - kept) * (w_r - w_l)
    c_l = np.sqrt(left.c2 * square)
    c_r = np.sqrt(right.c2 * square)
    s_l = np.minimum(w_l - c_l, w_r - c_r)
    s_r = np.maximum(w_l + c_l, w_r + c_r)
    flow_l = left.rho * (s_l - w_l)
    flow_r = right.rho * (s_r - w_r)
    contact = (square * (right.p - left.p) + flow_l * w_l - flow_r * w_r) / (flow_l - flow_r)
    cut_l = np.minimum(s_l, 0.0)
    cut_r = np.maximum(s_r, 0.0)

    def press(w):
        return np.stack((0.0 * w, *normal, w + sweep, 0.0 * w + 1.0))

    amounts = []
    simple = []
    hllc = []
    for k, w, s, cut in ((left, w_l, s_l, cut_l), (right, w_r, s_r, cut_r)):
        total = k.e + 0.5 * (k.u**2 + k.v**2)
        q = k.rho * np.stack((1.0 + 0.0 * w, k.u, k.v, total, 0.0 * w))
        f = w * q + k.p * press(w)
        p_star = k.p + k.rho * (s - w) * (contact - w) / square
        star = ((s - w) * q + p_star * press(contact) - k.p * press(w)) / (s - contact)
        amounts = [*amounts, q]
        simple = [*simple, f]
        hllc = [*hllc, f + cut * (star - q)]
    amounts[1][4] = 0.5 * (left.rho + right.rho) * (w_r - w_l) / square
    hll = cut_r * simple[0] - cut_l * simple[1] + cut_l * cut_r * (amounts[1] - amounts[0])
    flux = np.where(rough, hll / (cut_r - cut_l), np.where(contact >= 0.0, *hllc))
    donor = Trace(*np.where(flux[0] > 0.0, left, right))
    total = donor.e + 0.5 * (donor.u**2 + donor.v**2)
    held = (1.0 - donor.part) * flux[0]  # theory F4.12
    flux[:4] -= held * np.stack((1.0 + 0.0 * total, donor.u, donor.v, total))
    return flux


class Patch:
    """A block in a step."""

    def __init__(self, block, dt, curved):
        self.block = block
        self.eos = block.eos
        self.dt = dt
        self.curved = curved
        self.state = block.state[:, 1:-1, 1:-1].copy()
        self.rho = self.state[0]
        self.velocity = self.state[1:3]
        self.p = self.state[3]
        self.c2 = self.compute_c2(self.rho, self.p)
        self.e = self.eos.energy(self.rho, self.p) + block.void_energy
        nodes = block.nodes
        new = block.nodes_new
        self.volume, self.centre = measure_cells(nodes, curved)
        self.middle, self.middle_new = (measure_cells(q, False)[1] for q in (nodes, new))
        self.mid_lines = dict(zip("ij", find_mid_lines(nodes), strict=True))
        self.lengths = {axis: np.sqrt(dot(line, line)) for axis, line in self.mid_lines.items()}
        # reach: twice the way from a cell's centre to a face
        self.reaches = {}
        self.ghosts = {}
        for side in SIDES:
            way = 2.0 * dot(self.centre - self.middle, self.mid_lines[side[0]])
            way *= -1.0 if side.endswith("max") else 1.0
            self.reaches[side] = self.lengths[side[0]] + way / self.lengths[side[0]]
            self.ghosts[side] = np.full((6, self.rho.shape["ji".index(side[0])]), np.nan)
        self.faces, self.plane_faces = (
            {axis: measure_faces(nodes, new, axis, dt, weighted) for axis in "ij"}
            for weighted in (curved, False)
        )
        self.extra, self.extra_new = np.zeros((2, *self.rho.shape))  # of polygons, along followers
        self.fluxes = {axis: np.zeros((5, *self.faces[axis][1].shape)) for axis in "ij"}

    def compute_c2(self, rho, p):
        return self.eos.sound_speed_squared_part(rho, p, self.eos.parameters)

    def find_steps(self, axis):
        """Differences of the state to the cells before and after, and twice the ways there."""
        at = "ij".index(axis) + 1
        ends = (f"{axis}_min", f"{axis}_max")
        before, after = (np.expand_dims(self.ghosts[side], at) for side in ends)
        cells = np.stack((*self.state, *(self.reaches[side] for side in ends)))
        cells = np.concatenate((before, cells, after), axis=at)
        steps = (upper(cells, axis) - lower(cells, axis))[:4]
        ways = upper(cells, axis)[4] + lower(cells, axis)[5]
        return [(take(steps, axis), take(ways, axis)) for take in (lower, upper)]

    @property
    def limiter(self):
        """Its name; of constant cells where the step is taken at first order."""
        return FIRST_ORDER_LIMITER if self.block.is_first_order else self.block.limiter

    def find_variations(self, axis):
        """What the state varies over each cell towards the one before and after (theory F3.3)."""
        return [2.0 * self.lengths[axis] / way * step for step, way in self.find_steps(axis)]

    @np.errstate(invalid="ignore")  # before the ghosts are known only the inner cells count
    def limit_variations(self, axis):
        """Limited variations along an axis; of the velocity's parts along and across the line."""
        a, b = self.find_variations(axis)
        limit = np.vectorize(choose_limit(self.limiter, self.eos.has_kinks))
        line = self.mid_lines[axis]
        found = limit(a, b)
        along = limit(dot(line, a[1:3]), dot(line, b[1:3]))
        across = limit(cross(line, a[1:3]), cross(line, b[1:3]))
        turned = np.stack((-line[1], line[0]))
        found[1:3] = (along * line + across * turned) / dot(line, line)
        return found

    def find_gradient(self, along_i, along_j):
        """The vectors with these products with both lines through the centres (theory F3.5)."""
        line_i, line_j = self.lines
        x = along_i * line_j[1] - along_j * line_i[1]
        return np.stack((x, along_j * line_i[0] - along_i * line_j[0])) / cross(line_i, line_j)

    def lean(self, line, other):
        """A mid-line as the centres of volume go along it (theory F9.6)."""
        a, b, c, d = find_corners(self.block.nodes)
        twist = (a - b) + (c - d)
        y = self.middle[1]
        lean = (twist * other[1] + other * twist[1] - other * (other[1] * line[1] / y)) / (12.0 * y)
        return line + lean - line * dot(lean, line) / dot(line, line)

    def reconstruct(self):
        """Slopes, then the state at the old centre at mid-time."""
        lines = self.mid_lines["i"], self.mid_lines["j"]
        self.lines = (self.lean(*lines), self.lean(*lines[::-1])) if self.curved else lines
        variations = {axis: self.find_variations(axis) for axis in "ij"}
        limited = {axis: self.limit_variations(axis) for axis in "ij"}
        self.acoustic = np.ones_like(self.rho)
        if self.limiter in RELAXED:  # plain means where the flow turns: theory F3.11
            means = {axis: 0.5 * (a + b)[1:3] for axis, (a, b) in variations.items()}
            (u_x, v_x), (u_y, v_y) = self.find_gradient(means["i"], means["j"])
            jumps = sum(dot(q[1:3], q[1:3]) for pair in variations.values() for q in pair)
            share = 4.0 * (u_x + v_y) ** 2 / (u_x**2 + u_y**2 + v_x**2 + v_y**2 + TINY)
            weight = np.minimum(share + 8.0 * jumps / self.c2, 1.0)
            for axis, mean in means.items():
                limited[axis][1:3] = weight * limited[axis][1:3] + (1.0 - weight) * mean
            if self.limiter in LOW_MACH:
                self.acoustic = weight
        self.slopes = self.find_gradient(limited["i"], limited["j"])  # (x or y, quantity, i, j)
        steps = [step[3] for axis in "ij" for step, _ in self.find_steps(axis)]
        jump = np.max(np.abs(steps), axis=0) / (self.rho * self.c2)
        self.smooth = fade(jump, 0.5, 1.5)
        self.hll = 1.0 * (jump > riemann.HLL_JUMP_THRESHOLDS[self.block.flux_name])
        # the half step: theory F3.6
        rho_slope, u_slope, v_slope, p_slope = np.moveaxis(self.slopes, 1, 0)
        rho = self.rho
        velocity = self.velocity
        way = self.middle - self.centre
        carried = velocity + np.stack((dot(u_slope, way), dot(v_slope, way)))
        divergence = u_slope[0] + v_slope[1] + (velocity[1] / self.centre[1] if self.curved else 0)
        rates = np.stack((
            dot(carried, rho_slope) + rho * divergence,
            dot(carried, u_slope) + p_slope[0] / rho,
            dot(carried, v_slope) + p_slope[1] / rho,
            dot(carried, p_slope) + rho * self.c2 * divergence,
        ))  # fmt: skip
        self.half = self.state - 0.5 * self.dt * rates

    @np.errstate(all="ignore")
    def trace(self, points):
        """States at points (2, ni, nj), one a cell; the cell's own where that is none."""
        found = self.half + np.einsum("cqij,cij->qij", self.slopes, points - self.centre)
        torn = self.block.void_energy < 0.0  # theory F4.10
        c2 = np.where(torn, self.c2, self.compute_c2(found[0], found[3]))
        good = (found[0] > 0.0) & (c2 > 0.0)
        rho, u, v, p = np.where(good, found, self.state)
        e = np.where(torn, self.e, self.eos.energy(rho, p))
        part = self.find_leaving_part(rho)
        c2 = np.where(good, c2, self.c2)
        return np.stack((rho, u, v, p, e, c2, self.hll, self.acoustic, part))

    def find_leaving_part(self, rho):
        """The fraction of the flux with which material of a density leaves a cell."""
        kind = type(self.eos)
        if not hasattr(kind, "least_density_part"):
            return np.ones_like(rho)
        least = kind.least_density_part(self.eos.parameters)
        return np.clip(rho / least - 1.0, 0.0, 1.0)

    def trace_to(self, side):
        """States at the cells' faces on one side of each."""
        take = lower if side.endswith("min") else upper
        return self.trace(take(self.faces[side[0]][2], side[0]))

    def fill_inner_fluxes(self):
        """Fluxes through all faces between two cells of the block."""
        for axis, (normal, sweep, _) in self.faces.items():
            left, right = (self.trace_to(f"{axis}_{end}") for end in ("max", "min"))
            rows = (upper(lower(q, axis), axis) for q in (self.fluxes[axis], normal, sweep))
            flux, normal, sweep = rows
            flux[...] = compute_flux(lower(left, axis), upper(right, axis), normal, sweep)

    def update(self):
        """New state and void energy: what was there less what flowed out, over the new volume."""
        total = self.e + 0.5 * dot(self.velocity, self.velocity)
        amounts = (
            (self.volume + self.extra)
            * self.rho
            * np.stack((np.ones_like(total), *self.velocity, total))
        )
        amounts -= self.dt * flow_out({axis: q[:4] for axis, q in self.fluxes.items()})
        if self.curved:
            amounts[2] += self.dt * self.push_outwards()
        volume = measure_cells(self.block.nodes_new, self.curved)[0] + self.extra_new
        rho = amounts[0] / volume
        velocity = amounts[1:3] / amounts[0]
        e = amounts[3] / amounts[0]
        e = e - 0.5 * dot(velocity, velocity)
        p = self.eos.pressure(rho, e)
        least = make_least_pressure(type(self.eos))(rho, self.eos.parameters)
        torn = (p < least) & type(self.eos).opens_voids
        p = np.where(torn, least, p)
        return np.stack((rho, *velocity, p)), np.where(torn, e - self.eos.energy(rho, p), 0.0)

    def push_outwards(self):
        """Of the pressure: smooth, its force per depth times the radius, else per radian (F9.5)."""
        push, hoop = (
            flow_out({axis: q[4] * faces[axis][0][1] for axis, q in self.fluxes.items()})
            for faces in (self.plane_faces, self.faces)
        )
        radius = 0.5 * self.centre[1] * (1.0 + self.middle_new[1] / self.middle[1])
        pressure = self.trace(0.5 * (self.middle + self.middle_new))[3]
        old = self.block.nodes
        new = self.block.nodes_new
        area = sum(0.5 * cross(*find_mid_lines(old + r * (new - old))) for r in GAUSS)
        return self.smooth * (hoop - radius * push) + (1.0 - self.smooth) * pressure * area


def flow_out(fluxes):
    """What flows out of each cell in all."""
    return sum(upper(fluxes[axis], axis) - lower(fluxes[axis], axis) for axis in "ij")


def at_side(field, side, depth=0):
    """Values along a side, of cells so many rows in, or of faces."""
    k = -1 - depth if side.endswith("max") else depth
    return field[..., k, :] if side.startswith("i") else field[..., k]


class Side:
    """The faces of one segment, in its order; normals point outwards."""

    def __init__(self, patch, segment):
        self.patch = patch
        self.segment = segment
        self.name = segment.side
        self.axis = self.name[0]
        self.partner = None
        self.reverse = False
        self.sign = 1.0 if self.name.endswith("max") else -1.0

    def take(self, field, depth=0):
        return at_side(field, self.name, depth)[..., self.segment.start : self.segment.stop]

    def find_line(self, nodes):
        return at_side(nodes, self.name)[:, self.segment.start : self.segment.stop + 1]

    def ask(self, find):
        """What `find` finds of the partner, in this side's order."""
        return find(self.partner)[..., :: -1 if self.reverse else 1]

    def find_normal(self, nodes):
        """Outward unit normals (2, n) of the faces between these nodes."""
        a, b = find_edges(nodes, self.axis)
        x, y = self.sign * self.take(b - a)
        return np.stack((y, -x)) / np.hypot(x, y)

    def fill_ghosts(self, t):
        """State beyond the side, and twice the way from there to the faces (theory F4.6)."""
        kind = self.segment.kind
        patch = self.patch
        segment = self.segment
        state = self.find_cells()[:4].copy()
        reach = self.find_cells()[4]
        normal = self.find_normal(patch.block.nodes)
        if kind in ("wall", "axis", "piston"):
            excess = dot(state[1:3] - np.reshape(segment.velocity(t), (2, 1)), normal)
            part = self.shorten(excess, normal) if kind == "piston" else 1.0
            state[1:3] -= 2.0 * part * excess * normal
        elif kind in ("interface", "free-surface", "sliding"):
            pressure, speed = self.solve(type(self).find_state_at_face, normal, t)
            c2 = self.take(patch.c2)
            rise = 2.0 * (pressure - state[3])
            jump = np.minimum(2.0 * (speed - dot(state[1:3], normal)), 1.5 * np.sqrt(c2))
            state += np.stack((rise / c2, *(jump * normal), rise))
        elif kind in ("seam", "periodic"):
            *state, reach = self.ask(Side.find_cells)
        elif kind == "inflow":
            state = self.find_inflow(t)[:4]
            reach = 0.0 * reach
        else:
            assert kind == "outflow", f"there is no reference for {kind}"
        patch.ghosts[self.name][:, segment.start : segment.stop] = np.stack((*state, reach, reach))

    def find_cells(self):
        """States and reaches of the cells along the side, (5, n)."""
        return self.take(np.stack((*self.patch.state, self.patch.reaches[self.name])))

    @np.errstate(all="ignore")
    def shorten(self, excess, normal):
        """Part of the jump beyond a piston that does not carry the gas past it (theory F4.9)."""
        inwards = self.axis + ("_max" if self.name.endswith("min") else "_min")
        reaches = self.patch.reaches
        velocity = self.patch.velocity
        way = self.take(reaches[inwards]) + self.take(reaches[self.name], 1)
        further = dot(self.take(velocity, 1) - self.take(velocity), normal)
        ratio = further * self.take(reaches[self.name]) / (excess * way)
        return np.where(ratio > 1.0, np.maximum(2.0 - ratio, 0.5), 1.0)

    @np.errstate(all="ignore")
    def find_state_at_face(self):
        """The cells' state and c², with the next cell's slope where no shock is (theory F4.7)."""
        patch = self.patch
        own = self.take(np.stack((*patch.state, patch.c2)))
        if patch.rho.shape["ij".index(self.axis)] < 3:
            return own
        p = [self.take(patch.p, depth) for depth in range(3)]
        jump = np.maximum(np.abs(p[0] - p[1]), np.abs(p[1] - p[2])) / (own[0] * own[4])
        slope = self.take(patch.limit_variations(self.axis) / patch.lengths[self.axis], 1)
        way = 0.5 * self.sign * self.take(patch.reaches[self.name])
        state = own[:4] + fade(jump, 0.01, 0.05) * way * slope
        c2 = patch.compute_c2(state[0], state[3])
        return np.where((state[0] > 0.0) & (c2 > 0.0), np.stack((*state, c2)), own)

    def solve(self, find, normal, t):
        """Pressure and normal speed of a contact or a free surface between the states found."""
        if self.segment.kind == "sliding":
            return self.contact.find_surface(self, normal)
        rho, u, v, p, c2 = find(self)
        law = self.patch.block.wave_law
        mine = rho, dot((u, v), normal), p, np.sqrt(c2), law
        if self.partner is None:
            pressure = self.segment.pressure(t) + 0.0 * rho
            return pressure, find_free_speed(*mine, pressure)
        rho, u, v, p, c2 = self.ask(find)
        law = self.partner.patch.block.wave_law
        return solve_contact(*mine, rho, dot((u, v), normal), p, np.sqrt(c2), law)

    def find_inflow(self, t):
        """What stands beyond an inflow side."""
        ones = np.ones(self.segment.stop - self.segment.start)
        eos = self.patch.eos
        rho, u, v, p = (value * ones for value in self.segment.state(t))
        e = eos.energy(rho, p)
        c2 = self.patch.compute_c2(rho, p)
        return np.stack((rho, u, v, p, e, c2, 0.0 * p, 0.0 * p, ones))

    def fill_flux(self, t):
        """Fluxes through the side; t is the mid-time (theory F4.5)."""
        kind = self.segment.kind
        patch = self.patch
        trace = self.find_trace()
        normal, sweep, _ = (self.sign * self.take(q) for q in patch.faces[self.axis])
        if kind in ("seam", "periodic", "inflow", "outflow"):
            other = self.find_inflow(t) if kind == "inflow" else trace
            other = other if self.partner is None else self.ask(Side.find_trace)
            flux = compute_flux(trace, other, normal, sweep)
        elif kind == "sliding":
            flux = self.contact.find_flux(self)
        else:
            pressure = self.find_pressure(Trace(*trace), t)
            flux = np.stack((0.0 * pressure, *(pressure * normal), pressure * sweep, pressure))
        flux[:4] *= self.sign
        self.take(patch.fluxes[self.axis])[...] = flux

    def find_trace(self):
        """States at the faces; on the axis where faces close to it have their centre of area."""
        patch = self.patch
        if self.segment.kind != "axis":
            return self.take(patch.trace_to(self.name))
        nodes = 0.5 * (patch.block.nodes + patch.block.nodes_new)
        points = patch.centre.copy()
        line = at_side(nodes, self.name)
        radius = at_side(nodes, self.name, 1)[1]
        part = np.diff(radius) / (6.0 * (radius[1:] + radius[:-1]))
        at_side(points, self.name)[...] = 0.5 * (line[:, 1:] + line[:, :-1]) + part * np.diff(line)
        return self.take(patch.trace(points))

    def find_pressure(self, trace, t):
        """What presses on faces that nothing passes."""
        area, sweep, _ = (self.sign * self.take(q) for q in self.patch.plane_faces[self.axis])
        normal = area / np.hypot(*area)
        law = self.patch.block.wave_law
        if self.segment.kind in ("interface", "free-surface"):
            return self.solve(lambda side: side.find_trace()[[0, 1, 2, 3, 5]], normal, t)[0]
        change = dot((trace.u, trace.v), normal) - sweep / np.hypot(*area)
        return find_wall_pressure(trace.rho, trace.p, np.sqrt(trace.c2), law, change)[0]
