"""The shock comes back from the end wall and meets the interface again: reshock.

Where the tube's end is meant, the exact solution of plane waves gives the time of the second
meeting, the jump of the interface's speed and the Atwood number after it.  The width of the zone
between both tips then grows, by a formula for turbulent zones in three dimensions, with
0.28 A times that jump, whatever it was before [Mikaelian1989].  One wave in the plane is no such
zone: the formula is a scale for it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from shockgrid.problems.interface_instability.shocked import Shocked
from shockgrid.problems.references.hugoniot import shock_with_particle_speed
from shockgrid.problems.references.riemann import solve_riemann
from shockgrid.problems.report import Row
from shockgrid.problems.signals import fit_slope

TURBULENT_GROWTH = 0.28  # of the width, over A times the jump [Mikaelian1989]
# wavelengths that A times the jump goes in the time over which growth is averaged, since the shock
WINDOWS = ((0.5, 1.0), (1.0, 2.5))
LEAST_WINDOW_PART = 0.5  # of a window that a run has to reach


class Reshock(NamedTuple):
    """arrival: of the shock at the mean interface [s]; jump: of the interface's speed, towards the
    piston [m/s]; atwood: Atwood number after it, positive."""

    arrival: float
    jump: float
    atwood: float

    @property
    def speed(self) -> float:
        """A times the jump [m/s], the scale of growth."""
        return self.atwood * self.jump


def find_reshock(shocked: Shocked) -> Reshock | None:
    """What the interface meets again; None where the end of its tube is not meant."""
    if not shocked.is_tube or shocked.deck.second_shock is not None:
        return None
    base = shocked.linear_growth.base
    arrival = shocked.echoes["second"].t
    if base.gap or arrival >= shocked.t_end:
        return None
    # the wall brings the second material to rest; that shock meets the interface
    echo = shock_with_particle_speed(shocked.eos_second, base.rho_right, base.p, base.u)
    first = base.rho_left, base.u, base.p
    after = solve_riemann(shocked.eos_first, first, shocked.eos_second, (echo.rho, 0.0, echo.p))
    contrast = abs(after.rho_right - after.rho_left) / (after.rho_right + after.rho_left)
    return Reshock(arrival, base.u - after.u, contrast)


def scale_since(reshock: Reshock, wavelength: float, t: np.ndarray) -> np.ndarray:
    """Wavelengths that A times the jump goes from the shock's arrival to the times t [s]."""
    return (np.asarray(t) - reshock.arrival) * reshock.speed / wavelength


def compare_growth(
    shocked: Shocked, reshock: Reshock, column: Mapping[str, np.ndarray]
) -> list[Row]:
    """Rows of the growth of the width between both tips, over A times the jump."""
    since = scale_since(reshock, shocked.deck.wavelength, column["t"])
    width = column["interface_max"] - column["interface_min"]
    rows = []
    for number, (first, last) in enumerate(WINDOWS, 1):
        chosen = (since >= first) & (since <= last)
        if since[-1] < first + LEAST_WINDOW_PART * (last - first):
            continue
        end = min(last, float(since[-1]))
        found = fit_slope(column["t"], width, chosen) / reshock.speed
        label = f"(dh/dt)/(A dV), {first:.2g} to {end:.2g} wavelengths after the reshock"
        source = "turbulent zone, for comparison"
        name = f"reshock_growth_{number}"
        rows.append(Row(name, found, TURBULENT_GROWTH, label, digits=3, off="--", source=source))
    return rows


def describe_reshock(reshock: Reshock) -> str:
    """What the plane waves do, in a sentence."""
    return (
        f"the shock comes back from the end wall at t = {reshock.arrival:.4g} s: "
        f"dV = {reshock.jump:.4g} m/s, A = {reshock.atwood:.3f} after it (plane waves)"
    )
