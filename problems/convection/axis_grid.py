"""The table `grid` of decks whose axes can follow a fluid (`hydro.convection.tensor_grids`)."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from problems.deck import DeckTable, key

AxisKind = Literal["uniform", "clustered", "polevikov", "monitor", "combined"]


class AxisGrid(DeckTable, kw_only=True):
    """Where the nodes of an axis lie, and after what they move."""

    merges = True

    kind: key(
        AxisKind,
        "uniform; clustered at walls; polevikov: after the speed; monitor: after "
        "gradients; combined: after both",
    ) = "uniform"
    every: key(int, "steps between corrections of the grid", ge=1, le=2**63 - 1) = 1
    relaxation: key(float, "part of a correction that is made", gt=0, le=1) = 0.7
    ratio: key(float, "most of neighbouring steps; left out: usual", gt=1) | None = None
    floor: key(float, "of the largest speed; a lower one counts as so much", gt=0, lt=1) = 0.02
    strength: key(float, "of the gradient against the uniform grid in the monitor", ge=0) = 1.0
    share: key(float, "of polevikov's density of nodes in the combined one", ge=0, le=1) = 0.5
    walls: key(Literal["both", "low", "high"], "where a clustered grid is dense") = "both"
    clustering: key(float, "strength of a clustered grid's tanh law", gt=0, le=20) = 2.0

    def make(self, n: int, low: float = 0.0, high: float = 1.0) -> np.ndarray:
        """The first axis of n steps, shape (n + 1,)."""
        from hydro.convection.tensor_grids import make_axis  # scipy is slow to load

        return make_axis(self.kind, n, low, high, walls=self.walls, clustering=self.clustering)

    def options(self) -> dict[str, Any]:
        """What `correct_axis` is to be told besides the kind."""
        names = ("floor", "ratio", "strength", "share", "relaxation")
        return {name: getattr(self, name) for name in names}
