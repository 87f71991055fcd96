"""Free surfaces: a given pressure beyond, which may depend on time (a pressure piston)."""

from __future__ import annotations

import math

import numpy as np

from hydro import rim as on
from hydro.boundary.node_motion import NodeMotion
from hydro.boundary.segment import Segment
from hydro.perimeter.contacts import fill_free_surface, fill_ghosts_from_faces
from hydro.rows import RHO
from regrid.errors import BadInput, Place, RunFailure


class FreeSurface(Segment):
    """Surface under a pressure: a number [Pa], or a function of time (pressure piston).

    tension: surface tension [N/m], `hydro.motion.tension`; bond: tension [Pa] that a contact with
    another body's surface holds where both have it (`hydro.contacts`).
    Raises BadInput (at a later time RunFailure) where the block's material has no sound speed at
    that pressure: a gas has no surface to vacuum.
    """

    kind = "free-surface"
    motion = NodeMotion.FLOW

    def __init__(self, block, side, start, stop, pressure=0.0, tension=0.0, bond=0.0):
        super().__init__(block, side, start, stop)
        self.tension = self.check_tension(tension)
        if not isinstance(bond, int | float | np.number) or not bond >= 0.0:
            raise BadInput(
                f"{self}: free-surface segment: bond = {bond!r}; the tension that a contact holds "
                "is a number of Pa, 0 or more"
            )
        self.bond = float(bond)
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
        rim, law = self.block.rim.rows, self.block.wave_law
        fill_free_surface(rim, self.spans, on.RHO_FACE, law, self.pressure(t))
        fill_ghosts_from_faces(rim, self.spans)

    def fill_speeds(self, t):
        rim, law = self.block.rim.rows, self.block.wave_law
        fill_free_surface(rim, self.spans, on.RHO_TRACE, law, self.pressure(t))

    def fill_flux(self, t):
        self.block.fluxes.fill_surface_flux(self.block.rim.rows, self.spans, self.pressure(t))
