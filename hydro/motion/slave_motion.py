"""Where the slave's nodes of a sliding contact go: onto the master's moved line, ends included.

An end of the slave is fixed at an end of the master, or it is a contact point: the place where the
free line that goes on from there meets the master.
"""

from __future__ import annotations

import numpy as np

from hydro.motion.key_nodes import KeyNode
from hydro.motion.line import Line
from hydro.sliding.contact import SlidingContact
from hydro.sliding.projection import fill_positions, find_last_crossing
from regrid.curves import compute_arc_lengths, meeting_laws
from regrid.errors import Place, RegridFailure

OPPOSITE_PART = (0.05, 0.95)  # where the parts of a side opposite to a contact point may meet
ARRIVAL = 1.5  # steps' motion before the master's end at which a contact point arrives there


class SlaveMotion:
    """Lays the slave's nodes of one sliding contact on the master's new line.

    For each of the slave's two ends: `key_nodes`, `free_lines` that go on from there, `starts`
    (do those begin there, or end?) and `opposites`, the lines of the sides opposite to those.
    `law`: the spacing law of the slave's nodes, (n + 1,).
    """

    def __init__(self, contact: SlidingContact):
        self.contact = contact
        self.law = contact.first_law
        self.key_nodes: list[KeyNode | None] = [None, None]
        self.free_lines: list[Line | None] = [None, None]
        self.starts = [True, True]
        self.opposites: list[Line | None] = [None, None]

    def lay_nodes(self) -> None:
        """Lay the slave's new nodes on the master's new line; ends first.

        Lines that go on from a contact point must have moved; they are cut at the point.  Raises
        RegridFailure where the contact has shrunk to nothing.
        """
        line = np.ascontiguousarray(self.contact.master.line(new=True))
        old = self.contact.lines[1]
        arc = compute_arc_lengths(line)
        self.contact.fixed_new[:] = self.contact.fixed
        ends = [0.0, 0.0]
        for end in (0, 1):
            node = int(self.contact.fixed[end])
            if node < 0:
                ends[end] = self._find_contact_point(end, line, old[:, -end], arc)
                node = int(self.contact.fixed_new[end])
            if node >= 0:
                ends[end] = arc[node]
        if not ends[1] > ends[0]:
            raise RegridFailure(
                f"sliding {self.contact.name}: the contact has shrunk to nothing",
                cause="contact-lost",
                place=Place(self.contact.slave.segments[0].block.name),
            )
        wanted = ends[0] + self.law * (ends[1] - ends[0])
        points = np.array([np.interp(wanted, arc, row) for row in line])
        shifts = points[:, [0, -1]] - self.contact.slave.new_ends()
        one, other = self.key_nodes
        one.shift(shifts[:, 0])
        if other is not one:
            other.shift(shifts[:, 1])
        self.contact.slave.write_line(points)

    def share_nodes(self) -> None:
        """Spacing laws around contact points, from the old lines' lengths.

        The contact and the free line that goes on from it have the same step where they meet; the
        contact's `refinement` shortens it.
        The side opposite to both gets the same parts, divided where the point is projected onto
        it: the grid lines in between do not shear as the contact point runs.
        """
        line = np.ascontiguousarray(self.contact.slave.line())
        length = float(compute_arc_lengths(line)[-1])
        for end, free in enumerate(self.free_lines):
            if free is None:
                continue
            segment = free.segment
            other = np.ascontiguousarray(segment.line(segment.block.nodes))
            other_length = float(compute_arc_lengths(other)[-1])
            law, other_law = meeting_laws(
                (line.shape[1], other.shape[1]),
                (length, other_length),
                self.contact.refinement,
            )
            self.law = law if end == 1 else (1.0 - law)[::-1]
            own = self.contact.slave.segments[-end]
            flip = self.contact.slave.reversed[-end] != (end == 0)  # does the contact come after?
            first, second = (law, other_law) if not flip else (other_law, law)
            if flip:
                first, second = (1.0 - other_law)[::-1], (1.0 - law)[::-1]
            free.law = second if not flip else first
            opposite = self.opposites[end]
            if opposite is not None and first.size + second.size == opposite.law.size + 1:
                across = opposite.segment.line(own.block.nodes)
                chord = across[:, -1] - across[:, 0]
                point = line[:, -end] - across[:, 0]
                part = float((point @ chord) / (chord @ chord))
                part = min(max(part, OPPOSITE_PART[0]), OPPOSITE_PART[1])
                opposite.law = np.concatenate((part * first, part + (1.0 - part) * second[1:]))

    def _find_contact_point(self, end, line, start, arc) -> float:
        """Arc length on the master's line of the contact point at an end of the slave."""
        free = self.free_lines[end]
        position = None
        if free is not None:
            at_start = self.starts[end]
            away = np.ascontiguousarray(free.moved if at_start else free.moved[:, ::-1])
            k, _, face, part = find_last_crossing(away, line)
            if k >= 0:
                position = arc[face] + part * (arc[face + 1] - arc[face])
                point = line[:, face] + part * (line[:, face + 1] - line[:, face])
                free.cut(at_start, k, point)
        if position is None:
            moved_end = self.contact.slave.line(new=True)[:, [-end]]
            found = np.empty(1)
            fill_positions(line, moved_end, found)
            face = min(int(found[0]), line.shape[1] - 2)
            position = arc[face] + (found[0] - face) * (arc[face + 1] - arc[face])
        was = np.empty(1)
        fill_positions(line, np.reshape(start, (2, 1)), was)
        face = min(int(was[0]), line.shape[1] - 2)
        before = arc[face] + (was[0] - face) * (arc[face + 1] - arc[face])
        goal, node = (arc[-1], line.shape[1] - 1) if end == 1 else (arc[0], 0)
        step = position - before if end == 1 else before - position
        left = abs(goal - position)
        if step > 0.0 and left < ARRIVAL * step:
            self.contact.fixed_new[end] = node
        return float(position)
