"""How the faces along a block's four sides are numbered, and the rows of the arrays over them.

The faces are numbered side by side in the order of SIDES, each side by rising i or j; the arrays
have shape (rows, 2 (ni + nj)).
"""

from __future__ import annotations

from regrid.jit import compiled_once, inlined

SIDES = ("i_min", "i_max", "j_min", "j_max")
# rows of the arrays over the faces of a perimeter, shape (rows, 2 (ni + nj)); where a state comes
# first its rows are RHO, U, V, P of `hydro.rows`

# cells: state, sound speed, length across the side; the same state extrapolated to the
# face
CELL_C, CELL_LENGTH = 4, 5
AT_FACE = slice(6, 11)  # in the order of the rows before it, without the length
CELL_ROWS = 11

# ghosts: state and length
GHOST_LENGTH = 4
GHOST_ROWS = 5

# faces: outward normal times area, swept volume per time (outwards), midpoint
AREA_X, AREA_Y, SWEPT_RATE, FACE_X, FACE_Y = range(5)
NORMAL = slice(AREA_X, SWEPT_RATE)
AREAS = slice(AREA_X, FACE_X)  # all that flux passes through
MIDPOINT = slice(FACE_X, FACE_Y + 1)
FACE_ROWS = 5

# traces: state, internal energy, sound speed, HLL switch, acoustic weight, c²
TRACE_E, TRACE_C, TRACE_HLL, TRACE_ACOUSTIC, TRACE_C2 = range(4, 9)
TRACE_ROWS = 9

# prediction: state at mid-time, its gradients, centre, HLL switch, state at the old time, c² and
# void energy there, acoustic weight
RHO_HALF, U_HALF, V_HALF, P_HALF = range(4)
RHO_X, RHO_Y, U_X, U_Y, V_X, V_Y, P_X, P_Y = range(4, 12)
CENTRE_X, CENTRE_Y = 12, 13
HLL_SWITCH = 14
RHO_OLD, U_OLD, V_OLD, P_OLD, C2_OLD, VOID_OLD = range(15, 21)
ACOUSTIC_WEIGHT = 21
PREDICTION_ROWS = 22

# surface: contact state at a face: pressure, normal speed (outwards), velocity, slip speed
SURFACE_P, SURFACE_SPEED, SURFACE_U, SURFACE_V, SLIP = range(5)
SURFACE_VELOCITY = slice(SURFACE_U, SLIP)
SURFACE_ROWS = 5


@compiled_once
def find_face(face, ni, nj):
    """Side and position along it of a face of the perimeter."""
    if face < nj:
        return 0, face
    if face < 2 * nj:
        return 1, face - nj
    if face < 2 * nj + ni:
        return 2, face - 2 * nj
    return 3, face - 2 * nj - ni


@compiled_once
def find_cell(face, ni, nj):
    """Side and cell (i, j) of a face of the perimeter."""
    side, k = find_face(face, ni, nj)
    if side == 0:
        return side, 0, k
    if side == 1:
        return side, ni - 1, k
    if side == 2:
        return side, k, 0
    return side, k, nj - 1


@inlined
def find_excess(excess, i, j, ni, nj):
    """Volume of a cell beyond its straight faces."""
    volume = 0.0
    if i == 0:
        volume += excess[j]
    if i == ni - 1:
        volume += excess[nj + j]
    if j == 0:
        volume += excess[2 * nj + i]
    if j == nj - 1:
        volume += excess[2 * nj + ni + i]
    return volume
