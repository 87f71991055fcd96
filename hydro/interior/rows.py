"""The phases of one flow step on one row of cells, as loops that the vectoriser takes.

Each phase works on rows of the flat scratch `Z` (see `hydro.interior.scratch`) for the entries
1..n, the m cells of a chunk in whole vectors; `hydro.interior.advance` puts the phases together and
`hydro.interior.traces` has those that need the equation of state.  The traps: a row's input must be
in the scratch before a phase runs, and only `copy_*` touch other arrays; a loop with a long chain
of dependent operations waits for itself, two loops over its halves do not.
"""

from __future__ import annotations

from hydro.formulas.reconstruction import (
    compose_from,
    compute_gradient,
    compute_half_step,
    compute_line_geometry,
    compute_wave_part,
    relax_limit,
    resolve_along,
)
from hydro.interior import scratch as at
from regrid.jit import phase


@phase
def copy_row(source, row, start, count, Z, offset):
    """Z[offset : offset + count] = source[row, start : start + count]."""
    origin = source[row, start : start + count]
    target = Z[offset : offset + count]
    for k in range(count):
        target[k] = origin[k]


@phase
def copy_rows(source, row, start, count, Z, offset):
    """The given row of every component of `source` (components, rows, columns), side by side."""
    for q in range(source.shape[0]):
        copy_row(source[q], row, start, count, Z, offset + q * at.SPAN)


@phase
def copy_back(Z, offset, count, target, row, start):
    """target[row, start : start + count] = Z[offset : offset + count]."""
    origin = Z[offset : offset + count]
    goal = target[row, start : start + count]
    for k in range(count):
        goal[k] = origin[k]


@phase
def shift_rows(Z, n):
    """Make the row after the current one current."""
    for k in range(1 - at.LANES, n + 1 + at.LANES):
        Z[at.X_LOW + k] = Z[at.X_HIGH + k]
        Z[at.Y_LOW + k] = Z[at.Y_HIGH + k]
        Z[at.X_LOW_NEW + k] = Z[at.X_HIGH_NEW + k]
        Z[at.Y_LOW_NEW + k] = Z[at.Y_HIGH_NEW + k]
        Z[at.X_HIGH + k] = Z[at.X_NEXT + k]
        Z[at.Y_HIGH + k] = Z[at.Y_NEXT + k]
        Z[at.RHO + k] = Z[at.RHO_AFTER + k]
        Z[at.U + k] = Z[at.U_AFTER + k]
        Z[at.V + k] = Z[at.V_AFTER + k]
        Z[at.P + k] = Z[at.P_AFTER + k]
        Z[at.LENGTH_BEFORE + k] = Z[at.LENGTH + k]
        Z[at.LENGTH + k] = Z[at.LENGTH_AFTER + k]


@phase
def fill_steps(Z, n):
    """Differences of the states from the current row to the row after it."""
    for k in range(1, n + 1):
        Z[at.RHO_STEP + k] = Z[at.RHO_AFTER + k] - Z[at.RHO + k]
        Z[at.U_STEP + k] = Z[at.U_AFTER + k] - Z[at.U + k]
        Z[at.V_STEP + k] = Z[at.V_AFTER + k] - Z[at.V + k]
        Z[at.P_STEP + k] = Z[at.P_AFTER + k] - Z[at.P + k]


@phase
def fill_length_after(Z, n):
    """Distance between the midpoints of the faces i + 1 and i + 2."""
    for k in range(1, n + 1):
        dx = 0.5 * (
            (Z[at.X_NEXT + k] + Z[at.X_NEXT + k + 1]) - (Z[at.X_HIGH + k] + Z[at.X_HIGH + k + 1])
        )
        dy = 0.5 * (
            (Z[at.Y_NEXT + k] + Z[at.Y_NEXT + k + 1]) - (Z[at.Y_HIGH + k] + Z[at.Y_HIGH + k + 1])
        )
        Z[at.LENGTH_AFTER + k] = (dx * dx + dy * dy) ** 0.5


@phase
def fill_length_below(Z):
    """Length along j of the cell before the row's first one (entry 0)."""
    mjx = 0.5 * ((Z[at.X_LOW + 1] + Z[at.X_HIGH + 1]) - (Z[at.X_LOW] + Z[at.X_HIGH]))
    mjy = 0.5 * ((Z[at.Y_LOW + 1] + Z[at.Y_HIGH + 1]) - (Z[at.Y_LOW] + Z[at.Y_HIGH]))
    Z[at.LENGTH_J] = (mjx * mjx + mjy * mjy) ** 0.5


def make_geometry(weigh):
    """Phase that fills what the row's cells are on the old grid; `weigh`: `Geometry.volume`."""

    @phase
    def fill_geometry(Z, n):
        """Line vectors, 1/area, volume and length along j of the row's cells."""
        for k in range(1, n + 1):
            xa, ya = Z[at.X_LOW + k], Z[at.Y_LOW + k]
            xb, yb = Z[at.X_HIGH + k], Z[at.Y_HIGH + k]
            xc, yc = Z[at.X_HIGH + k + 1], Z[at.Y_HIGH + k + 1]
            xd, yd = Z[at.X_LOW + k + 1], Z[at.Y_LOW + k + 1]
            mix, miy, mjx, mjy, area = compute_line_geometry(xa, ya, xb, yb, xc, yc, xd, yd)
            Z[at.MI_X + k] = mix
            Z[at.MI_Y + k] = miy
            Z[at.MJ_X + k] = mjx
            Z[at.MJ_Y + k] = mjy
            Z[at.VOLUME + k] = weigh(
                area,
                mix,
                miy,
                mjx,
                mjy,
                (xa - xb) + (xc - xd),
                (ya - yb) + (yc - yd),
                0.25 * ((ya + yc) + (yb + yd)),
            )
            Z[at.INVERSE + k] = 1.0 / area
            Z[at.LENGTH_J + k] = (mjx * mjx + mjy * mjy) ** 0.5

    return fill_geometry


def make_faces(compute_face, node_a, node_b, target):
    """Phase that fills normal times area, swept volume per time and centre of a row of faces.

    `compute_face`: `Geometry.face`; `node_a, node_b`: scratch offsets of x of the nodes at a face's
    ends, its normal to the right of the way from a to b (y, and the new x and y follow at the next
    rows); `target`: offset of the normal's x.  Offsets are constants of the phase: the vectoriser
    needs to know them.
    """

    @phase
    def fill_faces(Z, n, inverse_dt):
        """Faces at mid-time (docs/theory.md, geometric conservation)."""
        for k in range(1, n + 1):
            area_x, area_y, sweep, x, y = compute_face(
                Z[node_a + k],
                Z[node_a + at.SPAN + k],
                Z[node_b + k],
                Z[node_b + at.SPAN + k],
                Z[node_a + 2 * at.SPAN + k],
                Z[node_a + 3 * at.SPAN + k],
                Z[node_b + 2 * at.SPAN + k],
                Z[node_b + 3 * at.SPAN + k],
                inverse_dt,
            )
            Z[target + k] = area_x
            Z[target + at.SPAN + k] = area_y
            Z[target + 2 * at.SPAN + k] = sweep
            Z[target + 3 * at.SPAN + k] = x
            Z[target + 4 * at.SPAN + k] = y

    return fill_faces


def make_weights(compute):
    """Phase that fills the weights of differences; `compute`: `Geometry.weights`."""

    @phase
    def fill_weights(Z, n):
        """Factors that turn differences to the four neighbours into variations over a cell."""
        for k in range(1, n + 1):
            before, after = compute(
                Z[at.LENGTH_BEFORE + k],
                Z[at.SHIFT_BEFORE + k],
                Z[at.LENGTH + k],
                Z[at.SHIFT + k],
                Z[at.LENGTH_AFTER + k],
                Z[at.SHIFT_AFTER + k],
            )
            below, above = compute(
                Z[at.LENGTH_J + k - 1],
                Z[at.SHIFT_J + k - 1],
                Z[at.LENGTH_J + k],
                Z[at.SHIFT_J + k],
                Z[at.LENGTH_J + k + 1],
                Z[at.SHIFT_J + k + 1],
            )
            Z[at.WEIGHT_BEFORE + k] = before
            Z[at.WEIGHT_AFTER + k] = after
            Z[at.WEIGHT_BELOW + k] = below
            Z[at.WEIGHT_ABOVE + k] = above

    return fill_weights


def make_gradients(limit, value, after, step, target):
    """Phase that fills the gradient of one quantity with limited variations along both lines.

    Scratch offsets: `value`, `after`: the quantity in this row and the one after; `step`: its
    difference to the row before, which becomes that of the row after; `target`: d/dx (d/dy
    follows).
    """

    @phase
    def fill_gradients(Z, n):
        """Gradient of one quantity."""
        for k in range(1, n + 1):
            here = Z[value + k]
            step_after = Z[after + k] - here
            along_i = limit(
                Z[step + k] * Z[at.WEIGHT_BEFORE + k], step_after * Z[at.WEIGHT_AFTER + k]
            )
            along_j = limit(
                (here - Z[value + k - 1]) * Z[at.WEIGHT_BELOW + k],
                (Z[value + k + 1] - here) * Z[at.WEIGHT_ABOVE + k],
            )
            gradient_x, gradient_y = compute_gradient(
                along_i,
                along_j,
                Z[at.MI_X + k],
                Z[at.MI_Y + k],
                Z[at.MJ_X + k],
                Z[at.MJ_Y + k],
                Z[at.INVERSE + k],
            )
            Z[step + k] = step_after
            Z[target + k] = gradient_x
            Z[target + at.SPAN + k] = gradient_y

    return fill_gradients


def make_velocity_gradients(limit, low_mach):
    """Phase that fills the velocity's gradients, limited along and across each grid line.

    With `low_mach`, where the flow turns and neither compresses nor jumps, the slopes are the plain
    means of both differences (`compute_wave_part`): a limiter would take every crest of the speed
    for a shock.
    """

    @phase
    def fill_velocity_gradients(Z, n):
        """Gradients of both components; the steps become those to the row after."""
        for k in range(1, n + 1):
            mix = Z[at.MI_X + k]
            miy = Z[at.MI_Y + k]
            mjx = Z[at.MJ_X + k]
            mjy = Z[at.MJ_Y + k]
            inverse = Z[at.INVERSE + k]
            square_i = mix * mix + miy * miy
            square_j = mjx * mjx + mjy * mjy
            scale = 1.0 / (square_i * square_j)
            u = Z[at.U + k]
            v = Z[at.V + k]
            u_after = Z[at.U_AFTER + k] - u
            v_after = Z[at.V_AFTER + k] - v
            weight = Z[at.WEIGHT_BEFORE + k]
            u_a = Z[at.U_STEP + k] * weight
            v_a = Z[at.V_STEP + k] * weight
            weight = Z[at.WEIGHT_AFTER + k]
            u_b = u_after * weight
            v_b = v_after * weight
            weight = Z[at.WEIGHT_BELOW + k]
            u_c = (u - Z[at.U + k - 1]) * weight
            v_c = (v - Z[at.V + k - 1]) * weight
            weight = Z[at.WEIGHT_ABOVE + k]
            u_d = (Z[at.U + k + 1] - u) * weight
            v_d = (Z[at.V + k + 1] - v) * weight
            Z[at.U_STEP + k] = u_after
            Z[at.V_STEP + k] = v_after
            wave_part = 1.0
            if low_mach:
                wave_part = compute_wave_part(
                    u_a,
                    v_a,
                    u_b,
                    v_b,
                    u_c,
                    v_c,
                    u_d,
                    v_d,
                    mix,
                    miy,
                    mjx,
                    mjy,
                    inverse,
                    Z[at.C2 + k],
                )
            along, across = resolve_along(u_a, v_a, mix, miy)
            along_after, across_after = resolve_along(u_b, v_b, mix, miy)
            u_i, v_i = compose_from(
                limit(along, along_after), limit(across, across_after), mix, miy, scale * square_j
            )
            along, across = resolve_along(u_c, v_c, mjx, mjy)
            along_after, across_after = resolve_along(u_d, v_d, mjx, mjy)
            u_j, v_j = compose_from(
                limit(along, along_after), limit(across, across_after), mjx, mjy, scale * square_i
            )
            u_i = relax_limit(u_i, u_a, u_b, wave_part)
            v_i = relax_limit(v_i, v_a, v_b, wave_part)
            u_j = relax_limit(u_j, u_c, u_d, wave_part)
            v_j = relax_limit(v_j, v_c, v_d, wave_part)
            u_x, u_y = compute_gradient(u_i, u_j, mix, miy, mjx, mjy, inverse)
            v_x, v_y = compute_gradient(v_i, v_j, mix, miy, mjx, mjy, inverse)
            Z[at.U_X + k] = u_x
            Z[at.U_Y + k] = u_y
            Z[at.V_X + k] = v_x
            Z[at.V_Y + k] = v_y
            Z[at.WAVE_PART_BEFORE + k] = Z[at.WAVE_PART + k]
            Z[at.WAVE_PART + k] = wave_part

    return fill_velocity_gradients


def make_half_step(spread, move_centre):
    """Phase that predicts; `Geometry.half_step` and `Geometry.centre`."""

    @phase
    def fill_half_step(Z, n, half_dt):
        """Primitive state at mid-time at the old centres of the cells."""
        for k in range(1, n + 1):
            rho, u, v, p = compute_half_step(
                Z[at.RHO + k],
                Z[at.U + k],
                Z[at.V + k],
                Z[at.P + k],
                Z[at.C2 + k],
                Z[at.RHO_X + k],
                Z[at.RHO_Y + k],
                Z[at.U_X + k],
                Z[at.U_Y + k],
                Z[at.V_X + k],
                Z[at.V_Y + k],
                Z[at.P_X + k],
                Z[at.P_Y + k],
                half_dt,
            )
            x, y = move_centre(
                0.25
                * (
                    (Z[at.X_LOW + k] + Z[at.X_LOW + k + 1])
                    + (Z[at.X_HIGH + k] + Z[at.X_HIGH + k + 1])
                ),
                0.25
                * (
                    (Z[at.Y_LOW + k] + Z[at.Y_LOW + k + 1])
                    + (Z[at.Y_HIGH + k] + Z[at.Y_HIGH + k + 1])
                ),
                Z[at.MI_X + k],
                Z[at.MI_Y + k],
                Z[at.MJ_X + k],
                Z[at.MJ_Y + k],
            )
            rho, p = spread(rho, p, Z[at.RHO + k], Z[at.V + k], Z[at.C2 + k], y, half_dt)
            Z[at.RHO_HALF + k] = rho
            Z[at.U_HALF + k] = u
            Z[at.V_HALF + k] = v
            Z[at.P_HALF + k] = p
            Z[at.X_CENTRE + k] = x
            Z[at.Y_CENTRE + k] = y

    return fill_half_step


def make_gather(weigh, push):
    """Phase that closes a row's account but for one side; `Geometry.volume`, `Geometry.source`."""

    @phase
    def gather_flux(Z, n, dt):
        """Conserved quantities less the fluxes known so far, and the source; the new cells."""
        for k in range(1, n + 1):
            volume = Z[at.VOLUME + k]
            rho = Z[at.RHO + k]
            u = Z[at.U + k]
            v = Z[at.V + k]
            mass = volume * rho
            Z[at.MASS + k] = mass - dt * (
                (Z[at.FLUX_J_MASS + k + 1] - Z[at.FLUX_J_MASS + k]) - Z[at.FLUX_I_MASS + k]
            )
            Z[at.MOMENTUM_X + k] = mass * u - dt * (
                (Z[at.FLUX_J_X + k + 1] - Z[at.FLUX_J_X + k]) - Z[at.FLUX_I_X + k]
            )
            momentum_y = mass * v - dt * (
                (Z[at.FLUX_J_Y + k + 1] - Z[at.FLUX_J_Y + k]) - Z[at.FLUX_I_Y + k]
            )
            Z[at.ENERGY + k] = mass * (Z[at.E + k] + 0.5 * (u * u + v * v)) - dt * (
                (Z[at.FLUX_J_ENERGY + k + 1] - Z[at.FLUX_J_ENERGY + k]) - Z[at.FLUX_I_ENERGY + k]
            )
            xa, ya = Z[at.X_LOW_NEW + k], Z[at.Y_LOW_NEW + k]
            xb, yb = Z[at.X_HIGH_NEW + k], Z[at.Y_HIGH_NEW + k]
            xc, yc = Z[at.X_HIGH_NEW + k + 1], Z[at.Y_HIGH_NEW + k + 1]
            xd, yd = Z[at.X_LOW_NEW + k + 1], Z[at.Y_LOW_NEW + k + 1]
            mix, miy, mjx, mjy, area = compute_line_geometry(xa, ya, xb, yb, xc, yc, xd, yd)
            Z[at.MOMENTUM_Y + k] = push(
                momentum_y,
                dt * Z[at.HOOP + k],
                Z[at.MI_X + k],
                Z[at.MI_Y + k],
                Z[at.MJ_X + k],
                Z[at.MJ_Y + k],
                mix,
                miy,
                mjx,
                mjy,
            )
            Z[at.MI_X_NEW + k] = mix
            Z[at.MI_Y_NEW + k] = miy
            Z[at.MJ_X_NEW + k] = mjx
            Z[at.MJ_Y_NEW + k] = mjy
            Z[at.VOLUME_NEW + k] = weigh(
                area,
                mix,
                miy,
                mjx,
                mjy,
                (xa - xb) + (xc - xd),
                (ya - yb) + (yc - yd),
                0.25 * ((ya + yc) + (yb + yd)),
            )
            Z[at.W_X + k] = 0.25 * (
                ((xa - Z[at.X_LOW + k]) + (xd - Z[at.X_LOW + k + 1]))
                + ((xb - Z[at.X_HIGH + k]) + (xc - Z[at.X_HIGH + k + 1]))
            )
            Z[at.W_Y + k] = 0.25 * (
                ((ya - Z[at.Y_LOW + k]) + (yd - Z[at.Y_LOW + k + 1]))
                + ((yb - Z[at.Y_HIGH + k]) + (yc - Z[at.Y_HIGH + k + 1]))
            )

    return gather_flux


def make_rates(invert_area):
    """Phase that finds how long a step may be; `invert_area`: `Geometry.inverse_area`."""

    @phase
    def fill_rates(Z, n, inverse_dt):
        """Largest rate (1/time to cross a cell: the CFL limit) and least c² of finished rows."""
        for k in range(1, n + 1):
            c2 = Z[at.C2_NEW + k]
            mix = Z[at.MI_X_NEW + k]
            miy = Z[at.MI_Y_NEW + k]
            mjx = Z[at.MJ_X_NEW + k]
            mjy = Z[at.MJ_Y_NEW + k]
            inverse = invert_area(Z[at.INVERSE_NEW + k], mix, miy, mjx, mjy)
            ux = Z[at.U_NEW + k] - Z[at.W_X + k] * inverse_dt
            uy = Z[at.V_NEW + k] - Z[at.W_Y + k] * inverse_dt
            convection = abs(ux * mjy - uy * mjx) + abs(ux * miy - uy * mix)
            sound = (c2 * (mjx * mjx + mjy * mjy)) ** 0.5 + (c2 * (mix * mix + miy * miy)) ** 0.5
            rate = (convection + sound) * inverse
            most = Z[at.MOST_RATE + k]
            Z[at.MOST_RATE + k] = rate if rate > most else most
            real = (Z[at.RHO_NEW + k] > 0.0) & (inverse > 0.0)
            c2 = c2 if real else -1.0
            least = Z[at.LEAST_C2 + k]
            Z[at.LEAST_C2 + k] = least if least < c2 else c2

    return fill_rates


@phase
def find_smeared(Z, m):
    """Whether the HLL switch of a cell of this row is on."""
    for k in range(1, m + 1):
        if Z[at.SMEAR + k] > 0.0:
            return True
    return False
