"""Rows of the arrays for the facets of two lines; the records in which kernels take them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shockgrid.hydro.rows import FLUX_ROWS

# owners (2, facets): the faces of the two lines that a facet belongs to, counted along them; -1 for
# a follower's where there is none
LEADER, FOLLOWER = range(2)

# ends (4, facets): where a facet begins and ends on the leader and on the follower, as positions:
# the number of a face and the part of it that lies behind
LEADER_START, LEADER_STOP, FOLLOWER_START, FOLLOWER_STOP = range(4)
END_ROWS = 4

# geometry (7, facets): area outwards of the leader, swept volume per time, middle, unit normal of
# the curve for which the lines stand
AREA_X, AREA_Y, SWEPT_RATE, FACE_X, FACE_Y, NORMAL_X, NORMAL_Y = range(7)
GEOMETRY_ROWS = 7
AREAS = slice(AREA_X, SWEPT_RATE + 1)
AREA_ROWS = 3

# contact_states (7, facets): whether it is closed (1 or 0), pressure, speed of the facet beyond
# either side's own outwards of the leader, slip speed, velocity with which the leader's line moves
# there
CLOSED, FACET_P, EXCESS_LEADER, EXCESS_FOLLOWER, FACET_SLIP, FACET_U, FACET_V = range(7)
CONTACT_ROWS = 7

# states (7, faces) of a line's cells at their faces, or traces: rho, u, v, p as in `hydro.rows`,
# then sound speed, specific internal energy, c²
STATE_C = 4
STATE_E = 5
TRACE_ROWS = 7

# slopes along a line: unit direction, change of velocity and pressure per length
ALONG_X, ALONG_Y, U_SLOPE, V_SLOPE, P_SLOPE = range(5)
SLOPE_ROWS = 5

# sums (6, faces) over a face's facets, each by its weight: the weights, pressure, speed beyond the
# face's own outwards of it, slip, velocity of the leader's line
WEIGHT, SUM_P, SUM_EXCESS, SUM_SLIP, SUM_U, SUM_V = range(6)
SUM_ROWS = 6


class Facets(NamedTuple):
    """Arrays over the facets of two lines; the first `count` columns of each are in use.

    areas (3, facets): rows AREAS of `geometry`; in axisymmetric flow the same weighted by the
    radius.
    """

    owners: np.ndarray
    ends: np.ndarray
    geometry: np.ndarray
    areas: np.ndarray
    contact_states: np.ndarray


def make_facets(count: int, curved: bool) -> Facets:
    """Arrays for `count` facets; curved: axisymmetric flow."""
    geometry = np.zeros((GEOMETRY_ROWS, count))
    return Facets(
        owners=np.zeros((2, count), dtype=np.int64),
        ends=np.zeros((END_ROWS, count)),
        geometry=geometry,
        areas=np.zeros((AREA_ROWS, count)) if curved else geometry[AREAS],
        contact_states=np.zeros((CONTACT_ROWS, count)),
    )


class ContactLineArrays(NamedTuple):
    """Arrays over the n faces of one of two lines, in its order.

    states (7, n): see above; laws (3, n): `EquationOfState.wave_law` of the materials; middles
    (2, n) of the faces; slopes (5, n) of the states along the line; squares (n,): squared
    lengths of the faces; gap_p (n,): pressure beyond a face where it is free; sums (6, n) over the
    faces' facets, each weighted by its part of the face's length; flux (6, n), outwards; rigid: it
    is a wall, which moves with `velocity` (2,) and has no states.
    """

    states: np.ndarray
    laws: np.ndarray
    middles: np.ndarray
    slopes: np.ndarray
    squares: np.ndarray
    gap_p: np.ndarray
    sums: np.ndarray
    flux: np.ndarray
    rigid: bool
    velocity: np.ndarray


def make_line_arrays(laws: np.ndarray, rigid: bool = False) -> ContactLineArrays:
    """Arrays for a line of faces with these wave laws (3, n); beyond a wall there is no void."""
    count = laws.shape[1]
    return ContactLineArrays(
        states=np.zeros((TRACE_ROWS, count)),
        laws=np.ascontiguousarray(laws, dtype=float),
        middles=np.zeros((2, count)),
        slopes=np.zeros((SLOPE_ROWS, count)),
        squares=np.ones(count),
        gap_p=np.full(count, -np.inf if rigid else 0.0),
        sums=np.zeros((SUM_ROWS, count)),
        flux=np.zeros((FLUX_ROWS, count)),
        rigid=rigid,
        velocity=np.zeros(2),
    )
