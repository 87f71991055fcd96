"""The rim of a block: its cells and faces along the four sides, as one array with named rows.

The faces are numbered consecutively in the order of SIDE_NAMES, on each side by increasing i or j.
Each quantity of a face (its cell, ghost, traces, contact state, flux) is one row (2 (ni + nj),) of
`Rim.rows`.  Python code uses rows as attributes, `rim.rho`, `rim.p_star`; kernels take `rim.rows`
and index it by the constants of this module: `rim[P_STAR, k]`.  Note: faces towards -i and -j have
outward normals, too.
"""

from __future__ import annotations

from itertools import count
from typing import Protocol

import numpy as np

from shockgrid.regrid.jit import compiled_once, inlined
from shockgrid.regrid.sides import find_node

_next = count()


def _rows(number: int) -> list[int]:
    return [next(_next) for _ in range(number)]


# the cells: state and sound speed, length across the side (twice the way to the face)
RHO, U, V, P, C, LENGTH = _rows(6)
# the same state and sound speed at the face: extrapolated where the face goes with the flow
RHO_FACE, U_FACE, V_FACE, P_FACE, C_FACE = _rows(5)
# the next cell inwards: its velocity, and the way to its centre along the grid line
U_NEXT, V_NEXT, DISTANCE_NEXT = _rows(3)
# the ghosts beyond the faces
RHO_GHOST, U_GHOST, V_GHOST, P_GHOST, LENGTH_GHOST = _rows(5)
# the cells at mid-time: state, gradients, centre; c² and energy if failed (else WHOLE_CELL_MARK) at
# the old time, HLL switch, acoustic weight
RHO_HALF, U_HALF, V_HALF, P_HALF = _rows(4)
RHO_X, RHO_Y, U_X, U_Y, V_X, V_Y, P_X, P_Y = _rows(8)
X_CELL, Y_CELL, C2, VOIDED_ENERGY, HLL, ACOUSTIC = _rows(6)
# traces: where on the faces, state, sound speed, internal energy, c², part of it that may leave
X_TRACE, Y_TRACE = _rows(2)
RHO_TRACE, U_TRACE, V_TRACE, P_TRACE, C_TRACE, E_TRACE, C2_TRACE = _rows(7)
PART_TRACE = next(_next)
# open faces: the state beyond them
RHO_BEYOND, U_BEYOND, V_BEYOND, P_BEYOND, C_BEYOND, E_BEYOND, C2_BEYOND = _rows(7)
PART_BEYOND = next(_next)
# contact states: pressure, speed outwards, velocity, slip
P_STAR, W_STAR, U_STAR, V_STAR, SLIP = _rows(5)
# what acts on an impermeable face besides the material beyond: the jump of the pressure by surface
# tension, inside less outside; the pressure of gas in a void; and a force on the block, besides all
# pressure, as the flux is: per depth or per radian
JUMP, VOID_P, TRACTION_X, TRACTION_Y = _rows(4)
# the faces: outward normal times length, swept area per time (outwards), middle
NX, NY, SWEEP, X, Y = _rows(5)
# what flux passes through: the same in plane flow, else weighted by the radius
AREA_X, AREA_Y, SWEPT, X_AREA, Y_AREA = _rows(5)
# outward fluxes: the rows of a flux of `hydro.rows`
MASS, MOMENTUM_X, MOMENTUM_Y, ENERGY, PUSH, HOOP = _rows(6)
# of solids: vectors of the lines through the cells, away from the sides inwards; cosines of the
# angles by which these lines turn beyond the faces
LINE_X, LINE_Y, TURN_GHOST = _rows(3)

ROWS = next(_next)

# after these, for each carried field (`hydro.carried`): its value in the cell, in the ghost, traced
# to the face, beyond an open face; what goes out, rate of mass times the value beyond the cell's
CARRIED_CELL, CARRIED_GHOST, CARRIED_TRACE, CARRIED_BEYOND, CARRIED_FLUX = range(5)
CARRIED_ROWS = 5
_NAMES = {name.lower(): row for name, row in vars().items() if name.isupper()}
for _name in [name for name in _NAMES if name.startswith(("rows", "carried"))]:
    _NAMES.pop(_name)

# rows that are taken together
STATE = slice(RHO, P + 1)
AT_FACE = slice(RHO_FACE, C_FACE + 1)  # rho, u, v, p, c
GHOST = slice(RHO_GHOST, P_GHOST + 1)
TRACE = slice(RHO_TRACE, C2_TRACE + 1)  # rho, u, v, p, c, e, c²
BEYOND = slice(RHO_BEYOND, C2_BEYOND + 1)
CONTACT = slice(P_STAR, SLIP + 1)
TRACTION = slice(TRACTION_X, TRACTION_Y + 1)
NORMAL = slice(NX, NY + 1)
AREA = slice(AREA_X, AREA_Y + 1)
AREAS = slice(AREA_X, SWEPT + 1)
AREA_CENTRE = slice(X_AREA, Y_AREA + 1)
FLUX = slice(MASS, HOOP + 1)


class FaceRange(Protocol):
    """Faces of a rim that follow each other, such as those of a segment."""

    first: int
    last: int


class Rim:
    """Rows of a rim by name: `rim.rho` is the row RHO of `rows` (ROWS, faces).

    `rim[faces]` has the faces of a segment alone; its rows are views of the whole.
    """

    def __init__(self, rows: np.ndarray):
        self.rows = rows

    def __getattr__(self, name: str) -> np.ndarray:
        if name not in _NAMES:
            raise AttributeError(f"a rim has no row {name!r}")
        row = self.rows[_NAMES[name]]
        setattr(self, name, row)  # found without asking from now on
        return row

    def __getitem__(self, faces: FaceRange) -> Rim:
        return Rim(self.rows[:, faces.first : faces.last])

    def get_carried(self, carried_row: int) -> np.ndarray:
        """A view (fields, faces) of a row of all carried fields, such as CARRIED_GHOST."""
        return self.rows[ROWS + carried_row :: CARRIED_ROWS]

    @property
    def faces(self) -> int:
        """How many there are."""
        return self.rows.shape[1]


def make_rim(faces: int, carried: int = 0) -> Rim:
    """A rim of so many faces, of a block with so many carried fields.

    The ghosts beyond have lengths before they are filled.
    """
    rows = np.zeros((ROWS + CARRIED_ROWS * carried, faces))
    # what comes in from beyond an open side is not withheld
    rows[PART_BEYOND] = 1.0
    rows[LENGTH_GHOST] = 1.0
    rows[TURN_GHOST] = 1.0
    return Rim(rows)


# --- carried fields -------------------------------------------------------------------------------


@inlined
def find_carried_row(field):
    """The first row of a carried field, by its number."""
    return ROWS + CARRIED_ROWS * field


@inlined
def count_carried(rim):
    """How many carried fields the rows of a rim have."""
    return (rim.shape[0] - ROWS) // CARRIED_ROWS


# --- how faces are numbered -----------------------------------------------------------------------


@inlined
def find_first_face(side, ni, nj):
    """The first face of a side, by its number in SIDE_NAMES."""
    return side * nj if side < 2 else 2 * nj + (side - 2) * ni


@inlined
def find_face(face, ni, nj):
    """Side and position along it of a face of the rim."""
    side = (1 if face >= nj else 0) + (1 if face >= 2 * nj else 0)
    side += 1 if face >= 2 * nj + ni else 0
    return side, face - find_first_face(side, ni, nj)


@inlined
def find_ends(face, ni, nj):
    """Side of a face of the rim, and the nodes (i, j) at its ends."""
    side, k = find_face(face, ni, nj)
    i, j = find_node(side, k, 0, ni, nj)
    i_end, j_end = find_node(side, k + 1, 0, ni, nj)
    return side, i, j, i_end, j_end


@compiled_once
def find_cell_of_face(face, ni, nj):
    """Side and cell (i, j) of a face of the rim."""
    side, k = find_face(face, ni, nj)
    i, j = find_node(side, k, 0, ni - 1, nj - 1)
    return side, i, j


@inlined
def find_excess(excess, i, j, ni, nj):
    """Volume of a cell beyond its straight faces, of `excess` (faces,)."""
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
