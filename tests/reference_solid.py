"""One step of a solid in plain numpy: what `hydro/strength` adds to the flow, written to be read.

`take_solid_step` is `take_step` of `reference_step` and the step of carried fields of
`reference_carried` with stress, in plane strain.  Stress is an array (3, ...) of s_xx, s_yy, s_xy.

    start        shear moduli; ghosts of the stress
    reconstruct  slopes of the stress, its values at mid-time by strain, rotation and yield  F20.3
    fluxes       normal stress in place of the pressure; what acts along faces       F20.5, F20.6
    relax        strain from the faces' velocities, rotation, yield                 F20.8-F20.10

Left out: inflow and sliding contacts, axisymmetric flow, spall.
"""

from __future__ import annotations

import numpy as np

import reference_carried
from reference_sliding import dot
from reference_step import (
    Patch,
    Side,
    cross,
    fade,
    find_corners,
    find_edges,
    lower,
    take_step,
    upper,
)
from shockgrid.hydro.eos.conversion import compute_temperature
from shockgrid.hydro.formulas.reconstruction import choose_limit, limit_gently

limit = np.vectorize(limit_gently)
P, C2 = 3, 5  # rows of a trace


def take_solid_step(blocks, links, t, dt):
    """New states, void energies and carried fields of all blocks, in their order."""
    return take_step(blocks, links, t, dt, carry=carry, kinds=(SolidPatch, SolidSide))


# --- tensors ---------------------------------------------------------------------------------


def make_tensor(stress):
    """The tensor (2, 2, ...) of a stress (3, ...)."""
    s_xx, s_yy, s_xy = stress
    return np.array([[s_xx, s_xy], [s_xy, s_yy]])


def turn_left(vector):
    return np.stack((-vector[1], vector[0]))


def resolve(stress, normal):
    """s_nn, s_tt and s_nt (3, ...) with t to the left of the unit normal."""
    tensor = make_tensor(stress)
    along = turn_left(normal)
    pairs = (normal, normal), (along, along), (normal, along)
    return np.stack([np.einsum("c...,cd...,d...->...", a, tensor, b) for a, b in pairs])


def compose(components, normal):
    """The stress of such components."""
    nn, tt, nt = components
    along = turn_left(normal)
    tensor = nn * normal[:, None] * normal + tt * along[:, None] * along
    mixed = normal[:, None] * along
    tensor = tensor + nt * (mixed + np.swapaxes(mixed, 0, 1))
    return np.stack((tensor[0, 0], tensor[1, 1], tensor[0, 1]))


def find_equivalent(stress):
    """(3/2 s:s)^(1/2) with the component across the plane."""
    s_xx, s_yy, s_xy = stress
    return np.sqrt(1.5 * (s_xx**2 + s_yy**2 + (s_xx + s_yy) ** 2 + 2.0 * s_xy**2))


class Rates:
    """Deviator (3, ...) of the rate of strain, rate of rotation and equivalent rate [1/s]."""

    def __init__(self, gradient):
        (u_x, u_y), (v_x, v_y) = gradient
        third = (u_x + v_y) / 3.0
        self.strain = np.stack((u_x - third, v_y - third, 0.5 * (u_y + v_x)))
        self.spin = 0.5 * (v_x - u_y)
        self.equivalent = find_equivalent(self.strain) * 2.0 / 3.0

    def strain_stress(self, stress, law, dt):
        """The stress after `dt`, and the plastic strain for it; law: modulus, Y, hardening."""
        modulus, flow_stress, hardening = law
        angle = 2.0 * np.arctan(0.5 * dt * self.spin)
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        tensor = np.einsum("ac...,cd...,bd...->ab...", turn, make_tensor(stress), turn)
        stress = np.stack((tensor[0, 0], tensor[1, 1], tensor[0, 1]))
        stress = stress + 2.0 * modulus * dt * self.strain
        size = find_equivalent(stress)
        strain = np.maximum(size - flow_stress, 0.0) / (3.0 * modulus + hardening + 1e-300)
        return stress * (1.0 - 3.0 * modulus * strain / (size + 1e-300)), strain


class SolidPatch(Patch):
    """A block of a solid in a step."""

    def __init__(self, block, dt, curved):
        assert not curved, "there is no reference for solids in axisymmetric flow"
        super().__init__(block, dt, curved)
        self.has_ghosts = False
        self.carried = block.carried[:, 1:-1, 1:-1].copy()
        self.stress = self.carried[:3]
        held = block.state[:, 1:-1, 1:-1], block.void_energy
        self.modulus = np.where(block.void_energy != 0.0, 0.0, self.find_law(held)[0])
        self.shear_wave = 4.0 / 3.0 * self.modulus / self.rho
        self.carried_ghosts = {
            name: np.full((len(self.carried), *ghosts.shape[1:]), np.nan)
            for name, ghosts in self.ghosts.items()
        }
        self.turns = {name: np.ones(ghosts.shape[1]) for name, ghosts in self.ghosts.items()}
        # velocities of the faces' contacts
        self.speeds = {axis: np.zeros((2, *self.faces[axis][1].shape)) for axis in "ij"}

    def find_law(self, held, strain=None, rate=None):
        """Modulus, and with a plastic strain and a rate also flow stress and hardening."""
        law = self.block.strength
        temperature = compute_temperature(self.eos, *held) if law.needs_temperature else None
        state = held[0][0], held[0][3], temperature
        modulus = law.shear_modulus(*state)
        if strain is None:
            return modulus, None, None
        return modulus, law.flow_stress(strain, rate, *state), law.hardening(strain, rate, *state)

    # --- slopes ----------------------------------------------------------------------------------

    def find_turned_ways(self, axis):
        """Distances to the cells before and after along the cells' own lines, twice over."""
        line = self.mid_lines[axis]
        length = self.lengths[axis]
        at = "ij".index(axis)
        cosine = dot(lower(line, axis), upper(line, axis)) / (
            lower(length, axis) * upper(length, axis)
        )
        found = []
        for end, k in (("min", 0), ("max", -1)):
            ghosts = np.expand_dims(self.ghosts[f"{axis}_{end}"][4], at)
            turns = np.expand_dims(self.turns[f"{axis}_{end}"], at)
            beyond = [upper(length, axis), lower(length, axis)][k == 0]
            parts = [turns * ghosts, cosine * beyond]
            found.append(length + np.concatenate(parts if k == 0 else parts[::-1], axis=at))
        return found

    def find_variations(self, axis):
        """Those of the velocity by the distances of centres along the line (theory F20.12)."""
        if not self.has_ghosts:  # states at sides are found by the lengths of cells
            return super().find_variations(axis)
        steps = self.find_steps(axis)
        turned_ways = self.find_turned_ways(axis)
        found = []
        for (step, way), turned in zip(steps, turned_ways, strict=True):
            ways = np.stack((way, turned, turned, way))
            found.append(2.0 * self.lengths[axis] / ways * step)
        return found

    def limit_variations(self, axis, variations=None):
        """As of a fluid, gently; variations: before and after, by default those of the step."""
        a, b = self.find_variations(axis) if variations is None else variations
        formula = np.vectorize(choose_limit(self.limiter, True))
        line = self.mid_lines[axis]
        found = formula(a, b)
        along = formula(dot(line, a[1:3]), dot(line, b[1:3]))
        across = formula(cross(line, a[1:3]), cross(line, b[1:3]))
        found[1:3] = (along * line + across * turn_left(line)) / dot(line, line)
        return found

    def reconstruct(self):
        self.has_ghosts = True
        self.lines = self.mid_lines["i"], self.mid_lines["j"]
        self.reconstruct_carried()
        super().reconstruct()
        # the force of the stress in the half step
        (xx_x, _, xy_x), (_, yy_y, xy_y) = self.carried_slopes[:, :3]
        self.half[1] += 0.5 * self.dt * (xx_x + xy_y) / self.rho
        self.half[2] += 0.5 * self.dt * (xy_x + yy_y) / self.rho

    def reconstruct_carried(self):
        """Bounded slopes of the fields, and their values at mid-time."""
        values = self.carried
        padded = np.pad(values, ((0, 0), (1, 1), (1, 1)))
        padded[:, 0, 1:-1], padded[:, -1, 1:-1] = (self.carried_ghosts[f"i_{e}"] for e in ENDS)
        padded[:, 1:-1, 0], padded[:, 1:-1, -1] = (self.carried_ghosts[f"j_{e}"] for e in ENDS)
        slopes, half = reference_carried.reconstruct(self, padded, limit)
        # the stress by the rates of the limited velocity
        gradient = self.find_gradient(*(self.limit_velocity(axis) for axis in "ij"))
        rates = Rates(np.swapaxes(gradient, 0, 1))
        held = self.block.state[:, 1:-1, 1:-1], self.block.void_energy
        _, *law = self.find_law(held, values[3], rates.equivalent)
        after, _ = rates.strain_stress(self.stress, (self.modulus, *law), 0.5 * self.dt)
        bears = self.modulus > 0.0
        half[:3] = np.where(bears, half[:3] + (after - self.stress), 0.0)
        slopes[:, :3] = np.where(bears, slopes[:, :3], 0.0)
        self.carried_slopes = slopes
        self.carried_half = half

    def limit_velocity(self, axis):
        """Variations of the velocity by the lengths of cells, limited gently."""
        ways = [2.0 * self.lengths[axis] / way * step[1:3] for step, way in self.find_steps(axis)]
        line = self.mid_lines[axis]
        along, across = (limit(*(part(line, q) for q in ways)) for part in (dot, cross))
        return (along * line + across * turn_left(line)) / dot(line, line)

    def trace_carried(self, points):
        """Fields at points (2, ni, nj), one a cell."""
        way = points - self.centre
        return self.carried_half + np.einsum("cqij,cij->qij", self.carried_slopes, way)

    # --- fluxes ----------------------------------------------------------------------------------

    def find_pressed(self, side):
        """Traces at the faces on one side of each cell, with the normal stress for a pressure; then
        impedance of shear waves, speed along the face and s_nt; by the normal along the axis."""
        axis = side[0]
        take = lower if side.endswith("min") else upper
        normal, _, middle = (take(q, axis) for q in self.faces[axis])
        unit = normal / np.sqrt(dot(normal, normal))
        trace = self.trace(middle)
        s_nn, _, s_nt = resolve(self.trace_carried(middle)[:3], unit)
        trace[P] -= s_nn
        trace[C2] += self.shear_wave
        wave = np.sqrt(trace[0] * self.modulus), dot(trace[1:3], turn_left(unit)), s_nt
        return trace, np.stack(wave)

    def fill_inner_fluxes(self):
        pressed = {side: self.find_pressed(side) for side in ("i_min", "i_max", "j_min", "j_max")}
        self.trace_to = lambda side: pressed[side][0]
        super().fill_inner_fluxes()
        for axis, (normal, sweep, _) in self.faces.items():
            rows = (normal, sweep, self.fluxes[axis], self.speeds[axis])
            normal, sweep, flux, speeds = (upper(lower(q, axis), axis) for q in rows)
            left = [lower(q, axis) for q in pressed[f"{axis}_max"]]
            right = [upper(q, axis) for q in pressed[f"{axis}_min"]]
            stress, along = find_shear_contact(left[1], right[1])
            pull_along(flux, stress, along, normal)
            across = find_contact_speed(left[0], right[0], normal, sweep)
            speeds[...] = make_velocity(across, along, normal)

    # --- the new stress --------------------------------------------------------------------------

    def relax(self, values, new):
        """Fields after the step, from what the mass has brought."""
        nodes = 0.5 * (self.block.nodes + self.block.nodes_new)
        gradient = 0.0
        area = cross(*self.find_mid_lines_of(nodes))
        for axis in "ij":
            start, end = find_edges(nodes, axis)
            normal = np.stack((end[1] - start[1], start[0] - end[0]))
            out = self.speeds[axis][:, None] * normal
            gradient = gradient + flow_out_of(out, axis)
        rates = Rates(gradient / area)
        _, void_energy = new
        law = self.find_law(new, values[3], rates.equivalent)
        stress, strain = rates.strain_stress(values[:3], law, self.dt)
        bears = (law[0] > 0.0) & (void_energy == 0.0)
        return np.stack((*np.where(bears, stress, 0.0), values[3] + np.where(bears, strain, 0.0)))

    @staticmethod
    def find_mid_lines_of(nodes):
        a, b, c, d = find_corners(nodes)
        return 0.5 * ((b + c) - (a + d)), 0.5 * ((d + c) - (a + b))


ENDS = "min", "max"


def flow_out_of(through, axis):
    return upper(through, axis) - lower(through, axis)


def find_shear_contact(left, right):
    """Shear stress and speed along a face between two sides (z, speed, stress) that stick."""
    (z_l, speed_l, stress_l), (z_r, speed_r, stress_r) = left, right
    total = z_l + z_r + 1e-300
    stress = (z_r * stress_l + z_l * stress_r + z_l * z_r * (speed_r - speed_l)) / total
    return stress, (z_l * speed_l + z_r * speed_r + stress_r - stress_l) / total


def pull_along(flux, stress, along, normal):
    """Add to the fluxes (5, ...) what acts along faces."""
    flux[1:3] -= stress * turn_left(normal)
    flux[3] -= stress * along * np.sqrt(dot(normal, normal))


def find_contact_speed(left, right, normal, sweep):
    """Speed of the contact of HLLC across faces."""
    length = np.sqrt(dot(normal, normal))
    w_l, w_r = ((dot(q[1:3], normal) - sweep) / length for q in (left, right))
    c_l, c_r = (np.sqrt(q[C2]) for q in (left, right))
    flow_l = left[0] * (np.minimum(w_l - c_l, w_r - c_r) - w_l)
    flow_r = right[0] * (np.maximum(w_l + c_l, w_r + c_r) - w_r)
    speed = (right[P] - left[P] + flow_l * w_l - flow_r * w_r) / (flow_l - flow_r)
    return speed + sweep / length


def make_velocity(across, along, normal):
    """The velocity of these speeds across and along faces."""
    unit = normal / np.sqrt(dot(normal, normal))
    return across * unit + along * turn_left(unit)


class SolidSide(Side):
    """The faces of one segment; normals and what is along them to the left of these."""

    sticks = property(lambda self: self.segment.kind in ("seam", "periodic") or self.is_bonded)
    is_bonded = property(lambda self: self.segment.kind == "interface" and self.segment.sticks)
    is_clamped = property(lambda self: getattr(self.segment, "clamped", False))

    # --- ghosts ----------------------------------------------------------------------------------

    def fill_ghosts(self, t):
        super().fill_ghosts(t)
        patch = self.patch
        span = slice(self.segment.start, self.segment.stop)
        state = patch.ghosts[self.name][:, span]
        kind = self.segment.kind
        normal = self.find_normal(patch.block.nodes)
        along = turn_left(normal)
        cells = self.take(patch.carried).copy()
        own = resolve(cells[:3], normal)
        if kind in ("seam", "periodic"):
            cells = self.ask(lambda side: side.take(side.patch.carried))
            patch.turns[self.name][span] = self.find_turn()
        elif kind in ("wall", "piston"):
            clamped = self.is_clamped
            cells[:3] = compose((own[0], own[1], own[2] if clamped else -own[2]), normal)
            if clamped:
                wall = np.reshape(self.segment.velocity(t), (2, 1))
                excess = dot(self.take(patch.velocity) - wall, along)
                state[1:3] -= 2.0 * excess * along
        elif kind in ("interface", "free-surface"):
            cells[:3] = compose(self.fill_beyond_contact(t, state, own, normal), normal)
        patch.carried_ghosts[self.name][:, span] = cells

    def find_turn(self):
        """Cosine of the angle between the lines through both cells of a seam."""
        line = self.take(self.patch.mid_lines[self.axis]) * self.sign
        other = self.ask(lambda side: -side.sign * side.take(side.patch.mid_lines[side.axis]))
        return dot(line, other) / np.sqrt(dot(line, line) * dot(other, other))

    def fill_beyond_contact(self, t, state, own, normal):
        """Ghosts `state` beyond a contact, and the components of the stress there (F20.7)."""
        patch = self.patch
        rho, *_, p = cells = self.take(patch.state)
        c2 = self.take(patch.c2)
        pressure, _ = self.solve(SolidSide.find_state_at_face, normal, t)
        rise = 2.0 * (pressure - self.find_state_at_face()[P])
        at_face = self.find_stress_at_face()
        p_face = Side.find_state_at_face(self)[P]
        by_pressure = rise * c2 / (c2 + 4.0 / 3.0 * self.take(patch.modulus) / rho)
        by_stress = rise - by_pressure
        shear, speed = self.find_along(self.find_wave_at_face, normal)
        along = turn_left(normal)
        state[P] = 2.0 * p_face - p + by_pressure
        state[0] = rho + (state[P] - p) / c2
        state[1:3] += 2.0 * (speed - dot(cells[1:3], along)) * along
        return (
            2.0 * at_face[0] - own[0] - by_stress,
            2.0 * at_face[1] - own[1] + 0.5 * by_stress,
            2.0 * shear - own[2],
        )

    def find_state_at_face(self):
        """As of a fluid, with the normal stress and longitudinal waves."""
        state = Side.find_state_at_face(self)
        state[P] -= self.find_stress_at_face()[0]
        state[4] += 4.0 / 3.0 * self.take(self.patch.modulus) / state[0]
        return state

    def find_stress_at_face(self):
        """Components of the stress at the faces, with the slope of the next cell inwards."""
        patch = self.patch
        normal = self.find_normal(patch.block.nodes)
        own, nearer, further = (
            resolve(self.take(patch.stress, depth), normal) for depth in range(3)
        )
        p = [self.take(patch.p, depth) for depth in range(3)]
        stiffness = self.take(patch.rho * patch.c2)
        jump = np.maximum(np.abs(p[0] - p[1]), np.abs(p[1] - p[2])) / stiffness
        inwards = self.axis + ("_max" if self.name.endswith("min") else "_min")
        reach = self.take(patch.reaches[self.name])
        way = 0.5 * (self.take(patch.reaches[inwards]) + self.take(patch.reaches[self.name], 1))
        part = fade(jump, 0.01, 0.05) * 0.5 * reach / way
        step = part * limit(own - nearer, nearer - further)
        return np.where(self.take(patch.modulus) > 0.0, own + step, own)

    def find_wave_at_face(self):
        """Impedance of shear waves, speed and shear stress along the faces, before the step."""
        normal = self.find_normal(self.patch.block.nodes)
        rho, u, v, *_ = Side.find_state_at_face(self)
        z = np.sqrt(rho * self.take(self.patch.modulus))
        return np.stack((z, dot((u, v), turn_left(normal)), self.find_stress_at_face()[2]))

    def find_along(self, find, normal):
        """Shear stress on the faces and speed along them, of waves that `find` finds."""
        wave = find()
        if self.sticks:
            name = find.__name__
            z, speed, stress = self.ask(lambda side: getattr(side, name)())
            return find_shear_contact(wave, (z, -speed, stress))
        z, speed, stress = wave
        with np.errstate(all="ignore"):
            return 0.0 * stress, np.where(z > 0.0, speed - stress / z, speed)

    # --- fluxes ----------------------------------------------------------------------------------

    def find_trace(self):
        """Traces with the normal stress in place of the pressure."""
        return self.take(self.patch.trace_to(self.name))

    def find_wave(self):
        """Impedance of shear waves, speed and stress along the faces at mid-time, outwards."""
        wave = self.take(self.patch.find_pressed(self.name)[1])
        return np.stack((wave[0], self.sign * wave[1], wave[2]))

    def fill_flux(self, t):
        super().fill_flux(t)
        patch = self.patch
        normal, sweep, _ = (self.sign * self.take(q) for q in patch.faces[self.axis])
        length = np.sqrt(dot(normal, normal))
        trace = self.find_trace()
        stress, along = self.find_along(self.find_wave, normal)
        across = sweep / length
        if self.segment.kind in ("seam", "periodic"):
            across = find_contact_speed(trace, self.ask(Side.find_trace), normal, sweep)
        elif self.segment.kind == "outflow":
            _, along, stress = self.find_wave()
            across = dot(trace[1:3], normal) / length
        elif self.is_clamped:
            z, speed, own = self.find_wave()
            along = dot(np.reshape(self.segment.velocity(t), (2, 1)), turn_left(normal)) / length
            stress = own + z * (along - speed)
        outwards = self.sign * self.take(patch.fluxes[self.axis])
        pull_along(outwards, stress, along, normal)
        self.take(patch.fluxes[self.axis])[:4] = self.sign * outwards[:4]
        self.take(patch.speeds[self.axis])[...] = make_velocity(across, along, normal)


def carry(patches, sides):
    """New values of the fields of all patches, with the new stress."""
    carried = reference_carried.carry(patches, sides)
    new = [patch.update() for patch in patches]
    return [patch.relax(*one) for patch, *one in zip(patches, carried, new, strict=True)]
