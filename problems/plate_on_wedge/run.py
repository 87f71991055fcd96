"""The run of a plate on a wedge: where the collision point is, which phase it is, when it ends."""

import math

import numpy as np

from shockgrid.hydro.facets.lines import project
from shockgrid.hydro.motion.overlaps import is_inside
from shockgrid.hydro.simulation import Simulation
from shockgrid.hydro.sliding.contact import SlidingContact
from shockgrid.problems.plate_on_wedge import report
from shockgrid.problems.signals import find_crossing
from shockgrid.regrid.curves import compute_arc_lengths
from shockgrid.regrid.measure.corners import compute_centres

LEAST_JET = 3  # cells that make a jet
MET_LINE_SPACINGS = 0.5  # of the local spacing: lines as near as this have met
BEHIND = (3, 9)  # faces behind the collision point between which pressure and angle are averaged
SHOCK_ROWS = (2, 10)  # grid lines from the contact on which a shock's place is looked for
HANGING_SPACINGS = 0.1  # spacings below its undisturbed height at which a free surface is a jet's
CLOSED_NOTCH_SPACINGS = 0.02  # of the same: the sides of a notch a few nodes deep have met
APART_NODES = 6  # nodes along a line that do not count as another part of it


class PlateRun(Simulation):
    """The flow, its phases and its end; the phases' times belong to the state."""

    def __init__(self, problem, blocks, links, **options):
        super().__init__(blocks, links, **options)
        self.problem = problem
        self.plate = blocks[0]
        self.wedge = blocks[1]
        self.times = dict.fromkeys(report.PHASES, math.nan)
        self.start = np.array([problem.deck.edge, 0.0])
        self.contact: SlidingContact | None = None  # where plate and wedge are bodies of their own
        if not problem.deck.gap:
            self.contact = self.exchange.contacts[0]
            self.contact.refinement = problem.refinement
            self.start = self.find_contact_point().copy()

    def get_lower_line(self) -> np.ndarray:
        """Nodes (2, n) of the plate's lower side, from the wedge's edge outwards."""
        return self.plate.nodes[:, :, 0]

    def find_touching(self) -> tuple[int, np.ndarray]:
        """Faces of the plate's lower side before A, and A's place (2,), with a gap at the start.

        A is the last node of plate or wedge that lies on the other; the edge's end at first.
        """
        self.meetings.find(self.t, self.step)
        nodes = [0]
        points = [self.start]
        for pair in self.meetings.with_facets:
            parts = [(half.surface, half.pins.positions) for half, _ in pair.halves]
            segments = [getattr(surface, "segment", None) for surface, _ in parts]
            sides = {segment.block: segment.side for segment in segments if segment}
            if sides.get(self.plate) != "j_min" or sides.get(self.wedge) != "j_max":
                continue
            for surface, positions in parts:
                touching = np.flatnonzero(positions >= 0.0)
                points += list(surface.line[:, touching].T)
                if surface.block is self.plate:
                    nodes += list(touching)
        return int(max(nodes)), max(points, key=self.measure_along)

    def count_contact(self) -> int:
        """Faces of the plate's lower side from its end over the edge up to A."""
        return self.contact.follower.count if self.contact else self.find_touching()[0]

    def find_contact_point(self) -> np.ndarray:
        """Place (2,) of A."""
        if self.contact:
            return self.get_lower_line()[:, self.contact.follower.count]
        return self.find_touching()[1]

    def get_free_line(self) -> np.ndarray:
        """Nodes (2, n) of the plate's free lower side, from A on."""
        return self.get_lower_line()[:, self.count_contact() :]

    def get_end_face(self) -> np.ndarray:
        """Nodes (2, n) of the wedge's end face, from the top down."""
        return self.wedge.nodes[:, -1, ::-1]

    def is_at_end(self) -> bool:
        """Has A come to the end B of the face?"""
        if self.contact:
            return self.contact.fixed[1] >= 0  # its end that runs
        free = self.get_free_line()
        away = self.get_end_face()[:, 0] - self.find_contact_point()
        step = free[:, 1] - free[:, 0] if free.shape[1] > 1 else np.full(2, np.inf)
        return bool(np.hypot(*away) < MET_LINE_SPACINGS * np.hypot(*step))

    def measure_along(self, point: np.ndarray) -> float:
        """How far a point is along the direction of the face [m]."""
        return math.cos(self.problem.angle) * point[0] - math.sin(self.problem.angle) * point[1]

    def measure_path(self) -> float:
        """Path of A along the face [m]; NaN behind B where bodies move freely."""
        if not self.contact and math.isfinite(self.times["arrived"]):
            return math.nan
        return float(self.measure_along(self.find_contact_point() - self.start))

    def measure_jet(self) -> tuple[float, int, float]:
        """Greatest speed in the plate [m/s], cells of its jet and their mass [kg/m]."""
        plate = self.blocks[0]
        speed = np.hypot(plate.u, plate.v)
        fast = speed > report.JET_SPEED_RATIO * self.problem.plate_speed
        mass = float((plate.volume * plate.rho)[fast].sum())
        return float(speed.max()), int(fast.sum()), mass

    def measure(self) -> dict[str, float]:
        """Columns of the history: A, the states behind it, the jet, the phase."""
        point = self.find_contact_point()
        count = self.count_contact()
        first, last = BEHIND
        line = self.get_lower_line()[:, count::-1]  # of the contact, from A backwards
        _, u, v, pressure = self.plate.state[:, 1:-1, 1]
        surface = np.hypot(u, v)
        arrived = math.isfinite(self.times["arrived"])
        behind = math.nan
        direction = np.full(2, math.nan)
        if count >= last:
            behind = float(pressure[count - last : count - first].mean())
            direction = line[:, first] - line[:, last]
        fastest, cells, mass = self.measure_jet()
        means = np.full(len(report.COLUMNS), math.nan)  # at fixed parts of A's path, while it runs
        if not arrived:
            arc = compute_arc_lengths(line)
            behind_a = pressure[:count][::-1]
            ringing = (
                report.REFINED_RINGING if self.problem.refinement > 1.0 else report.RINGING_FACES
            )
            pressures = behind_a[: arc.size - 1]
            means = report.measure_profile(arc, pressures, self.measure_path(), ringing)
        free = surface[count:]
        # number of the phase entered last in PHASES, 0 before the first
        entered = [(t, k) for k, t in enumerate(self.times.values(), 1) if math.isfinite(t)]
        return {
            "contact_x": float(point[0]),
            "contact_y": float(point[1]),
            "contact_path": self.measure_path(),
            "contact_pressure": behind,
            **dict(zip(report.COLUMNS, map(float, means), strict=True)),
            "interface_angle": -math.degrees(math.atan2(direction[1], direction[0])),
            "shock_angle_plate": self.measure_shock_angle(self.plate, point, in_wedge=False),
            "shock_angle_wedge": self.measure_shock_angle(self.wedge, point, in_wedge=True),
            "surface_speed": float(np.median(free)) if free.size else math.nan,
            "lead": math.nan if arrived else self.measure_lead(),
            "jet_speed": fastest if cells >= LEAST_JET else 0.0,
            "jet_mass": mass,
            "phase": float(max(entered)[1] if entered else 0),
        }

    def measure_lead(self) -> float:
        """How far [m, along the face] the plate is ahead of where its lower side should meet it.

        That place is where the height of the outer half of the free surface, not yet disturbed,
        meets the face.  Counted are A and the free surface where it hangs below that height.  A
        jet has a growing lead, attached shocks have none.
        """
        free = self.get_free_line()
        height = float(np.median(free[1, free.shape[1] // 2 :]))
        spacing = float(np.hypot(*np.diff(free)).mean())
        hangs = free[:, free[1] < height - HANGING_SPACINGS * spacing]
        sine = math.sin(self.problem.angle)
        cosine = math.cos(self.problem.angle)
        ahead = cosine * (hangs[0] - self.start[0]) - sine * (hangs[1] - self.start[1])
        return float(np.append(ahead, self.measure_path()).max() - (self.start[1] - height) / sine)

    def measure_shock_angle(self, block, point: np.ndarray, in_wedge: bool) -> float:
        """Angle [degrees] of the shock at A to the flow of its body towards A; NaN without one.

        On each of a few grid lines beside the contact the outermost place is found where the
        pressure falls through half of theory's (or of its own largest value); the angle is that of
        the straight line from A through these places.
        """
        nodes = block.nodes
        p = block.p
        rows = np.arange(*SHOCK_ROWS)
        rows = -1 - rows[rows < block.nj] if in_wedge else rows[rows < block.nj]
        low, high = np.sort((rows[0], rows[-1])) + (block.nj if in_wedge else 0)
        centres = compute_centres(nodes[:, :, low : high + 2])
        p = p[:, low : high + 1]
        collision = self.problem.collision
        cells = np.arange(float(p.shape[0]))
        level = 0.5 * (collision.p if collision.attached else float(p.max()))
        fronts = [find_crossing(cells, column, level) for column in p.T]
        positions = [
            [np.interp(front, cells, places[:, j]) for places in centres]
            for j, front in enumerate(fronts)
            if math.isfinite(front)
        ]
        if len(positions) < 3:
            return math.nan
        away = np.array(positions).T - point[:, None]
        direction = math.atan2(*away.sum(axis=1)[::-1]) % (2.0 * math.pi)
        if in_wedge:  # the wedge's material comes up along its face
            return math.degrees(direction - (math.pi - self.problem.angle))
        return math.degrees(math.pi - direction)

    def advance(self) -> dict:
        """One step; then looks which phase it is and whether the run is at its end."""
        row = super().advance()
        far = 1e-2 * self.problem.deck.face
        begun = {
            "attached": lambda: np.hypot(*self.find_contact_point() - self.start) > far,
            "arrived": self.is_at_end,
            "jet": lambda: self.measure_jet()[1] >= LEAST_JET,
        }
        for phase, is_there in begun.items():
            if not math.isfinite(self.times[phase]) and is_there():
                self.times[phase] = self.t
        reason = self.find_closure()
        if reason and not self.finished:
            self.times["closed"] = self.t
            self.finished = reason
        self.finished = self.finished or self.find_arrival()
        return row

    def find_arrival(self) -> str | None:
        """The words for a run that ends at B, once A is there."""
        if self.problem.ends_at_arrival and math.isfinite(self.times["arrived"]):
            return "A has arrived at the end B of the face"
        return None

    def find_closure(self) -> str | None:
        """What the plate's free surface has met, in words, or None."""
        from scipy.spatial.distance import cdist  # slow to load

        free = self.get_free_line()
        if free.shape[1] < 2:
            return None  # all of the plate's lower side lies on the wedge
        problem = self.problem
        steps = np.hypot(*np.diff(free))
        spacing = np.minimum(np.append(steps, steps[-1]), np.append(steps[0], steps))
        near = MET_LINE_SPACINGS * spacing
        if (free[1] < problem.base + near).any():
            return "the jet has met the base on which the wedge stands"
        if problem.deck.right == "symmetry":
            inner = slice(0, free.shape[1] - APART_NODES)
            turned = np.maximum.accumulate(free[0])[:-1] > free[0][1:] + spacing[1:]
            away = problem.length - free[0][inner] < near[inner]
            if turned.any() and away.any():
                return "cavity closed: the free surface has met the symmetry plane"
        if self.contact and math.isfinite(self.times["arrived"]):
            face = self.get_end_face()
            if face.shape[1] > 4 and free.shape[1] > APART_NODES:
                away = cdist(free[:, APART_NODES:].T, face[:, 2:].T)
                if (away.min(axis=1) < near[APART_NODES:]).any() or self.is_folded(
                    free, face, near
                ):
                    return "cavity closed: the jet has met the end face of the wedge"
        away = cdist(free.T, free.T)
        index = np.arange(free.shape[1])
        away[np.abs(index[:, None] - index) < APART_NODES] = np.inf
        if (away.min(axis=1) < near).any():
            return "cavity closed: the free surface has met itself"
        if has_closed_notch(free, CLOSED_NOTCH_SPACINGS * spacing):
            return "cavity closed: the free surface has met itself at the root of the jet"
        return None

    def is_folded(self, free: np.ndarray, face: np.ndarray, near: np.ndarray) -> bool:
        """Has the free surface beside A come so far through the wedge's end face?

        Both lines begin at A, where no contact is between them.
        """
        for k, (x, y) in enumerate(free[:, 1:APART_NODES].T, 1):
            if is_inside((x, y), self.wedge.nodes):
                away = min(project(face, a, x, y)[1] for a in range(face.shape[1] - 1))
                if away > near[k] ** 2:
                    return True
        return False

    def get_state(self) -> dict:
        """The state of the flow, and the times of the phases."""
        times = np.array([self.times[phase] for phase in report.PHASES])
        own = {"phase_times": times, "plate_start": self.start.copy()}
        return super().get_state() | own

    def set_state(self, state) -> None:
        """Take up a state of `get_state`."""
        super().set_state(state)
        self.start = np.array(state["plate_start"], dtype=float)
        self.times = dict(zip(report.PHASES, map(float, state["phase_times"]), strict=True))
        if math.isfinite(self.times["closed"]):
            self.finished = self.find_closure()
        self.finished = self.finished or self.find_arrival()


def has_closed_notch(line: np.ndarray, near: np.ndarray) -> bool:
    """Have the sides of a notch that is a few nodes deep met?

    line (2, n): with the outside on its right; near (n,): distances [m].  The sides of a notch see
    each other through the outside, those of a jet's tip through the body.
    """
    other_way = line[:, ::-1]
    return _has_met_ahead(line, near, 1.0) or _has_met_ahead(other_way, near[::-1], -1.0)


def _has_met_ahead(line: np.ndarray, near: np.ndarray, orientation: float) -> bool:
    """Is a node as near to one of the next faces, through the outside of the line?

    orientation: 1 where the outside is on the right, -1 where it is on the left.
    """
    along = line[:, 2:] - line[:, :-2]
    outwards = orientation * np.array([along[1], -along[0]]) / np.hypot(*along)
    faces = np.diff(line)
    for apart in range(1, APART_NODES):
        # of inner node k the face from k + apart on
        face = faces[:, 1 + apart :]
        count = face.shape[1]
        way = line[:, 1 + apart : -1] - line[:, 1 : 1 + count]
        part = np.clip(-np.sum(way * face, axis=0) / np.sum(face * face, axis=0), 0.0, 1.0)
        way = way + part * face
        distance = np.hypot(*way)
        ahead = np.sum(outwards[:, :count] * way, axis=0)
        # most of the way goes outwards
        if ((distance < near[1 : 1 + count]) & (ahead > 0.5 * distance)).any():
            return True
    return False
