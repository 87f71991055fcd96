"""Rows of the arrays over the pieces of a sliding contact, by name."""

from __future__ import annotations

from hydro.perimeter.rows import FACE_ROWS

# owners (2, pieces): the master's and the slave's face that a piece belongs to
MASTER, SLAVE = range(2)

# faces of pieces: those of a perimeter's faces, then the unit normal
NORMAL_X, NORMAL_Y = FACE_ROWS, FACE_ROWS + 1
PIECE_FACE_ROWS = FACE_ROWS + 2

# parts (2, pieces): where on the master's face a piece begins and ends, 0 to 1
PART_START, PART_STOP = range(2)

# states of pieces: contact pressure, speed of the contact beyond either side's own, slip speed,
# contact velocity
PIECE_P, PIECE_EXCESS, PIECE_EXCESS_SLAVE, PIECE_SLIP, PIECE_U, PIECE_V = range(6)
PIECE_ROWS = 6

# slopes along a chain: unit direction, change of velocity and pressure per length
ALONG_X, ALONG_Y, U_SLOPE, V_SLOPE, P_SLOPE = range(5)
SLOPE_ROWS = 5
