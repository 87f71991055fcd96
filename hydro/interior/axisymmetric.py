"""The kernels of one step on a row of cells that occur only in axisymmetric flow.

They compute the offsets of the centres of volume along the grid lines and the resulting rotation,
the smoothness of the pressure, and the radial force of the pressure, per depth and as the tension
of rings.  See `hydro.formulas.geometry`, and `hydro.interior.scratch`, whose rules apply here too.
"""

from __future__ import annotations

from shockgrid.hydro.formulas.geometry import compute_centre_offset, lean_lines
from shockgrid.hydro.formulas.reconstruction import compute_line_geometry
from shockgrid.hydro.interior import scratch
from shockgrid.regrid.jit import compiled_once, inlined

# jumps of the pressure over rho c² between neighbours, up to which flow is smooth, and from which
# on it is not at all
SMOOTH_JUMP = 0.5
STRONG_JUMP = 1.5


@compiled_once(allocates=False)
def clear_shift_after(Z, n):
    """The cells after the row are ghosts: their lengths say where their centres are."""
    for k in range(1, n + 1):
        Z[scratch.SHIFT_AFTER + k] = 0.0


@inlined
def find_even_twist(a, b, c, d):
    """a - b + c - d of a cell's corners, opposite ones together, and the mean of their y.

    It is summed in another order than in `find_twist`: bitwise the same for a cell that is turned.
    """
    xa, ya = a
    xb, yb = b
    xc, yc = c
    xd, yd = d
    return ((xa + xc) - (xb + xd), (ya + yc) - (yb + yd)), 0.25 * ((ya + yc) + (yb + yd))


@compiled_once(allocates=False)
def fill_shift_after(Z, n):
    """How far centres of volume lie from the middles of the cells between i + 1 and i + 2.

    By x and y, and along both lines; entry 0, the cell before the first one, included.
    """
    for k in range(n + 1):
        a, b, c, d = scratch.load_corners(Z, scratch.HIGH, scratch.NEXT, k)
        mid_i, mid_j, _ = compute_line_geometry(a, b, c, d)
        mid_i_x, mid_i_y = mid_i
        mid_j_x, mid_j_y = mid_j
        twist, middle = find_even_twist(a, b, c, d)
        x, y = compute_centre_offset(mid_i, mid_j, twist, middle)
        length_i = (mid_i_x * mid_i_x + mid_i_y * mid_i_y) ** 0.5
        length_j = (mid_j_x * mid_j_x + mid_j_y * mid_j_y) ** 0.5
        Z[scratch.OFFSET_X_AFTER + k] = x
        Z[scratch.OFFSET_Y_AFTER + k] = y
        Z[scratch.SHIFT_AFTER + k] = (x * mid_i_x + y * mid_i_y) / length_i
        Z[scratch.SHIFT_J_AFTER + k] = (x * mid_j_x + y * mid_j_y) / length_j


@compiled_once(allocates=False)
def move_shifts(Z, n):
    """Make what `fill_shift_after` has found current."""
    for k in range(1 - scratch.VECTOR_LANES, n + 1 + scratch.VECTOR_LANES):
        Z[scratch.SHIFT_BEFORE + k] = Z[scratch.SHIFT + k]
        Z[scratch.SHIFT + k] = Z[scratch.SHIFT_AFTER + k]
        Z[scratch.SHIFT_J + k] = Z[scratch.SHIFT_J_AFTER + k]
        Z[scratch.OFFSET_X + k] = Z[scratch.OFFSET_X_AFTER + k]
        Z[scratch.OFFSET_Y + k] = Z[scratch.OFFSET_Y_AFTER + k]


@inlined
def compute_plane_area_y(Z, a, b):
    """Radial normal per depth of a face at mid-time; places of x of its nodes, new ones follow."""
    return 0.5 * ((Z[a] - Z[b]) + (Z[a + scratch.TO_X_NEW] - Z[b + scratch.TO_X_NEW]))


@compiled_once(allocates=False)
def fill_lines(Z, n):
    """Lines through the centres of volume, and 1/area between them."""
    for k in range(1, n + 1):
        a, b, c, d = scratch.load_corners(Z, scratch.LOW, scratch.HIGH, k)
        mid_i = Z[scratch.MID_I_X + k], Z[scratch.MID_I_Y + k]
        mid_j = Z[scratch.MID_J_X + k], Z[scratch.MID_J_Y + k]
        twist, middle = find_even_twist(a, b, c, d)
        line_i, line_j = lean_lines(mid_i, mid_j, twist, middle)
        scratch.store_vector(Z, scratch.LEAN_I, k, line_i)
        scratch.store_vector(Z, scratch.LEAN_J, k, line_j)
        Z[scratch.LEAN_INVERSE + k] = 1.0 / (line_i[0] * line_j[1] - line_i[1] * line_j[0])


def make_push(split, pressure_row, flux_row, node_row_a, node_row_b, area_row, push_row):
    """Make the kernel that takes the pressure out of the radial momentum of a row of faces.

    Scratch offsets: `pressure_row` in the fluxes; `flux_row`: of radial momentum; `node_row_a`,
    `node_row_b`: x of the nodes at a face's ends, as in `hydro.interior.faces.make_faces`;
    `area_row`: the normals' y; `push_row`: what is filled, and the row after it.
    """

    hoop_row = push_row + scratch.SCRATCH_SPAN

    @compiled_once(allocates=False)
    def fill_push(Z, n):
        """Radial momentum carried through the faces; the pressure's force per depth and radian."""
        for k in range(1, n + 1):
            plane_area_y = compute_plane_area_y(Z, node_row_a + k, node_row_b + k)
            momentum_y, force, hoop = split(
                Z[flux_row + k], Z[pressure_row + k], Z[area_row + k], plane_area_y
            )
            Z[flux_row + k] = momentum_y
            Z[push_row + k] = force
            Z[hoop_row + k] = hoop

    return fill_push


@compiled_once(allocates=False)
def fill_smooth(Z, n):
    """How smooth the pressure is around the cells, from 1 to 0 (theory F9.5).

    Between the row before and after; to be called before the gradients, which take the steps.
    """
    for k in range(1, n + 1):
        p = Z[scratch.P + k]
        below = abs(Z[scratch.P + k - 1] - p)
        above = abs(Z[scratch.P + k + 1] - p)
        before = abs(Z[scratch.P_STEP + k])
        after = abs(Z[scratch.P_AFTER + k] - p)
        largest_j = below if below > above else above
        largest_i = before if before > after else after
        largest = largest_j if largest_j > largest_i else largest_i
        jump = (largest / (Z[scratch.RHO + k] * Z[scratch.C2 + k]) - SMOOTH_JUMP) / (
            STRONG_JUMP - SMOOTH_JUMP
        )
        jump = jump if jump > 0.0 else 0.0
        jump = jump if jump < 1.0 else 1.0
        Z[scratch.SMOOTH + k] = (1.0 - jump) * (1.0 - jump) * (1.0 + 2.0 * jump)


@inlined
def find_mean(Z, rows, k):
    """Mean over the corners of the old and the new cell k; `rows`: offsets of their rows."""
    low, high, low_new, high_new = rows
    old = (Z[low + k] + Z[low + k + 1]) + (Z[high + k] + Z[high + k + 1])
    new = (Z[low_new + k] + Z[low_new + k + 1]) + (Z[high_new + k] + Z[high_new + k + 1])
    return 0.125 * (old + new)


def make_source_pressure(sound_speed_squared_part):
    """Make the kernel that fills the pressure of the geometric source of a row's cells."""

    @compiled_once(allocates=False)
    def fill_source_pressure(Z, n, parameters):
        """Pressure in the middle of the cell at mid-time; no state of the material: its own.

        The middle of the old and the new cell: where nothing varies along the radius this is the
        pressure that is traced to both radial faces.
        """
        for k in range(1, n + 1):
            x = find_mean(
                Z, (scratch.X_LOW, scratch.X_HIGH, scratch.X_LOW_NEW, scratch.X_HIGH_NEW), k
            )
            y = find_mean(
                Z, (scratch.Y_LOW, scratch.Y_HIGH, scratch.Y_LOW_NEW, scratch.Y_HIGH_NEW), k
            )
            dx = x - Z[scratch.X_CENTRE + k]
            dy = y - Z[scratch.Y_CENTRE + k]
            rho = Z[scratch.RHO_HALF + k] + (Z[scratch.RHO_X + k] * dx + Z[scratch.RHO_Y + k] * dy)
            p = Z[scratch.P_HALF + k] + (Z[scratch.P_X + k] * dx + Z[scratch.P_Y + k] * dy)
            c2 = sound_speed_squared_part(rho, p, parameters)
            p_of_cell = Z[scratch.P + k]
            Z[scratch.SOURCE_P + k] = p if (rho > 0.0) & (c2 > 0.0) else p_of_cell

    return fill_source_pressure
