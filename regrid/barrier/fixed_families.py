"""The barrier regridder with a family of straight lines chosen by name.

"barrier" weighs the two families of straight lines by the bend of the sides; here one of them, or
both evenly, is fixed (theory R4).  The trap: a family that does not start on the side that
deforms leaves the first grid line far from it, as does an even mixture of both.
"""

from __future__ import annotations

from regrid.barrier.regridder import COST_WEIGHT, BarrierRegridder


class _FixedFamily(BarrierRegridder):
    """Base: `BarrierRegridder` with its `family` given."""

    fixed: str | tuple[float, float] = "auto"

    def __init__(
        self,
        epsilon: float | None = None,
        method: str = "newton",
        edge_lengths: str = "conditional",
        area_weight: float = 2.0,
        cost_weight: float = COST_WEIGHT,
        threads: int = 1,
    ):
        super().__init__(
            epsilon=epsilon,
            method=method,
            edge_lengths=edge_lengths,
            family=self.fixed,
            area_weight=area_weight,
            cost_weight=cost_weight,
            threads=threads,
        )


class StraightAlongI(_FixedFamily):
    """The barrier with lines j = const straight.

    The family of the paper, kappa = 0 of theory R4.
    """

    fixed = "i"


class StraightAlongJ(_FixedFamily):
    """The barrier with lines i = const straight."""

    fixed = "j"


class StraightBothWays(_FixedFamily):
    """The barrier with both straight families in equal weights."""

    fixed = (0.5, 0.5)
