"""How the faces along a block's four sides are numbered, and the rows of the arrays over them.

The faces are numbered side by side in the order of SIDES, each side by rising i or j; the arrays
have shape (rows, 2 (ni + nj)).
"""

from __future__ import annotations

from regrid.jit import phase

SIDES = ("i_min", "i_max", "j_min", "j_max")
# rows of the arrays over the faces of a perimeter, shape (rows, 2 (ni + nj))
CELL_ROWS = (
    "rho", "u", "v", "p", "c", "length",
    "rho_at_face", "u_at_face", "v_at_face", "p_at_face", "c_at_face", "in_shock",
)  # fmt: skip
AT_FACE = slice(6, 11)  # the cell's state carried on to the face, in the order of the first rows
IN_SHOCK = 11
FACE_ROWS = ("area_x", "area_y", "sweep", "x", "y")
TRACE_ROWS = ("rho", "u", "v", "p", "e", "c", "smear", "wave_part")
PREDICTION_ROWS = 22
CELL_C, TRACE_C = 4, 5  # rows of the sound speed
SOUND_ROW = {"cells": 4, "traces": 5}


@phase
def find_face(face, ni, nj):
    """Side and place along it of a face of the perimeter."""
    if face < nj:
        return 0, face
    if face < 2 * nj:
        return 1, face - nj
    if face < 2 * nj + ni:
        return 2, face - 2 * nj
    return 3, face - 2 * nj - ni


@phase
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
