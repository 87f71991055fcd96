"""Free surfaces: a given pressure beyond, which may depend on time (a pressure piston)."""

from __future__ import annotations

import math

import numpy as np

from hydro.boundary.node_motion import NodeMotion
from hydro.boundary.segment import Segment
from hydro.perimeter.contacts import AT_CELLS, AT_FLUX, AT_TRACES, fill_free_surface
from hydro.rows import RHO
from regrid.errors import BadInput, Place, RunFailure


class FreeSurface(Segment):
    """Surface under a pressure: a number [Pa], or a function of time (pressure piston).

    tension: surface tension [N/m], `hydro.motion.tension`.  What a contact holds where both of its
    surfaces have it (`hydro.contacts`): bond, a tension [Pa]; friction, Coulomb's coefficient;
    weld: both without end.
    Raises BadInput (at a later time RunFailure) where the block's material has no sound speed at
    that pressure: a gas has no surface to vacuum.
    """

    kind = "free-surface"
    motion = NodeMotion.FLOW

    def __init__(
        self, block, side, start, stop, pressure=0.0, tension=0.0, bond=0.0, friction=0.0,
        weld=False,
    ):  # fmt: skip
        super().__init__(block, side, start, stop)
        self.tension = self.check_tension(tension)
        for name, value, words in (
            ("bond", bond, "the tension that a contact holds is a number of Pa, 0 or more"),
            ("friction", friction, "Coulomb's coefficient is a number, 0 or more"),
        ):
            if not isinstance(value, int | float | np.number) or not value >= 0.0:
                raise BadInput(f"{self}: free-surface segment: {name} = {value!r}; {words}")
        if not isinstance(weld, bool):
            raise BadInput(f"{self}: free-surface segment: weld = {weld!r}; it is true or false")
        self.bond, self.friction = (math.inf,) * 2 if weld else (float(bond), float(friction))
        self._pressure = pressure if callable(pressure) else (lambda t: pressure)
        self._checked = math.nan
        try:
            self.pressure(0.0)
        except RunFailure as failure:
            raise BadInput(str(failure)) from None
        except (TypeError, ValueError):
            raise BadInput(
                f"{self}: free-surface segment: pressure = {pressure!r}; a number [Pa] is wanted, "
                "or a function of the time that returns one"
            ) from None

    def pressure(self, t: float) -> float:
        """Pressure on the surface [Pa]; RunFailure where the material cannot have a surface."""
        pressure = float(self._pressure(t))
        if pressure != self._checked and self.block.is_here:
            block = self.block
            with np.errstate(all="ignore"):
                c = float(
                    block.eos.sound_speed(float(block.state[RHO, 1:-1, 1:-1].max()), pressure)
                )
            if not 0.0 < c < math.inf:
                raise RunFailure(
                    f"{self}: a free surface under p = {pressure:g} Pa at t = {t:.6g} s, where the "
                    "material has no sound speed (a gas has no surface to vacuum); give it a "
                    "higher pressure, or an outflow side",
                    cause="no-surface",
                    place=Place(block.name),
                )
            self._checked = pressure
        return pressure

    def fill_ghosts(self, t):
        self._fill(t, AT_CELLS)

    def fill_speeds(self, t):
        self._fill(t, AT_TRACES)

    def fill_flux(self, t):
        self._fill(t, AT_FLUX)

    def _fill(self, t: float, phase: int) -> None:
        block = self.block
        fill_free_surface(
            block.rim.rows, self.spans, block.wave_law, self.pressure(t), phase,
            block.geometry.curved,
        )  # fmt: skip
