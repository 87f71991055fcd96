"""The table `grid` of decks whose axes can follow a fluid (`hydro.convection.tensor_grids`)."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from msgspec import Meta

from problems.deck import DeckTable

AxisKind = Literal["uniform", "clustered", "polevikov", "monitor", "combined"]


class AxisGrid(DeckTable, kw_only=True):
    """Where the nodes of an axis lie, and after what they move."""

    merges = True

    kind: Annotated[
        AxisKind,
        Meta(
            description="uniform; clustered at walls; polevikov: after the speed; monitor: after "
            "gradients; combined: after both"
        ),
    ] = "uniform"
    every: Annotated[
        int, Meta(ge=1, le=2**63 - 1, description="steps between corrections of the grid")
    ] = 1
    relaxation: Annotated[
        float, Meta(gt=0, le=1, description="part of a correction that is made")
    ] = 0.7
    ratio: (
        Annotated[float, Meta(gt=1, description="most of neighbouring steps; left out: usual")]
        | None
    ) = None
    floor: Annotated[
        float, Meta(gt=0, lt=1, description="of the largest speed; a lower one counts as so much")
    ] = 0.02
    strength: Annotated[
        float, Meta(ge=0, description="of the gradient against the uniform grid in the monitor")
    ] = 1.0
    share: Annotated[
        float, Meta(ge=0, le=1, description="of polevikov's density of nodes in the combined one")
    ] = 0.5
    walls: Annotated[
        Literal["both", "low", "high"], Meta(description="where a clustered grid is dense")
    ] = "both"
    clustering: Annotated[
        float, Meta(gt=0, le=20, description="strength of a clustered grid's tanh law")
    ] = 2.0

    def make(self, n: int, low: float = 0.0, high: float = 1.0) -> np.ndarray:
        """The first axis of n steps, shape (n + 1,)."""
        from hydro.convection.tensor_grids import make_axis  # scipy is slow to load

        return make_axis(self.kind, n, low, high, walls=self.walls, clustering=self.clustering)

    def options(self) -> dict[str, Any]:
        """What `correct_axis` is to be told besides the kind."""
        names = ("floor", "ratio", "strength", "share", "relaxation")
        return {name: getattr(self, name) for name in names}
