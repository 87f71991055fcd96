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
from shockgrid.hydro.rows import END_INDEX
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
CurvePosition = tuple[int, float]  # number of a curve, position on it
Stretch = tuple[int, float, float]  # number of a curve, first and last position on it
FACES_IN_STATE = "contacts/void_faces"  # of `get_state`: a row for each stretch of a void's faces
VOIDS_IN_STATE = "contacts/voids"  # a row for each void


@dataclass
class Void:
    """A void: its faces (curve, first, after the last), area, volume, perimeter, cells' depth.

    shrinks_alone: its faces are one run of a single body's, without a contact: no two lines around
    it can close on each other; isentrope_constant: p V^gamma of its gas; closing_volume: that at
    which it was found closed (0: it is not); stiffness: rho c² around it then; growth: of its
    volume in the step before.
    """

    faces: list[tuple[int, int, int]]
    area: float
    volume: float
    perimeter: float
    depth: float
    shrinks_alone: bool = False
    isentrope_constant: float = 0.0
    closing_volume: float = 0.0
    stiffness: float = 0.0
    growth: float = 0.0

    def predict_pressure(self, gamma: float) -> float:
        """Pressure in the middle of the step, if the volume goes on as in the step before."""
        volume = self.volume + 0.5 * max(-0.5 * self.volume, min(self.growth, self.volume))
        return self._compute_pressure(volume, gamma)

    def _compute_pressure(self, volume: float, gamma: float) -> float:
        """Pressure of the gas; below the closing volume also that of the material."""
        pressure = self.isentrope_constant / volume**gamma
        if self.closing_volume > volume:
            pressure += self.stiffness * (self.closing_volume / volume - 1.0)
        return pressure

    def compute_resistance_energy(self, volume: float) -> float:
        """Work that it has taken to compress it below `closing_volume`, [J] per depth or per
        radian."""
        if volume >= self.closing_volume:
            return 0.0
        return self.stiffness * (
            self.closing_volume * math.log(self.closing_volume / volume)
            - self.closing_volume
            + volume
        )

    def compute_gas_energy(self, volume: float, gamma: float) -> float:
        """Energy of the gas in it, [J] per depth or per radian."""
        return self.isentrope_constant * volume ** (1.0 - gamma) / (gamma - 1.0)

    def compute_mean_pressure(self, change: float, gamma: float) -> float:
        """The pressure that does the work by which the void's energy falls, in a change of
        volume."""
        volume = self.volume + change
        if abs(change) < SMALL_VOLUME_CHANGE * self.volume:
            return self._compute_pressure(self.volume + 0.5 * change, gamma)
        released_energy = self.compute_gas_energy(self.volume, gamma)
        released_energy -= self.compute_gas_energy(volume, gamma)
        released_energy += self.compute_resistance_energy(self.volume)
        released_energy -= self.compute_resistance_energy(volume)
        return released_energy / change


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
        self._lasting_crossings = self._find_lasting_crossings()
        self._ends_on_planes = self._find_ends_on_planes()
        self.present: list[Void] = []
        # of the voids that resist: their work in this step, and their energy after it [J]
        self.work = 0.0
        self.energy_left = 0.0
        self._search_forced = True  # at the start
        self._has_pressed = False  # has any face a pressure from a void?

    def are_due(self, step: int, touching: bool) -> bool:
        """Whether to look for voids in this step: large empty ones are searched only now and
        then."""
        if self._search_forced or self.pressure > 0.0 or step % STEPS_PER_VOID_SEARCH == 0:
            return touching or self._search_forced or bool(self.present)
        return any(
            void.isentrope_constant != 0.0
            or void.closing_volume != 0.0
            or void.area < (LARGE_VOID_DEPTHS * void.depth) ** 2
            for void in self.present
        )

    def find(self) -> None:
        """The voids of the present lines, with what those before held; their faces' pressures."""
        self._search_forced = False
        before = self.present
        self.present = [self._measure(*loop) for loop in self._find_loops()]
        self.present = [
            void for void in self.present if void.area > (SLIVER_DEPTHS * void.depth) ** 2
        ]
        self._hand_on(before)
        self._press()

    # --- ways round ------------------------------------------------------------------------------

    def _find_loops(self) -> list[tuple[list[Stretch], bool]]:
        """Closed loops around voids, as stretches of curves, without those that are points.

        And of each, whether it runs along no contact.
        """
        crossings, of_contacts = self._find_crossings()
        loops = []
        seen = set()
        for start in [
            target for crossings_of_curve in crossings.values() for _, target in crossings_of_curve
        ]:
            place = start
            stretches = []
            length = 0.0
            is_free = True
            while place not in seen:
                seen.add(place)
                curve, position = place
                beyond = [step for step in crossings.get(curve, ()) if step[0] >= position - 1e-9]
                if not beyond:
                    break
                stop, place = min(beyond)
                is_free = is_free and (curve, stop, place) not in of_contacts
                stretches.append((curve, position, stop))
                length += stop - position if curve < len(self.surfaces) else 0.0
            if stretches and place == start and length > 1e-6:
                loops.append((stretches, is_free))
        return loops

    def _find_lasting_crossings(self) -> list[tuple[int, float, int, float]]:
        """Crossings from curve to curve, at positions on both, that stay: at ends, planes'
        corners."""
        crossings = []
        first = len(self.surfaces)
        for number, surface in enumerate(self.surfaces):
            for following, next_surface in enumerate(self.surfaces):
                is_joined = surface.ends[1] is not None and surface.ends[1] is next_surface.ends[0]
                if is_joined and np.array_equal(
                    surface.line[:, -1], next_surface.line[:, 0]
                ):  # no image
                    crossings.append((number, float(surface.count), following, 0.0))
        for k, one_plane in enumerate(self.planes, first):
            for m, two_plane in enumerate(self.planes, first):
                along = one_plane.along
                other_along = two_plane.along
                rise_rate = float(
                    along[0] * other_along[1] - along[1] * other_along[0]
                )  # how fast the height over b rises along a
                if rise_rate < -1e-9:
                    offset = two_plane.origin - one_plane.origin
                    position = (
                        float(offset[0] * other_along[1] - offset[1] * other_along[0]) / rise_rate
                    )
                    other_position = float(
                        (one_plane.origin + position * along - two_plane.origin) @ other_along
                    )
                    crossings.append((k, position, m, other_position))
        return crossings

    def _find_ends_on_planes(self) -> list[tuple[int, int, int]]:
        """Ends of surfaces that planes hold: numbers of surface, end and plane."""
        first = len(self.surfaces)
        return [
            (number, end, side)
            for number, surface in enumerate(self.surfaces)
            for side, plane in enumerate(self.planes, first)
            for end, key_node in enumerate(surface.ends)
            if key_node is not None and plane.holds(key_node)
        ]

    def _find_crossings(
        self,
    ) -> tuple[dict[int, list[tuple[float, CurvePosition]]], set[tuple[int, float, CurvePosition]]]:
        """By curve the positions where it goes over to another, and to where; those of contacts."""
        crossings = list(self._lasting_crossings)
        # surfaces that end on a plane
        for number, end, side in self._ends_on_planes:
            surface = self.surfaces[number]
            plane = self.planes[side - len(self.surfaces)]
            position_on_plane = float(
                (surface.line[:, END_INDEX[end]] - plane.origin) @ plane.along
            )
            if end == 0:
                crossings.append((side, position_on_plane, number, 0.0))
            else:
                crossings.append((number, float(surface.count), side, position_on_plane))
        first_contact = len(crossings)
        # contacts: from one curve to the other at both ends of each stretch of facets
        for pair in self.pairs:
            if not (pair.is_near and pair.count):
                continue
            leader = self.numbers[id(pair.leader)]
            follower = self.numbers[id(pair.follower)]
            ends = pair.facets.ends[:, : pair.count]
            breaks = np.flatnonzero(ends[LEADER_START, 1:] != ends[LEADER_STOP, :-1])
            for k in (0, *(breaks + 1)):
                leader_position = self._convert(pair, ends[LEADER_START, k])
                crossings.append(
                    (leader, leader_position, follower, float(ends[FOLLOWER_START, k]))
                )
            for k in (*breaks, pair.count - 1):
                leader_position = self._convert(pair, ends[LEADER_STOP, k])
                crossings.append((follower, float(ends[FOLLOWER_STOP, k]), leader, leader_position))
        # which of the crossings are those of contacts
        of_contacts = {
            (curve, position, (target, target_position))
            for curve, position, target, target_position in crossings[first_contact:]
        }
        # by the curve on which they begin
        crossings_by_curve: dict[int, list[tuple[float, CurvePosition]]] = {}
        for curve, position, target, target_position in crossings:
            crossings_by_curve.setdefault(curve, []).append((position, (target, target_position)))
        return crossings_by_curve, of_contacts

    @staticmethod
    def _convert(pair: Pair, position: float) -> float:
        """A position on the leader; on a plane in metres from its origin."""
        if not isinstance(pair, PlanePair):
            return float(position)
        plane = pair.leader
        start = (plane.line[:, 0] - plane.origin) @ plane.along
        return float(start + position * ((plane.line[:, 1] - plane.line[:, 0]) @ plane.along))

    def _take_points(self, curve: int, start: float, stop: float) -> np.ndarray:
        """Points (2, n) of a curve between two positions."""
        if curve >= len(self.surfaces):
            plane = self.planes[curve - len(self.surfaces)]
            return plane.origin[:, None] + plane.along[:, None] * np.array([start, stop])
        line = self.surfaces[curve].line
        a = math.floor(start)
        b = min(math.floor(stop), line.shape[1] - 2)
        first, last = (
            line[:, k : k + 1] + (position - k) * (line[:, k + 1 : k + 2] - line[:, k : k + 1])
            for k, position in ((min(a, line.shape[1] - 2), start), (b, stop))
        )
        return np.concatenate([first, line[:, a + 1 : math.ceil(stop)], last], axis=1)

    def _shrinks_alone(self, stretches: list[Stretch], is_free: bool) -> bool:
        """Whether the surfaces of a loop follow each other, but for planes that hold the outer
        ends."""
        surfaces = [curve for curve, _, _ in stretches if curve < len(self.surfaces)]
        if not is_free or any(
            self._is_unaffected_by_voids(self.surfaces[curve]) for curve in surfaces
        ):
            return False
        are_planes = [curve >= len(self.surfaces) for curve, _, _ in stretches]
        # times that the way round leaves a plane for a surface
        before = [are_planes[-1], *are_planes[:-1]]
        runs = sum(was and not is_now for was, is_now in zip(before, are_planes, strict=True))
        # a third plane would be opposite to the surfaces
        return runs <= 1 and sum(are_planes) <= 2

    @staticmethod
    def _is_unaffected_by_voids(surface: Surface) -> bool:
        """Whether a surface is one that voids do not press on."""
        return surface.rigid or surface.segment.tension > 0.0

    def _measure(self, stretches: list[Stretch], is_free: bool) -> Void:
        """Area and volume of a loop, depth of the cells along it; is_free: without a contact."""
        points = np.concatenate([self._take_points(*stretch) for stretch in stretches], axis=1)
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
                depths_of_nodes = (
                    surface.inner[:, first : last + 1] - surface.line[:, first : last + 1]
                )
                depth.append(float(np.hypot(*depths_of_nodes).mean()))
        perimeter = float(np.hypot(x_next - x, y_next - y).sum())
        shrinks_alone = self._shrinks_alone(stretches, is_free)
        return Void(faces, area, volume, perimeter, sum(depth) / max(1, len(depth)), shrinks_alone)

    # --- what they hold --------------------------------------------------------------------------

    def _hand_on(self, before: list[Void]) -> None:
        """Give the gas of the voids before to those that have their faces; fill new ones."""
        for void in self.present:
            parents = [old for old in before if _share_faces(old, void)]
            if not parents:
                void.isentrope_constant = self.pressure * void.volume**self.gamma
            # those with the same pressure
            children = [v for v in self.present if any(_share_faces(old, v) for old in parents)]
            volume_before = sum(old.volume for old in parents)
            volume_now = sum(child.volume for child in children)
            for old in parents:
                pressure = old.isentrope_constant / old.volume**self.gamma
                void.isentrope_constant += (
                    pressure
                    * old.volume
                    / volume_before
                    * (volume_before / volume_now * void.volume) ** self.gamma
                )
            if len(parents) == len(children) == 1:
                void.growth = volume_now - volume_before
            # its share of what its parents resist
            void.closing_volume = sum(old.closing_volume for old in parents) * (
                void.volume / volume_now if parents else 0.0
            )
            void.stiffness = max((old.stiffness for old in parents), default=0.0)
            if void.closing_volume == 0.0 and self._is_closing(void):
                void.closing_volume = void.volume
            elif void.volume > void.closing_volume:
                void.closing_volume = void.stiffness = 0.0

    @staticmethod
    def _is_closing(void: Void) -> bool:
        """Whether these are the last cells of a round void, on which no two lines could close."""
        small = void.area < (SMALL_VOID_DEPTHS * void.depth) ** 2
        is_round = void.area > ROUND_VOID_PART * void.perimeter**2
        return void.shrinks_alone and small and is_round

    def _press(self) -> None:
        """Write the pressures in the voids beside their faces."""
        pressures = [void.predict_pressure(self.gamma) for void in self.present]
        if self._has_pressed or any(pressures):
            for surface in self.surfaces:
                if not surface.rigid and surface.segment.tension == 0.0:
                    surface.press(0.0)
            for void, pressure in zip(self.present, pressures, strict=True):
                for curve, first, last in void.faces:
                    if self.surfaces[curve].segment.tension == 0.0:
                        self.surfaces[curve].press(pressure, first, last)
        self._has_pressed = any(pressures)

    # --- phases of a step ------------------------------------------------------------------------

    def fill_ghosts(self, t: float, dt: float) -> None:
        """The pressures with which a step begins, every time that it is tried."""
        for void in self.present:
            if void.closing_volume > 0.0 and void.stiffness == 0.0:  # it has just closed
                void.stiffness = max(
                    self.surfaces[curve].find_stiffness(first) for curve, first, _ in void.faces
                )
        if any(void.closing_volume > 0.0 for void in self.present):
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
        for void in self.present:
            if void.closing_volume == 0.0:
                continue
            change = 0.0
            for curve, first, last in void.faces:
                change -= dt * float(self.surfaces[curve].gather_swept()[first:last].sum())
                pressed.setdefault(curve, set()).update(range(first, last))
            if void.volume + change < LEAST_VOID_VOLUME_LEFT * void.volume:
                raise RegridFailure("contact: a void closes in one step", cause="contact-lost")
            pressure = void.compute_mean_pressure(change, self.gamma)
            self._has_pressed = True
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
        return {"voids": len(self.present), "void_area": sum(void.area for void in self.present)}

    def get_state(self) -> dict[str, Any]:
        """What the voids held, and the faces by which they are known again."""
        faces = [(n, *face) for n, void in enumerate(self.present) for face in void.faces]
        numbers = [
            (
                v.area,
                v.volume,
                v.perimeter,
                v.depth,
                v.shrinks_alone,
                v.isentrope_constant,
                v.closing_volume,
                v.stiffness,
            )
            for v in self.present
        ]
        return {
            FACES_IN_STATE: np.array(faces, dtype=np.int64).reshape(-1, 4),
            "contacts/voids_asked": self._search_forced,
            VOIDS_IN_STATE: np.array(numbers, dtype=np.float64).reshape(-1, 8),
        }

    def get_state_for(self, other_voids: Voids) -> dict[str, Any]:
        """The state for the same surfaces with other numbers of faces."""
        state = self.get_state()
        for row in state[FACES_IN_STATE]:
            curve = row[1]
            count = self.surfaces[curve].count
            count_there = other_voids.surfaces[curve].count
            row[2] = row[2] * count_there // count
            row[3] = -(-row[3] * count_there // count)
        return state

    def set_state(self, state: Any) -> None:
        """Take up a state of `get_state`."""
        self.present = []
        if state.get(VOIDS_IN_STATE) is not None:
            self._search_forced = bool(state["contacts/voids_asked"])
            self.present = [Void([], *map(float, row)) for row in state[VOIDS_IN_STATE]]
            for number, *faces in np.asarray(state[FACES_IN_STATE]).tolist():
                self.present[number].faces.append(tuple(faces))
        self._has_pressed = True


def _share_faces(void: Void, other_void: Void) -> bool:
    """Whether two voids, of different times, have a face in common."""
    return any(
        curve == there and first < end and start < last
        for curve, first, last in void.faces
        for there, start, end in other_void.faces
    )
