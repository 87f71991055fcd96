"""Facets of two lines: which nodes of the leader they cover."""

import numpy as np

from shockgrid.hydro.contacts.facets import fill_facets
from shockgrid.hydro.facets.rows import (
    FOLLOWER_START,
    FOLLOWER_STOP,
    LEADER_START,
    LEADER_STOP,
    make_facets,
)


def test_a_leaders_nodes_are_covered_while_they_lie_under_a_face_of_the_follower():
    leader = np.array([[0.0, 1.0, 2.0, 3.0, 4.0], [0.0, 0.0, 0.0, 0.0, 0.0]])
    facets = make_facets(7, curved=False)
    covered = np.zeros(5, dtype=np.bool_)
    none = np.full(5, -1.0)
    for last, nodes in ((3.5, [1, 2, 3]), (2.5, [1, 2])):
        # one face of the follower, which runs the other way, on the leader from 0.5 to `last`
        follower = np.array([[last, 0.5], [0.0, 0.0]])
        positions = follower[0].copy()
        pins = np.empty((6, 7))
        count = fill_facets(leader, follower, positions, none, False, pins, covered, facets)
        assert np.flatnonzero(covered).tolist() == nodes
        ends = facets.ends[:, :count]
        assert ends[LEADER_START].tolist() == [0.5, *map(float, nodes)]
        assert ends[LEADER_STOP].tolist() == [*map(float, nodes), last]
        assert ends[FOLLOWER_START, 0] == 1.0 and ends[FOLLOWER_STOP, -1] == 0.0
        assert (ends[FOLLOWER_START, 1:] == ends[FOLLOWER_STOP, :-1]).all()
