"""Rows of the arrays for the facets of two lines, and for the faces that they cover."""

from __future__ import annotations

# faces (7, facets): area outwards of the leader, swept volume per time, middle, normal of the curve
AREA_X, AREA_Y, SWEPT_RATE, FACE_X, FACE_Y, NORMAL_X, NORMAL_Y = range(7)
FACE_ROWS = 7
AREAS = slice(AREA_X, SWEPT_RATE + 1)
SOUND_ROW = 4  # row of the sound speed in states at faces and in traces

# owners (2, facets): the faces of the two lines that a facet belongs to, counted along them
LEADER, FOLLOWER = range(2)

# ends (4, facets): where a facet begins and ends on the leader and on the follower, as positions:
# the number of a face and the part of it that lies behind
LEADER_START, LEADER_STOP, FOLLOWER_START, FOLLOWER_STOP = range(4)
END_ROWS = 4

# states (5, facets): is it closed (1 or 0), contact pressure, speed of the contact beyond either
# side's own outwards of the leader, slip speed
CLOSED, FACET_P, EXCESS_LEADER, EXCESS_FOLLOWER, FACET_SLIP = range(5)
FACET_ROWS = 5

# cover (4, faces): part of a face that closed facets cover; over this part the sums of pressure,
# of the contact's speed beyond the face's own outwards of the face, of slip
COVERED, COVER_P, COVER_EXCESS, COVER_SLIP = range(4)
COVER_ROWS = 4
