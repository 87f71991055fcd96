"""How the nodes of a segment move; `hydro.motion.line` has a class for each but FOLLOW."""

from __future__ import annotations

from enum import Enum


class NodeMotion(Enum):
    """What rules the nodes of a segment."""

    FLOW = "they go with the contact speeds of their faces"
    GIVEN = "they go with a given velocity"
    SLIDE = "they stay on their first line and are spread between its ends"
    JOIN = "they are spread between the ends, which nothing holds to a line"
    FOLLOW = "they are laid on the master line of a sliding contact"
