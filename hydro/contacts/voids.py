"""Voids enclosed by surfaces, contacts and planes: positions, areas, and the gas in them.

The path around a void follows surfaces, each with its outside on the right.  Where a contact
begins, it crosses to the other line.  Where a line ends, it continues on the next line or on the
plane that holds the end, and along a plane to the next line on it.  Closed paths are voids if they
run clockwise.  Theory F16.7.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from shockgrid.hydro.contacts.pair import Pair, PlanePair
from shockgrid.hydro.contacts.surface import Plane, Surface
from shockgrid.hydro.facets.rows import FOLLOWER_START, FOLLOWER_STOP, LEADER_START, LEADER_STOP
from shockgrid.regrid.errors import BadInput, RegridFailure

# of the depth of the cells around it: a void whose area has this side is closed
SMALL_VOID_DEPTHS = 0.5
# of its perimeter squared: such a void has no contact on its way to close by
ROUND_VOID_PART = 0.02
SLIVER_DEPTHS = 0.1  # of the same depth: slivers whose area has a smaller side are no voids
# of the same: larger voids without gas are measured, and new ones looked for,
LARGE_VOID_DEPTHS = 8.0
STEPS_PER_VOID_SEARCH = 8  # every so many steps
# of a void's volume: up to this change in a step the pressure is that in the middle
SMALL_VOLUME_CHANGE = 1e-5
LEAST_VOID_VOLUME_LEFT = 0.1  # by a step, of a void that resists
Place = tuple[int, float]  # number of a curve, position on it
Stretch = tuple[int, float, float]  # number of a curve, first and last position on it
FACES_IN_STATE = "contacts/void_faces"  # of `get_state`: a row for each stretch of a void's faces
VOIDS_IN_STATE = "contacts/voids"  # a row for each void


@dataclass
class Void:
    """A void: its faces (curve, first, after the last), area, volume, perimeter, cells' depth.

    shrinks_alone: its faces are one run of a single body's, without a contact: no two lines around
    it can close on each other; gas: p V^gamma; rest: the volume at which it was found closed (0: it
    is not); stiffness: rho c² around it then; growth: of its volume in the step before.
    """

    faces: list[tuple[int, int, int]]
    area: float
    volume: float
    around: float
    depth: float
    shrinks_alone: bool = False
    gas: float = 0.0
    rest: float = 0.0
    stiffness: float = 0.0
    growth: float = 0.0

    def predict_pressure(self, gamma: float) -> float:
        """In the middle of the step, if the volume goes on as in the step before."""
        volume = self.volume + 0.5 * max(-0.5 * self.volume, min(self.growth, self.volume))
        return self._compute_pressure(volume, gamma)

    def _compute_pressure(self, volume: float, gamma: float) -> float:
        """Of the gas, and what little is left as of the material."""
        pressure = self.gas / volume**gamma
        if self.rest > volume:
            pressure += self.stiffness * (self.rest / volume - 1.0)
        return pressure

    def compute_resistance_energy(self, volume: float) -> float:
        """What it has taken to compress it below `rest`, [J] per depth or per radian."""
        if volume >= self.rest:
            return 0.0
        return self.stiffness * (self.rest * math.log(self.rest / volume) - self.rest + volume)

    def compute_gas_energy(self, volume: float, gamma: float) -> float:
        """Of the gas in it, [J] per depth or per radian."""
        return self.gas * volume ** (1.0 - gamma) / (gamma - 1.0)

    def compute_mean_pressure(self, change: float, gamma: float) -> float:
        """That does the work by which the void's energy falls, in a change of its volume."""
        volume = self.volume + change
        if abs(change) < SMALL_VOLUME_CHANGE * self.volume:
            return self._compute_pressure(self.volume + 0.5 * change, gamma)
        lost = self.compute_gas_energy(self.volume, gamma)
        lost -= self.compute_gas_energy(volume, gamma)
        lost += self.compute_resistance_energy(self.volume)
        lost -= self.compute_resistance_energy(volume)
        return lost / change


class Voids:
    """The voids between surfaces and planes; fill: pressure [Pa] of the gas that a void holds when
    it is closed off, and its gamma."""

    def __init__(
        self,
        surfaces: Sequence[Surface],
        pairs: Sequence[Pair],
        curved: bool,
        fill: tuple[float, float] | None = None,
    ):
        self.pressure, self.gamma = fill or (0.0, 1.4)
        if not (0.0 <= self.pressure < math.inf and 1.0 < self.gamma < math.inf):
            raise BadInput(
                f"void_fill = {fill!r}: the gas in voids has a pressure of 0 Pa or more and a "
                "gamma above 1"
            )
        for surface in surfaces if self.pressure > 0.0 else ():
            if not surface.rigid and surface.segment.tension > 0.0:
                raise BadInput(
                    f"{surface}: void_fill: gas in voids is not beside lines under surface tension"
                )
        self.curved = curved
        self.pairs = list(pairs)
        self.surfaces = list(surfaces)
        self.planes: list[Plane] = []
        self.numbers = {id(surface): number for number, surface in enumerate(self.surfaces)}
        for pair in self.pairs:
            if isinstance(pair, PlanePair):
                origins = [id(plane.origin) for plane in self.planes]
                if id(pair.leader.origin) not in origins:
                    origins.append(id(pair.leader.origin))
                    self.planes.append(pair.leader)
                place = origins.index(id(pair.leader.origin))
                self.numbers[id(pair.leader)] = len(self.surfaces) + place
        self._steps = self._find_lasting_steps()
        self.found: list[Void] = []
        # of the voids that resist: their work in this step, and their energy after it [J]
        self.work = 0.0
        self.energy_left = 0.0
        self._asked = True  # at the start
        self._pushed = False  # has any face a pressure from a void?

    def are_due(self, step: int, touching: bool) -> bool:
        """Whether to look for voids in this step: large empty ones are searched only now and
        then."""
        if self._asked or self.pressure > 0.0 or step % STEPS_PER_VOID_SEARCH == 0:
            return touching or self._asked or bool(self.found)
        return any(
            void.gas != 0.0 or void.rest != 0.0 or void.area < (LARGE_VOID_DEPTHS * void.depth) ** 2
            for void in self.found
        )

    def find(self) -> None:
        """The voids of the present lines, with what those before held; their faces' pressures."""
        self._asked = False
        before = self.found
        self.found = [self._measure(*loop) for loop in self._find_loops()]
        self.found = [void for void in self.found if void.area > (SLIVER_DEPTHS * void.depth) ** 2]
        self._hand_on(before)
        self._press()

    # --- ways round ------------------------------------------------------------------------------

    def _find_loops(self) -> list[tuple[list[Stretch], bool]]:
        """Ways round that close, as stretches of curves; none that are points.

        And of each, whether no contact is on it.
        """
        steps = self._find_steps()
        loops = []
        seen = set()
        for start in [target for own in steps.values() for _, target in own]:
            here = start
            stretches = []
            length = 0.0
            is_free = True
            while here not in seen:
                seen.add(here)
                curve, position = here
                beyond = [step for step in steps.get(curve, ()) if step[0] >= position - 1e-9]
                if not beyond:
                    break
                stop, here = min(beyond)
                is_free = is_free and (curve, stop, here) not in self._contact_steps
                stretches.append((curve, position, stop))
                length += stop - position if curve < len(self.surfaces) else 0.0
            if stretches and here == start and length > 1e-6:
                loops.append((stretches, is_free))
        return loops

    def _find_lasting_steps(self) -> list[tuple[int, float, int, float]]:
        """Steps from curve to curve, at positions on both, that stay: at ends, planes' corners."""
        steps = []
        first = len(self.surfaces)
        for number, surface in enumerate(self.surfaces):
            for following, other in enumerate(self.surfaces):
                same = surface.ends[1] is not None and surface.ends[1] is other.ends[0]
                if same and np.array_equal(surface.line[:, -1], other.line[:, 0]):  # no image
                    steps.append((number, float(surface.count), following, 0.0))
        for k, one_plane in enumerate(self.planes, first):
            for m, two_plane in enumerate(self.planes, first):
                a = one_plane.along
                b = two_plane.along
                out = float(a[0] * b[1] - a[1] * b[0])  # how fast the height over b rises along a
                if out < -1e-9:
                    way = two_plane.origin - one_plane.origin
                    place = float(way[0] * b[1] - way[1] * b[0]) / out
                    there = float((one_plane.origin + place * a - two_plane.origin) @ b)
                    steps.append((k, place, m, there))
        self._held = [
            (number, end, side)
            for number, surface in enumerate(self.surfaces)
            for side, plane in enumerate(self.planes, first)
            for end, key_node in enumerate(surface.ends)
            if key_node is not None and plane.holds(key_node)
        ]
        return steps

    def _find_steps(self) -> dict[int, list[tuple[float, Place]]]:
        """On each curve the positions where one goes over to another, and to where."""
        found = list(self._steps)
        # surfaces that end on a plane
        for number, end, side in self._held:
            surface = self.surfaces[number]
            plane = self.planes[side - len(self.surfaces)]
            place = float((surface.line[:, -end] - plane.origin) @ plane.along)
            if end == 0:
                found.append((side, place, number, 0.0))
            else:
                found.append((number, float(surface.count), side, place))
        first_contact = len(found)
        # contacts: from one curve to the other at both ends of each stretch of facets
        for pair in self.pairs:
            if not (pair.is_near and pair.count):
                continue
            one = self.numbers[id(pair.leader)]
            other = self.numbers[id(pair.follower)]
            ends = pair.facets.ends[:, : pair.count]
            breaks = np.flatnonzero(ends[LEADER_START, 1:] != ends[LEADER_STOP, :-1])
            for k in (0, *(breaks + 1)):
                place = self._convert(pair, ends[LEADER_START, k])
                found.append((one, place, other, float(ends[FOLLOWER_START, k])))
            for k in (*breaks, pair.count - 1):
                place = self._convert(pair, ends[LEADER_STOP, k])
                found.append((other, float(ends[FOLLOWER_STOP, k]), one, place))
        # which of the steps are those of contacts
        self._contact_steps = {
            (curve, position, (target, place))
            for curve, position, target, place in found[first_contact:]
        }
        # by the curve on which they begin
        steps: dict[int, list[tuple[float, Place]]] = {}
        for curve, position, target, place in found:
            steps.setdefault(curve, []).append((position, (target, place)))
        return steps

    @staticmethod
    def _convert(pair: Pair, position: float) -> float:
        """A position on the leader; on a plane in metres from its origin."""
        if not isinstance(pair, PlanePair):
            return float(position)
        plane = pair.leader
        start = (plane.line[:, 0] - plane.origin) @ plane.along
        return float(start + position * ((plane.line[:, 1] - plane.line[:, 0]) @ plane.along))

    def _cut(self, curve: int, start: float, stop: float) -> np.ndarray:
        """Points (2, n) of a curve between two positions."""
        if curve >= len(self.surfaces):
            plane = self.planes[curve - len(self.surfaces)]
            return plane.origin[:, None] + plane.along[:, None] * np.array([start, stop])
        line = self.surfaces[curve].line
        a = math.floor(start)
        b = min(math.floor(stop), line.shape[1] - 2)
        first, last = (
            line[:, k : k + 1] + (at - k) * (line[:, k + 1 : k + 2] - line[:, k : k + 1])
            for k, at in ((min(a, line.shape[1] - 2), start), (b, stop))
        )
        return np.concatenate([first, line[:, a + 1 : math.ceil(stop)], last], axis=1)

    def _shrinks_alone(self, stretches: list[Stretch], is_free: bool) -> bool:
        """Whether the surfaces of a loop follow each other, but for planes that hold the outer
        ends."""
        surfaces = [curve for curve, _, _ in stretches if curve < len(self.surfaces)]
        if not is_free or any(self._resists_nothing(self.surfaces[curve]) for curve in surfaces):
            return False
        are_planes = [curve >= len(self.surfaces) for curve, _, _ in stretches]
        # times that the way round leaves a plane for a surface
        before = [are_planes[-1], *are_planes[:-1]]
        runs = sum(was and not is_now for was, is_now in zip(before, are_planes, strict=True))
        # a third plane would be opposite to the surfaces
        return runs <= 1 and sum(are_planes) <= 2

    @staticmethod
    def _resists_nothing(surface: Surface) -> bool:
        """Whether a surface is one that voids do not press on."""
        return surface.rigid or surface.segment.tension > 0.0

    def _measure(self, stretches: list[Stretch], is_free: bool) -> Void:
        """Area and volume of a loop, depth of the cells along it; is_free: without a contact."""
        points = np.concatenate([self._cut(*stretch) for stretch in stretches], axis=1)
        x, y = points
        x_next, y_next = np.roll(points, -1, axis=1)
        area = 0.5 * float((x_next * y - x * y_next).sum())
        volume = area
        if self.curved:
            volume = float(((x_next - x) * (y * y + y * y_next + y_next * y_next)).sum()) / 6.0
        faces = []
        depth = []
        for curve, start, stop in stretches:
            if curve >= len(self.surfaces) or self.surfaces[curve].rigid:
                continue
            surface = self.surfaces[curve]
            first = int(start)
            last = min(math.ceil(stop), surface.count)
            if first < last:
                faces.append((curve, first, last))
                ways = surface.inner[:, first : last + 1] - surface.line[:, first : last + 1]
                depth.append(float(np.hypot(*ways).mean()))
        around = float(np.hypot(x_next - x, y_next - y).sum())
        alone = self._shrinks_alone(stretches, is_free)
        return Void(faces, area, volume, around, sum(depth) / max(1, len(depth)), alone)

    # --- what they hold --------------------------------------------------------------------------

    def _hand_on(self, before: list[Void]) -> None:
        """Give the gas of the voids before to those that have their faces; fill new ones."""
        for void in self.found:
            parents = [old for old in before if _share_faces(old, void)]
            if not parents:
                void.gas = self.pressure * void.volume**self.gamma
            # those with the same pressure
            children = [v for v in self.found if any(_share_faces(old, v) for old in parents)]
            was = sum(old.volume for old in parents)
            now = sum(child.volume for child in children)
            for old in parents:
                pressure = old.gas / old.volume**self.gamma
                void.gas += pressure * old.volume / was * (was / now * void.volume) ** self.gamma
            if len(parents) == len(children) == 1:
                void.growth = now - was
            # its share of what its parents resist
            void.rest = sum(old.rest for old in parents) * (void.volume / now if parents else 0.0)
            void.stiffness = max((old.stiffness for old in parents), default=0.0)
            if void.rest == 0.0 and self._is_closing(void):
                void.rest = void.volume
            elif void.volume > void.rest:
                void.rest = void.stiffness = 0.0

    @staticmethod
    def _is_closing(void: Void) -> bool:
        """Whether these are the last cells of a round void, on which no two lines could close."""
        small = void.area < (SMALL_VOID_DEPTHS * void.depth) ** 2
        is_round = void.area > ROUND_VOID_PART * void.around**2
        return void.shrinks_alone and small and is_round

    def _press(self) -> None:
        """Write the pressures in the voids beside their faces."""
        pressures = [void.predict_pressure(self.gamma) for void in self.found]
        if self._pushed or any(pressures):
            for surface in self.surfaces:
                if not surface.rigid and surface.segment.tension == 0.0:
                    surface.press(0.0)
            for void, pressure in zip(self.found, pressures, strict=True):
                for curve, first, last in void.faces:
                    if self.surfaces[curve].segment.tension == 0.0:
                        self.surfaces[curve].press(pressure, first, last)
        self._pushed = any(pressures)

    # --- phases of a step ------------------------------------------------------------------------

    def fill_ghosts(self, t: float, dt: float) -> None:
        """The pressures with which a step begins, every time that it is tried."""
        for void in self.found:
            if void.rest > 0.0 and void.stiffness == 0.0:  # it has just closed
                void.stiffness = max(
                    self.surfaces[curve].find_stiffness(first) for curve, first, _ in void.faces
                )
        if any(void.rest > 0.0 for void in self.found):
            self._press()

    def fill_speeds(self, t: float, dt: float) -> None:
        """Nothing: the pressures are those of the ghosts."""

    def fill_fluxes(self, t: float, dt: float) -> None:
        """The pressures that do the work by which the energy of resisting voids changes.

        What their faces sweep is known then.  Raises RegridFailure where a void would close.
        """
        self.work = 0.0
        self.energy_left = 0.0
        pressed: dict[int, set[int]] = {}
        for void in self.found:
            if void.rest == 0.0:
                continue
            change = 0.0
            for curve, first, last in void.faces:
                change -= dt * float(self.surfaces[curve].gather_swept()[first:last].sum())
                pressed.setdefault(curve, set()).update(range(first, last))
            if void.volume + change < LEAST_VOID_VOLUME_LEFT * void.volume:
                raise RegridFailure("contact: a void closes in one step", cause="contact-lost")
            pressure = void.compute_mean_pressure(change, self.gamma)
            self._pushed = True
            for curve, first, last in void.faces:
                if self.surfaces[curve].segment.tension == 0.0:
                    self.surfaces[curve].press(pressure, first, last)
            self.work -= void.compute_gas_energy(void.volume, self.gamma)
            self.work += void.compute_gas_energy(void.volume + change, self.gamma)
            self.energy_left += void.compute_resistance_energy(void.volume + change)
        # as the fluxes have it: a face that two voids share has the pressure of one of them
        for curve, faces in pressed.items():
            surface = self.surfaces[curve]
            power = -dt * surface.gather_void_pressure() * surface.gather_swept()
            self.work += float(power[sorted(faces)].sum())

    # --- what is kept ----------------------------------------------------------------------------

    def compute_row(self) -> dict[str, float | int]:
        """Columns of the history: how many voids, their area [m²]."""
        return {"voids": len(self.found), "void_area": sum(void.area for void in self.found)}

    def get_state(self) -> dict[str, Any]:
        """What the voids held, and the faces by which they are known again."""
        faces = [(n, *face) for n, void in enumerate(self.found) for face in void.faces]
        numbers = [
            (v.area, v.volume, v.around, v.depth, v.shrinks_alone, v.gas, v.rest, v.stiffness)
            for v in self.found
        ]
        return {
            FACES_IN_STATE: np.array(faces, dtype=np.int64).reshape(-1, 4),
            "contacts/voids_asked": self._asked,
            VOIDS_IN_STATE: np.array(numbers, dtype=np.float64).reshape(-1, 8),
        }

    def get_state_for(self, other: Voids) -> dict[str, Any]:
        """The state for the same surfaces with other numbers of faces."""
        state = self.get_state()
        for row in state[FACES_IN_STATE]:
            curve = row[1]
            count = self.surfaces[curve].count
            count_there = other.surfaces[curve].count
            row[2] = row[2] * count_there // count
            row[3] = -(-row[3] * count_there // count)
        return state

    def set_state(self, state: Any) -> None:
        """Take up a state of `get_state`."""
        self.found = []
        if state.get(VOIDS_IN_STATE) is not None:
            self._asked = bool(state["contacts/voids_asked"])
            self.found = [Void([], *map(float, row)) for row in state[VOIDS_IN_STATE]]
            for number, *faces in np.asarray(state[FACES_IN_STATE]).tolist():
                self.found[number].faces.append(tuple(faces))
        self._pushed = True


def _share_faces(one: Void, other: Void) -> bool:
    """Whether two voids, of different times, have a face in common."""
    return any(
        curve == there and first < end and start < last
        for curve, first, last in one.faces
        for there, start, end in other.faces
    )
