"""All kinds of segment that come with the package: walls, open sides, free surfaces, linked ones.

Walls are at rest, on the axis of axisymmetric flow, or move with a given velocity (piston).  A
block's kernels mirror cells in all its walls and press on them (`hydro.perimeter.strips`); a kind
of wall is a number.  Note: ghosts may not flatten the slope normal to a wall, which alone halves a
measured growth rate.  A free surface has a given pressure beyond, which may depend on time.  What
lies between two linked segments is the link's: `hydro.links.link`, `hydro.sliding.contact`.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from hydro import rim as on
from hydro.boundary.segment import NodeMotion, Segment
from hydro.perimeter.contacts import (
    AT_CELLS,
    AT_FLUX,
    AT_TRACES,
    AXIS,
    PISTON,
    WALL,
    fill_free_surface,
    fill_ghosts_from_faces,
)
from hydro.rows import RHO
from regrid.errors import BadInput, Place, RunFailure


class Wall(Segment):
    """Impermeable wall at rest without friction, or a line of symmetry."""

    kind = "wall"
    wall = WALL


class Axis(Wall):
    """The axis y = 0 of axisymmetric flow: a line of symmetry whose faces have no area.

    Its nodes keep to it.  Raises BadInput where the segment lies elsewhere.
    """

    kind = "axis"
    wall = AXIS

    def __init__(self, block, side, start, stop):
        super().__init__(block, side, start, stop)
        radius = np.abs(self.line(block.nodes)[1]).max()
        if radius > 0.0:
            raise BadInput(
                f"{self}: an axis segment lies up to {radius:g} m off the axis; "
                "all its nodes must have y = 0 exactly"
            )


class Piston(Wall):
    """Wall moving with a given velocity: a pair of numbers [m/s] or a function of time."""

    kind = "piston"
    wall = PISTON
    motion = NodeMotion.GIVEN

    def __init__(self, block, side, start, stop, velocity):
        super().__init__(block, side, start, stop)
        self._velocity: Callable = velocity if callable(velocity) else (lambda t: velocity)
        self.check_numbers(self._velocity(0.0), ("u", "v"), "velocity")

    def velocity(self, t):
        given = self._velocity(t)
        try:
            speed_x, speed_y = given
            return float(speed_x), float(speed_y)
        except (TypeError, ValueError):
            self.check_numbers(given, ("u", "v"), "velocity")
            raise


class Outflow(Segment):
    """Open side: what comes out is let through, nothing is known beyond."""

    kind = "outflow"
    beyond = on.RHO_TRACE  # as inside

    def fill_ghosts(self, t):
        rim = self.rim
        rim.rows[on.GHOST] = rim.rows[on.STATE]
        rim.length_ghost[:] = rim.length


class Inflow(Segment):
    """Open side with a given state beyond: (rho, u, v, p), or a function of time giving it.

    Each of the four is a number, or an array with a value for every face of the segment.  It is
    the state at the face: slopes take it from there, at half a cell's distance.  The nodes stay
    on their line, or go with a given constant `velocity` [m/s], through which the fluid passes.
    """

    kind = "inflow"
    beyond = on.RHO_BEYOND

    def __init__(self, block, side, start, stop, state, velocity=None):
        super().__init__(block, side, start, stop)
        self.state = state if callable(state) else (lambda t: state)
        self._is_steady, self._filled = not callable(state), False  # the rows beyond keep it
        self.check_numbers(self.state(0.0), ("rho", "u", "v", "p"), "state")
        self._velocity = 0.0, 0.0
        if velocity is not None:
            if callable(velocity):
                raise BadInput(f"{self}: inflow segment: velocity is constant, a pair of numbers")
            u, v = self.check_numbers(velocity, ("u", "v"), "velocity")
            self._velocity = float(u), float(v)
            self.motion = NodeMotion.GIVEN

    def velocity(self, t):
        return self._velocity

    def fill_ghosts(self, t):
        rim = self.rim
        rim.rho_ghost[:], rim.u_ghost[:], rim.v_ghost[:], rim.p_ghost[:] = self.state(t)
        rim.length_ghost[:] = 0.0

    def fill_speeds(self, t):
        """The state beyond at mid-time, for the flux."""
        if self._is_steady and self._filled:
            return
        self._filled = True
        rim, eos = self.rim, self.block.eos
        rho, u, v, p = self.state(t)
        rim.rho_beyond[:], rim.u_beyond[:], rim.v_beyond[:], rim.p_beyond[:] = rho, u, v, p
        c = eos.sound_speed(rho, p)
        rim.e_beyond[:], rim.c_beyond[:], rim.c2_beyond[:] = eos.energy(rho, p), c, c * c


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


class Linked(Segment):
    """Segment with another block's (or its own block's) segment on the far side.

    Ghosts, contact states and fluxes are the link's.
    """

    linked = True


class Interface(Linked):
    """Contact of two materials with matching nodes: a grid line that both blocks share.

    tension: surface tension [N/m], `hydro.motion.tension`.
    """

    kind = "interface"
    motion = NodeMotion.FLOW

    def __init__(self, block, side, start, stop, tension=0.0):
        super().__init__(block, side, start, stop)
        self.tension = self.check_tension(tension)


class Sliding(Linked):
    """One side of a sliding contact, or a part of one; its nodes match nobody's.

    The master's side moves with the contact, the slave's follows.
    """

    kind = "sliding"
    motion = NodeMotion.FLOW

    def fill_ghosts(self, t):
        fill_ghosts_from_faces(self.block.rim.rows, self.spans)


class Seam(Linked):
    """Cut between blocks of one material: material and grid lines pass through."""

    kind = "seam"
    motion = NodeMotion.JOIN
    ends_flow = True


class Periodic(Seam):
    """Seam to the opposite side of the domain, one period away."""

    kind = "periodic"
    ends_flow = False
