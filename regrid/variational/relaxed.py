"""Nodes that follow a law of speed: the residual of equidistribution, relaxed in `tau` steps.

    dr/dt = d/tau,   H d = -∇J                                                    theory R13.1

J is the functional of `regrid.variational.regridders`, with most of its weight on the volume: its
gradient is the residual of w times area, held in check by smoothness, and H d = -∇J is solved so
that waves of all lengths fade in the same time.  The grid is moved with its sides and then by
the law, for the part `1 - exp(-f/tau)` of d; in a flow `f` is the step over the stable step,
so that a run cut into short steps has the same law.

The trap: the residual of ED2 itself does not do as a law.  It does not see waves along the cells'
diagonals (see `regrid.equidistribution.areas`), which a flow feeds: in a rolling interface such a
grid was crumpled within 1000 steps.  And a grid that integrates a speed depends on its way.

Source: [AndersonTannehillPletcher1984] §10.4; [HuangRenRussell1994].
"""

from __future__ import annotations

import numpy as np

from regrid.errors import BadInput
from regrid.variational.regridders import VariationalRegridder


class NodeSpeedRegridder(VariationalRegridder):
    """Nodes moved along with the sides and towards w times area constant, in about `tau` steps.

    `weight`: see `regrid.equidistribution.weights` ("sides": the density of nodes that the sides
    ask for); `smoothing`: passes over what depends on fields; `boundary`: see
    `regrid.equidistribution.weighted_sides`; `volume`: the weight of w times area against
    smoothness and orthogonality, 1 each.
    """

    name = "node-speed"
    sees_flow = True  # its steps at least

    def __init__(
        self,
        weight="sides",
        tau: float = 3.0,
        volume: float = 10.0,
        boundary: str = "given",
        smoothing: int = 4,
        threads: int = 1,
    ):
        super().__init__(
            volume=volume,
            weight=weight,
            boundary=boundary,
            smoothing=smoothing,
            steps=1,
            tolerance=0.0,
            threads=threads,
        )
        if not tau > 0.0:
            raise BadInput(f"node-speed: tau is {tau}; it must be a positive number of steps")
        self.tau = float(tau)

    @property
    def fraction(self) -> float:
        """Part of the way d that the nodes go in the step to come."""
        return float(-np.expm1(-(self.step_fraction or 1.0) / self.tau))
