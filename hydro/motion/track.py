"""Tracks: the polylines on which nodes of walls and open sides slide.

A track is the polyline of a segment's initial nodes; nodes of walls and open sides stay on it while
they slide along it.  Where two tracks continue smoothly into each other at a key node (the end of
an interface on a curved wall), they form one track, so that the key node can pass from one to the
other.  Note: a node moved along the tangent leaves a curved track by the square of its step, and
nothing would ever bring it back.
"""

from __future__ import annotations

import numpy as np

CLOSED_CHORD = 1e-9  # over a track's length: ends so near are one
STRAIGHT_DEPARTURE = 1e-12  # from the chord, over its length, up to which a track is straight


class Track:
    """A polyline `nodes` (2, n) and its arc lengths; closed where it ends at its first node."""

    def __init__(self, nodes: np.ndarray):
        self.set_nodes(nodes)

    def set_nodes(self, nodes: np.ndarray) -> None:
        """Take up another polyline (2, n)."""
        self.nodes = np.ascontiguousarray(nodes)
        self.arc = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(self.nodes)))))
        chord = self.nodes[:, -1] - self.nodes[:, 0]
        length = float(np.hypot(*chord))
        self.closed = length <= CLOSED_CHORD * self.arc[-1]
        self.straight = False
        if not self.closed:
            normal = np.array([-chord[1], chord[0]]) / length**2
            departures = np.abs(normal @ (self.nodes - self.nodes[:, :1]))
            self.straight = bool(departures.max() < STRAIGHT_DEPARTURE)
        chords = np.diff(self.nodes) / np.diff(self.arc)
        self.tangents = np.concatenate([chords[:, :1], chords[:, 1:] + chords[:, :-1],
                                        chords[:, -1:]], axis=1)  # fmt: skip
        self.tangents /= np.hypot(*self.tangents)

    def locate(self, point: np.ndarray) -> float:
        """Arc length of the position on the track nearest to a point."""
        track = self.nodes
        steps = np.diff(track)
        squares = (steps**2).sum(axis=0)
        fraction = ((point[:, None] - track[:, :-1]) * steps).sum(axis=0) / squares
        fraction = np.clip(fraction, 0.0, 1.0)
        miss = ((track[:, :-1] + fraction * steps - point[:, None]) ** 2).sum(axis=0)
        k = int(miss.argmin())
        return float(self.arc[k] + fraction[k] * (self.arc[k + 1] - self.arc[k]))

    def at(self, positions) -> np.ndarray:
        """Points (2, ...) of the track at arc lengths."""
        return np.array([np.interp(positions, self.arc, row) for row in self.nodes])

    def normal(self, position: float) -> tuple[float, float]:
        """Unit normal at an arc length, turning evenly from node to node."""
        step = self.nodes[:, -1] - self.nodes[:, 0]
        if not self.straight:
            step = np.array([np.interp(position, self.arc, row) for row in self.tangents])
        step = step / np.hypot(*step)
        return float(-step[1]), float(step[0])

    def spread(self, start: np.ndarray, end: np.ndarray, spacing: np.ndarray) -> np.ndarray:
        """Nodes (2, n) by a spacing (n,), from 0 to 1, between two points of the track.

        On a closed track that is the full turn from the first point.
        """
        first = self.locate(start)
        last = self.locate(end)
        if self.closed:
            return self.at((first + spacing * self.arc[-1]) % self.arc[-1])
        return self.at(first + spacing * (last - first))


def join_tracks(track: Track, other_track: Track, point: np.ndarray) -> np.ndarray | None:
    """Both as one polyline if they meet at `point` with their ends; None where they do not.

    Also None where the other ends meet too: a closed track has no position to slide to or from.
    """
    size = CLOSED_CHORD * (track.arc[-1] + other_track.arc[-1])

    def meets(track, end):
        return np.abs(track.nodes[:, end] - point).max() <= size

    if not all(meets(each, 0) or meets(each, -1) for each in (track, other_track)):
        return None
    a = track.nodes if meets(track, -1) else track.nodes[:, ::-1]
    b = other_track.nodes if meets(other_track, 0) else other_track.nodes[:, ::-1]
    if np.abs(a[:, 0] - b[:, -1]).max() <= size:
        return None
    return np.concatenate([a, b[:, 1:]], axis=1)
