"""A link: two segments face by face, what each sends the other, and their common line."""

from __future__ import annotations

import numpy as np

from hydro.boundary.linked import Linked
from regrid.errors import BadInput


class Link:
    """Two linked segments, `leader` and `follower`, and how their nodes correspond.

    The follower's nodes, in reverse order when `reverse`, are the leader's plus `shift`.
    """

    def __init__(self, leader: Linked, follower: Linked):
        self.leader, self.follower = leader, follower
        self.segments = [leader, follower]
        one, two = leader.line(leader.block.nodes), follower.line(follower.block.nodes)
        if one.shape != two.shape:
            raise BadInput(
                f"{leader.kind}: {leader} has {one.shape[1] - 1} faces and {follower} has "
                f"{two.shape[1] - 1}; they must be as many"
            )
        misses = [_misfit(one, two[:, ::order], leader.kind == "periodic") for order in (1, -1)]
        self.reverse = misses[1][0] < misses[0][0]
        miss, self.shift = misses[self.reverse]
        if miss > 1e-9:
            raise BadInput(
                f"{leader.kind}: nodes of {leader} and of {follower} do not match "
                f"(they are up to {miss:.1e} of the segment's length apart)"
            )
        follower.leads = False
        self._messages: dict[tuple[int, int], list[tuple]] = {}  # they keep their arrays alive
        leader.partner_law = follower.block.wave_law
        follower.partner_law = leader.block.wave_law
        # make matching nodes the same to the last bit
        two[...] = self.to_follower(one)

    def to_follower(self, line: np.ndarray) -> np.ndarray:
        """Nodes of the leader's line as the follower has them."""
        return (line + self.shift[:, None])[:, :: -1 if self.reverse else 1]

    def swap(self, leading: np.ndarray, following: np.ndarray) -> None:
        """Rows (rows, faces) of either block's perimeter into the other side's inbox."""
        key = id(leading), id(following)
        if key not in self._messages:
            self._messages[key] = self._open(leading, following)
        for message, inbox in self._messages[key]:
            inbox[...] = message

    def _open(self, leading: np.ndarray, following: np.ndarray) -> list[tuple]:
        """Views of what each side sends, and of where the other finds it."""
        order = -1 if self.reverse else 1
        views = []
        pairs = (self.leader, leading, self.follower), (self.follower, following, self.leader)
        for sender, rows, receiver in pairs:
            message = rows[:, sender.first : sender.last][:, ::order]
            inbox = receiver.inbox[: message.shape[0], receiver.first : receiver.last]
            views.append((message, inbox))
        return views

    def swap_line(self) -> None:
        """The leader's new nodes become the follower's."""
        line = self.leader.line(self.leader.block.nodes_new)
        self.follower.line(self.follower.block.nodes_new)[...] = self.to_follower(line)


def _misfit(one: np.ndarray, two: np.ndarray, periodic: bool) -> tuple[float, np.ndarray]:
    """Largest distance of matching nodes over the line's size, and the shift between them."""
    difference = two - one
    shift = difference.mean(axis=1) if periodic else np.zeros(2)
    size = np.ptp(one, axis=1).max()
    return float(np.abs(difference - shift[:, None]).max() / size), shift
