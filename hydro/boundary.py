"""Segments: boundary conditions and contacts along a part of a block's side.

A kind of segment is one class and one line in OWN_SEGMENTS (or a plug-in of a package).  It defines
the ghost states beyond its faces (for the slopes), the motion of its nodes (`motion`), and the
fluxes through its faces: rows of its `rim`, by the names of `hydro.rim`.

Walls are at rest, lie on the axis of axisymmetric flow, or move with a given velocity (piston).
The kernels of a block mirror cells in all its walls and compute the wall pressure
(`hydro.perimeter.strips`); a kind of wall is a number.  Note: ghosts must not flatten the slope
normal to a wall, which by itself halves a measured growth rate.  Beyond a free surface the pressure
is given and may depend on time.  The contact between two linked segments is computed by the link:
`hydro.links`, `hydro.sliding.contact`.
"""

from __future__ import annotations

import inspect
import math
from collections import ChainMap
from collections.abc import Callable, Sequence
from enum import Enum
from typing import Any, ClassVar

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.carried.fields import read_values
from shockgrid.hydro.perimeter.contacts import (
    AT_CELLS,
    AT_FLUX,
    AT_TRACES,
    AXIS,
    PISTON,
    WALL,
    fill_free_surface,
    fill_ghosts_from_faces,
)
from shockgrid.hydro.rim import CARRIED_BEYOND, CARRIED_GHOST, GHOST, RHO_BEYOND, RHO_TRACE, STATE
from shockgrid.hydro.rows import RHO
from shockgrid.hydro.strength.stress import STRESS_FIELDS
from shockgrid.regrid.errors import BadInput, Place, RunFailure, suggest
from shockgrid.regrid.plug_ins import PlugIns


class NodeMotion(Enum):
    """What rules the nodes of a segment; `hydro.motion.line` has a class for each but FOLLOW."""

    FLOW = "they go with the contact speeds of their faces"
    GIVEN = "they go with a given velocity"
    SLIDE = "they stay on their first line and are spread between its ends"
    JOIN = "they are spread between the ends, which nothing holds to a line"
    FOLLOW = "they are laid on the leader's line of a sliding contact"


class Segment:
    """Faces start..stop - 1 of one side (`first`..`last` - 1 of the perimeter)."""

    kind: ClassVar[str]
    motion: NodeMotion = NodeMotion.SLIDE
    ends_flow: ClassVar[bool] = False  # its ends go with the fluid where nothing else rules them
    linked: ClassVar[bool] = False
    wall: ClassVar[int | None] = None  # a kind of wall, of `hydro.perimeter.contacts`
    beyond: ClassVar[int | None] = None  # of open sides: first row of the state beyond, in rims
    tension: float = 0.0  # surface tension of its line [N/m]
    has_own_line: bool = True  # not so for followers, whose line the leader gives
    # what other parts of the flow ask of a kind, rather than its name
    is_free: ClassVar[bool] = False  # nothing lies beyond but a pressure
    is_thick: ClassVar[bool] = False  # its line is smoothed over a thickness (theory F6.3)
    is_sliding: ClassVar[bool] = False  # a side of a sliding contact
    passes_mass: ClassVar[bool] = False  # material goes through it to its partner
    is_shifted: ClassVar[bool] = False  # its partner's nodes lie a shift away
    is_inner_seam: ClassVar[bool] = False  # the blocks of a body touch at it
    meets_bodies: ClassVar[bool] = False  # surfaces of other bodies may touch it
    is_rigid: ClassVar[bool] = False  # it moves as it does whatever presses on it

    def __init__(self, block: Block, side: str, start: int, stop: int):
        self.block = block
        self.side = side
        self.start = start
        self.stop = stop
        offset, count = block.side_faces(side)
        if not 0 <= start < stop <= count:
            raise BadInput(
                f"block {block.name!r}, side {side}: a {self.kind} segment covers faces {start} to "
                f"{stop}; the side has faces 0 to {count}"
            )
        if self.motion is NodeMotion.FLOW and stop - start < 2:
            raise BadInput(
                f"block {block.name!r}, side {side}: a {self.kind} segment of one face cannot move "
                "by itself; it needs at least 2"
            )
        self.first = offset + start
        self.last = offset + stop
        self.spans = np.array([(self.first, self.last)])
        self.rim = block.rim[self]  # this segment's faces alone

    @property
    def follows_flow(self) -> bool:
        """Whether the nodes go with the material, on a line of their own or on a leader's."""
        return self.motion in (NodeMotion.FLOW, NodeMotion.FOLLOW)

    @property
    def is_follower(self) -> bool:
        """Whether the nodes are laid on the leader's line of a sliding contact."""
        return self.motion is NodeMotion.FOLLOW

    @property
    def moves(self) -> bool:
        """Whether the nodes move by themselves, and not only with the ends of their line."""
        return self.follows_flow or self.motion is NodeMotion.GIVEN

    def check_tension(self, tension: Any) -> float:
        """A surface tension [N/m]; BadInput for what is none."""
        if not isinstance(tension, int | float | np.number) or not 0.0 <= tension < np.inf:
            raise BadInput(
                f"{self}: {self.kind} segment: tension = {tension!r}; surface tension is a number "
                "of N/m, 0 or more"
            )
        return float(tension)

    def check_numbers(self, values: Any, names: tuple[str, ...], name: str) -> tuple:
        """The numbers of a pair, or of a state; BadInput, with the option's `name`, for others.

        `names` say what each is; arrays are for kinds that take one number a face.
        """
        try:
            numbers = tuple(values)
            are_numbers = len(numbers) == len(names) and all(
                np.isfinite(one).all() for one in numbers
            )
        except TypeError:
            are_numbers = False
        if not are_numbers:
            wanted = ", ".join(names)
            raise BadInput(
                f"{self}: {self.kind} segment: {name} gives {values!r}; ({wanted}) is wanted, or a "
                "function of the time that returns it"
            )
        return numbers

    def __str__(self) -> str:
        return f"block {self.block.name!r}, side {self.side}, faces {self.start}-{self.stop}"

    def line(self, nodes: np.ndarray) -> np.ndarray:
        """View (2, n + 1) of the segment's nodes."""
        return self.block.side_line(self.side, nodes)[:, self.start : self.stop + 1]

    def velocity(self, t: float) -> tuple[float, float]:
        """Velocity of the nodes of a segment with given motion [m/s]."""
        return 0.0, 0.0

    def overrides(self, method: str) -> bool:
        """Whether its kind fills its ghosts, speeds or fluxes itself, by this method."""
        return getattr(type(self), method) is not getattr(Segment, method)

    def fill_ghosts(self, t: float) -> None:
        """Write the ghosts beyond the segment from the states at time t; links do for theirs."""

    def fill_speeds(self, t: float) -> None:
        """Write contact states of mid-time traces, where the nodes go with the flow."""

    def fill_flux(self, t: float) -> None:
        """Write the outward fluxes from the mid-time traces; t is the mid-time."""


class Wall(Segment):
    """Impermeable wall at rest without friction, or a line of symmetry.

    clamped: a solid sticks to it, and goes along the wall as fast as the wall does.  Raises
    BadInput for a clamped material without strength.
    """

    kind = "wall"
    wall = WALL
    meets_bodies = True
    is_rigid = True

    def __init__(self, block, side, start, stop, clamped=False):
        super().__init__(block, side, start, stop)
        if not isinstance(clamped, bool):
            raise BadInput(f"{self}: {self.kind} segment: clamped = {clamped!r}; true or false")
        if clamped and block.strength is None:
            raise BadInput(
                f"{self}: {self.kind} segment: clamped = true, and the material has no strength; "
                "only a solid sticks to a wall"
            )
        self.clamped = clamped


class Axis(Wall):
    """The axis y = 0 of axisymmetric flow: a line of symmetry whose faces have no area.

    Its nodes keep to it.  Raises BadInput where the segment lies elsewhere.
    """

    kind = "axis"
    wall = AXIS
    meets_bodies = False

    def __init__(self, block, side, start, stop):
        super().__init__(block, side, start, stop)
        radius = np.abs(self.line(block.nodes)[1]).max()
        if radius > 0.0:
            raise BadInput(
                f"{self}: an axis segment lies up to {radius:g} m off the axis; "
                "all its nodes must have y = 0 exactly"
            )


class Piston(Wall):
    """Wall moving with a given velocity: a pair of numbers [m/s] or a function of time.

    clamped: as of a wall.
    """

    kind = "piston"
    wall = PISTON
    motion = NodeMotion.GIVEN

    def __init__(self, block, side, start, stop, velocity, clamped=False):
        super().__init__(block, side, start, stop, clamped)
        self._velocity: Callable = velocity if callable(velocity) else (lambda t: velocity)
        self.check_numbers(self._velocity(0.0), ("u", "v"), "velocity")

    def velocity(self, t):
        velocity = self._velocity(t)
        try:
            speed_x, speed_y = velocity
            return float(speed_x), float(speed_y)
        except (TypeError, ValueError):
            self.check_numbers(velocity, ("u", "v"), "velocity")
            raise


class Outflow(Segment):
    """Open side: material flows out freely, and no state is prescribed beyond."""

    kind = "outflow"
    beyond = RHO_TRACE  # as inside

    def fill_ghosts(self, t):
        rim = self.rim
        rim.rows[GHOST] = rim.rows[STATE]
        rim.length_ghost[:] = rim.length


class Inflow(Segment):
    """Open side with a given state beyond: (rho, u, v, p), or a function of time giving it.

    Each of the four is a number, or an array with a value for every face of the segment.  It is
    the state at the face, so slopes use it at half a cell's distance.  The nodes stay on their
    line or move with a given constant `velocity` [m/s]; the fluid passes through them.  carried:
    the value of each carried field of the block, by name, with which material comes in.
    """

    kind = "inflow"
    beyond = RHO_BEYOND

    def __init__(self, block, side, start, stop, state, velocity=None, carried=None):
        super().__init__(block, side, start, stop)
        if block.stress is not None:  # solid comes in whole and without stress, unless said
            spall = block.stress.spall
            own_fields = (*STRESS_FIELDS, *(spall.fields if spall is not None else ()))
            carried = dict.fromkeys((field.name for field in own_fields), 0.0) | (carried or {})
        values = read_values(f"{self}: inflow segment", block.carried_fields, carried)
        self._carried = values[:, None]
        self.state = state if callable(state) else (lambda t: state)
        # a constant state is written once: nothing else writes to the rows beyond
        self._is_constant = not callable(state)
        self._is_written = False
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
        if self.block.carried_fields:
            count = len(self._carried)
            rim.get_carried(CARRIED_GHOST)[:count] = self._carried
            rim.get_carried(CARRIED_BEYOND)[:count] = self._carried

    def fill_speeds(self, t):
        """The state beyond at mid-time, for the flux."""
        if self._is_constant and self._is_written:
            return
        self._is_written = True
        rim = self.rim
        eos = self.block.eos.with_fields(self._carried[:, 0])
        rho, u, v, p = self.state(t)
        rim.rho_beyond[:] = rho
        rim.u_beyond[:] = u
        rim.v_beyond[:] = v
        rim.p_beyond[:] = p
        c = eos.sound_speed(rho, p)
        rim.e_beyond[:] = eos.energy(rho, p)
        rim.c_beyond[:] = c
        rim.c2_beyond[:] = c * c
        rim.part_beyond[:] = 1.0


class FreeSurface(Segment):
    """Surface under a pressure: a number [Pa], or a function of time (pressure piston).

    tension: surface tension [N/m], `hydro.motion.tension`.  Properties of a contact if both of
    its surfaces have them (`hydro.contacts`): bond, a tension [Pa]; friction, Coulomb's
    coefficient; weld, an unlimited bond and friction.
    Raises BadInput (at a later time RunFailure) if the block's material has no sound speed at
    that pressure: a gas has no surface to vacuum.
    """

    kind = "free-surface"
    motion = NodeMotion.FLOW
    is_free = True
    meets_bodies = True

    def __init__(
        self, block, side, start, stop, pressure=0.0, tension=0.0, bond=0.0, friction=0.0,
        weld=False,
    ):  # fmt: skip
        super().__init__(block, side, start, stop)
        self.tension = self.check_tension(tension)
        for name, value, condition in (
            ("bond", bond, "the tension that a contact holds is a number of Pa, 0 or more"),
            ("friction", friction, "Coulomb's coefficient is a number, 0 or more"),
        ):
            if not isinstance(value, int | float | np.number) or not value >= 0.0:
                raise BadInput(f"{self}: free-surface segment: {name} = {value!r}; {condition}")
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

    def _fill(self, t: float, stage: int) -> None:
        block = self.block
        fill_free_surface(
            block.rim.rows, self.spans, block.wave_law, self.pressure(t), stage,
            block.geometry.curved,
        )  # fmt: skip


class Linked(Segment):
    """Segment linked to a segment of another block (or of its own block).

    The link computes its ghosts, contact states and fluxes.
    """

    linked = True
    sticks: bool = False  # solids on both sides share what acts along the line: seams and bonds


class Interface(Linked):
    """Contact of two materials with matching nodes: a grid line that both blocks share.

    tension: surface tension [N/m], `hydro.motion.tension`; bonded: do solids on both sides stick
    together?  By default they slip on each other without friction.
    """

    kind = "interface"
    motion = NodeMotion.FLOW
    is_thick = True

    def __init__(self, block, side, start, stop, tension=0.0, bonded=False):
        super().__init__(block, side, start, stop)
        self.tension = self.check_tension(tension)
        if not isinstance(bonded, bool):
            raise BadInput(f"{self}: interface: bonded = {bonded!r}; it is true or false")
        self.sticks = bonded


class Sliding(Linked):
    """One side of a sliding contact, or a part of one; its nodes match no other nodes.

    The leader's line moves with the contact, and the follower's nodes are placed on it.
    """

    kind = "sliding"
    motion = NodeMotion.FLOW
    is_sliding = True

    def fill_ghosts(self, t):
        fill_ghosts_from_faces(self.block.rim.rows, self.spans)


class Seam(Linked):
    """Seam between blocks of one material: material and grid lines pass through."""

    kind = "seam"
    motion = NodeMotion.JOIN
    ends_flow = True
    sticks = True
    passes_mass = True
    is_inner_seam = True


class Periodic(Seam):
    """Seam to the opposite side of the domain, one period away."""

    kind = "periodic"
    ends_flow = False
    is_shifted = True
    is_inner_seam = False


OWN_SEGMENTS: dict[str, type[Segment]] = {
    "wall": Wall,
    "axis": Axis,
    "piston": Piston,
    "free-surface": FreeSurface,
    "outflow": Outflow,
    "inflow": Inflow,
    "interface": Interface,
    "sliding": Sliding,
    "seam": Seam,
    "periodic": Periodic,
}
SEGMENTS: ChainMap[str, type[Segment]] = ChainMap(
    OWN_SEGMENTS,
    PlugIns("shockgrid.boundaries"),  # type: ignore
)


def make_segment(
    kind: str, block: Block, side: str, start: int, stop: int, options: dict
) -> Segment:
    """A segment of a registered kind; raises BadInput for an unknown kind or option."""
    place = f"block {block.name!r}, side {side}"
    if not isinstance(kind, str) or kind not in SEGMENTS:
        raise BadInput(f"{place}: there is no segment kind {kind!r}{suggest(kind, SEGMENTS)}")
    place += f": {kind} segment"
    if block.mixed is not None and SEGMENTS[kind].motion in (NodeMotion.FLOW, NodeMotion.FOLLOW):
        raise BadInput(f"{place}: a block of two materials has no line that goes with the flow")
    _check_options(place, SEGMENTS[kind], options)
    try:
        return SEGMENTS[kind](block, side, start, stop, **options)
    except (TypeError, ValueError) as error:
        raise BadInput(f"{place}: {error}") from error


def _check_options(place: str, make: type[Segment], options: dict) -> None:
    """Raise BadInput for options that a kind does not have, and for those that it lacks."""
    options_of_kind = list(inspect.signature(make).parameters.values())[
        4:
    ]  # block, side, start, stop
    if any(one.kind is one.VAR_KEYWORD for one in options_of_kind):
        return
    known = [one.name for one in options_of_kind]
    for name in options:
        if name not in known:
            raise BadInput(
                f"{place}: there is no option {name!r}{suggest(name, known)}"
                if known
                else f"{place}: {name!r} is given, and it has no options"
            )
    missing = [
        one.name for one in options_of_kind if one.default is one.empty and one.name not in options
    ]
    if missing:
        examples = ", ".join(f"{name}=..." for name in missing)
        about = (make.__doc__ or "").strip().partition("\n")[0]
        raise BadInput(f"{place}: {examples} is missing ({about})")


def put(
    block: Block, side: str, kind: str, start: int = 0, stop: int | None = None, **options
) -> Segment:
    """Put a segment of a kind on the faces start..stop - 1 of a block's side; returns it.

    options: those of the kind's class.  Raises BadInput for an unknown side, kind or option, and
    for faces that the side does not have.
    """
    count = block.side_faces(side)[1]
    segment = make_segment(kind, block, side, start, count if stop is None else stop, options)
    block.segments.append(segment)
    return segment


class OpenSides:
    """The segments of all blocks that fill ghosts, speeds or fluxes themselves, such as free ones.

    A coupling of `hydro.step`.
    """

    def __init__(self, blocks: Sequence[Block]):
        self.blocks = blocks

    def fill_ghosts(self, t: float, dt: float) -> None:
        """Ghosts beyond open sides and free surfaces at the start of the step."""
        for block in self.blocks:
            for segment in block.plan.ghosts:
                segment.fill_ghosts(t)

    def fill_speeds(self, t: float, dt: float) -> None:
        """Contact speeds of free surfaces, and the states beyond inflow sides."""
        for block in self.blocks:
            for segment in block.plan.speeds:
                segment.fill_speeds(t)

    def fill_fluxes(self, t: float, dt: float) -> None:
        """Fluxes of free surfaces; those of walls and open sides are known from the traces."""
        for block in self.blocks:
            for segment in block.plan.fluxes:
                segment.fill_flux(t)
