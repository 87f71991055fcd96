"""Plates that collide, part and spall, by a Lagrangian code of its own, in numpy.

    python -m oracles.colliding_plates Al1100:1:100:1000 Cu:2:160:0:0.1 1.6

The command takes plates from left to right as material:thickness:cells:speed[:gap] in mm and m/s,
then the time in microseconds, and prints the mean speed of every plate at the end.

Independent of the scheme of `hydro`: cells of fixed mass that move with their material, states at
faces by the acoustic Riemann problem with the impedances of shocks, limited slopes over the mass,
Heun's two stages [Wilkins1964; Toro1997].  Equations of state and tensile strengths are those of
the library: a cell of fragments bears the tension that `hydro.eos.conversion` gives.  Two surfaces
are in contact while they touch and their pressure is not negative; a step ends where two meet.

Note: as the waves are sharp, mean speeds converge in first order; `find_speeds` extrapolates.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from shockgrid.hydro.eos.conversion import make_conversion
from shockgrid.hydro.eos.materials import find_material

COURANT_NUMBER = 0.4
# of a shock's impedance: rho (c + SHOCK_SLOPE * jump of the speed)
SHOCK_SLOPE = 1.2
# of the thinnest cell: surfaces that are no further apart touch
TOUCHING = 1e-9


@dataclass(frozen=True)
class Plate:
    """A plate: material of the library, thickness [m], cells, speed [m/s], gap before it [m]."""

    material: str
    thickness: float
    cells: int
    speed: float = 0.0
    gap: float = 0.0


@dataclass
class PlateState:
    """Nodes x (n + plates) [m]; of the cells (n,) speed, total energy per mass, rho, p, c [SI]."""

    x: np.ndarray
    u: np.ndarray
    total: np.ndarray
    rho: np.ndarray
    p: np.ndarray
    c: np.ndarray


@dataclass
class Trace:
    """At the end of each step: time [s], speed of the last surface [m/s]."""

    t: list[float] = field(default_factory=list)
    last_speed: list[float] = field(default_factory=list)


class CollidingPlates:
    """Plates in a row in plane flow, with vacuum before, between and behind them."""

    def __init__(self, plates: Sequence[Plate]):
        self.plates = tuple(plates)
        found = [find_material(plate.material) for plate in plates]
        self.equations = [
            (make_conversion(type(material.eos)).to_pressure, material.eos.parameters)
            for material in found
        ]
        edges = np.cumsum([0, *(plate.cells for plate in plates)])
        self.spans = [slice(first, last) for first, last in itertools.pairwise(edges)]
        # nodes of plate k: its cells' edges, one more than cells
        self.node_spans = [
            slice(span.start + k, span.stop + k + 1) for k, span in enumerate(self.spans)
        ]
        x = []
        low = 0.0
        for plate in plates:
            low += plate.gap
            x.append(low + np.linspace(0.0, plate.thickness, plate.cells + 1))
            low += plate.thickness
        rho = np.concatenate([np.full(p.cells, m.rho0) for p, m in zip(plates, found, strict=True)])
        self.mass = rho * np.concatenate([np.diff(nodes) for nodes in x])
        u = np.concatenate([np.full(plate.cells, plate.speed) for plate in plates])
        e = np.concatenate(
            [
                np.full(p.cells, m.eos.energy(m.rho0, 0.0))
                for p, m in zip(plates, found, strict=True)
            ]
        )
        self.touching = [plate.gap == 0.0 for plate in plates[1:]]
        self.made = sum(self.touching)
        self.opened = 0
        self.t = 0.0
        self.trace = Trace()
        self.state = self._close(np.concatenate(x), u, e + 0.5 * u**2)

    @property
    def mean_speeds(self) -> list[float]:
        """Mean speed of each plate [m/s]."""
        u = self.state.u
        return [float(np.average(u[span], weights=self.mass[span])) for span in self.spans]

    def advance_to(self, t: float) -> None:
        """March to the time `t` [s]; surfaces that meet end a step."""
        while self.t < t * (1.0 - 1e-14):
            widths = self._find_widths(self.state.x)
            dt = COURANT_NUMBER * float((widths / self.state.c).min())
            self._step(min(dt, t - self.t))

    def _find_widths(self, x: np.ndarray) -> np.ndarray:
        return np.concatenate([np.diff(x[span]) for span in self.node_spans])

    def _close(self, x: np.ndarray, u: np.ndarray, total: np.ndarray) -> PlateState:
        """The state with density, pressure and sound speed that belong to it."""
        rho = self.mass / self._find_widths(x)
        p = np.empty_like(rho)
        c = np.empty_like(rho)
        e = total - 0.5 * u**2
        for (to_pressure, parameters), span in zip(self.equations, self.spans, strict=True):
            p[span], _, _, square = to_pressure(rho[span], e[span], parameters)
            c[span] = np.sqrt(square)
        return PlateState(x, u, total, rho, p, c)

    def _step(self, dt: float) -> None:
        """Heun's method; then contacts are opened and made."""
        old = self.state
        speeds, p = self._solve_faces(old)
        first = self._take_euler_step(old, speeds, p, dt)
        later_speeds, later_p = self._solve_faces(first)
        speeds = 0.5 * (speeds + later_speeds)
        p = 0.5 * (p + later_p)
        touch = self._find_touch(old.x, speeds)
        if touch < dt:
            dt = touch
        self.state = self._take_euler_step(old, speeds, p, dt)
        self.t += dt
        self._update_contacts(speeds)
        self.trace.t.append(self.t)
        self.trace.last_speed.append(float(speeds[-1]))

    def _take_euler_step(self, old, speeds, p, dt) -> PlateState:
        """The state after dt, with given speeds and pressures of the nodes."""
        x = old.x + dt * speeds
        force = np.concatenate([np.diff(p[span]) for span in self.node_spans])
        work = np.concatenate([np.diff((p * speeds)[span]) for span in self.node_spans])
        return self._close(x, old.u - dt / self.mass * force, old.total - dt / self.mass * work)

    def _find_gaps(self, values: np.ndarray) -> list[float]:
        """Difference of a nodes' quantity across each gap."""
        pairs = itertools.pairwise(self.node_spans)
        return [float(values[after.start] - values[before.stop - 1]) for before, after in pairs]

    def _find_touch(self, x: np.ndarray, speeds: np.ndarray) -> float:
        """Time until the first two surfaces meet [s]."""
        gaps = self._find_gaps(x)
        closing = self._find_gaps(speeds)
        waits = zip(gaps, closing, self.touching, strict=True)
        return min(
            (gap / -speed for gap, speed, touches in waits if speed < 0.0 and not touches),
            default=np.inf,
        )

    def _update_contacts(self, speeds: np.ndarray) -> None:
        """Surfaces touch that have met, and no longer where they have parted."""
        x = self.state.x
        least = TOUCHING * float(self._find_widths(x).min())
        closing = self._find_gaps(speeds)
        for k, gap in enumerate(self._find_gaps(x)):
            before = self.node_spans[k].stop - 1
            if self.touching[k]:
                self.touching[k] = closing[k] == 0.0 or gap <= least
                self.opened += not self.touching[k]
            elif gap <= least and closing[k] < 0.0:
                self.touching[k] = True
                self.made += 1
            if self.touching[k]:
                x[before] = x[before + 1] = 0.5 * (x[before] + x[before + 1])

    def _solve_faces(self, state: PlateState) -> tuple[np.ndarray, np.ndarray]:
        """Speed and pressure of all nodes (n + plates)."""
        half = 0.5 * self.mass
        speeds = np.empty_like(state.x)
        pressures = np.empty_like(state.x)
        z = state.rho * state.c
        ends = []
        for nodes, span in zip(self.node_spans, self.spans, strict=True):
            u_step = half[span] * limit_slopes(state.u[span], self.mass[span])
            p_step = half[span] * limit_slopes(state.p[span], self.mass[span])
            low = state.u[span] - u_step, state.p[span] - p_step, z[span], state.rho[span]
            high = state.u[span] + u_step, state.p[span] + p_step, z[span], state.rho[span]
            inner = slice(nodes.start + 1, nodes.stop - 1)
            left = [values[:-1] for values in high]
            right = [values[1:] for values in low]
            speeds[inner], pressures[inner] = solve_contact(left, right)
            # free surfaces: released to p = 0
            speeds[nodes.start] = low[0][0] - low[1][0] / z[span][0]
            speeds[nodes.stop - 1] = high[0][-1] + high[1][-1] / z[span][-1]
            pressures[[nodes.start, nodes.stop - 1]] = 0.0
            ends.append(([values[0] for values in low], [values[-1] for values in high]))
        for k, touches in enumerate(self.touching):
            if not touches:
                continue
            u, p = solve_contact(ends[k][1], ends[k + 1][0])
            if p > 0.0:
                pair = [self.node_spans[k].stop - 1, self.node_spans[k + 1].start]
                speeds[pair] = u
                pressures[pair] = p
        return speeds, pressures


def solve_contact(left, right):
    """Speed and pressure between two states (u, p, rho c, rho), with the impedances of shocks."""
    u_l, p_l, z_l, rho_l = left
    u_r, p_r, z_r, rho_r = right
    jump = 0.5 * SHOCK_SLOPE * np.maximum(u_l - u_r, 0.0)
    z_l = z_l + rho_l * jump
    z_r = z_r + rho_r * jump
    total = z_l + z_r
    u = (z_l * u_l + z_r * u_r + p_l - p_r) / total
    p = (z_r * p_l + z_l * p_r + z_l * z_r * (u_l - u_r)) / total
    return u, p


def limit_slopes(values: np.ndarray, mass: np.ndarray) -> np.ndarray:
    """Harmonic means of two slopes over the mass [VanLeer1974]; outer cells have one alone."""
    slopes = np.diff(values) / (0.5 * (mass[1:] + mass[:-1]))
    before = np.concatenate([slopes[:1], slopes])
    after = np.concatenate([slopes, slopes[-1:]])
    product = before * after
    rises = product > 0.0
    total = np.where(rises, before + after, 1.0)
    return np.where(rises, 2.0 * product / total, 0.0)


def find_speeds(plates: Sequence[Plate], t: float) -> tuple[np.ndarray, int, int]:
    """Mean speeds [m/s] at a time, extrapolated from the plates' cells and twice as many; contacts
    made and opened with these."""
    row = CollidingPlates(plates)
    fine = CollidingPlates([replace(plate, cells=2 * plate.cells) for plate in plates])
    for each in (row, fine):
        each.advance_to(t)
    speeds = 2.0 * np.array(fine.mean_speeds) - np.array(row.mean_speeds)
    return speeds, fine.made, fine.opened


def read_plate(text: str) -> Plate:
    """A plate of the command line (see above)."""
    material, thickness, cells, speed, *gap = text.split(":")
    return Plate(
        material,
        1e-3 * float(thickness),
        int(cells),
        float(speed),
        1e-3 * float(gap[0]) if gap else 0.0,
    )


if __name__ == "__main__":
    *plate_texts, time = sys.argv[1:]
    speeds, made, opened = find_speeds(
        [read_plate(text) for text in plate_texts], 1e-6 * float(time)
    )
    for number, speed in enumerate(speeds, 1):
        print(f"plate {number}: {speed:.2f} m/s")
    print(f"{made} contacts made, {opened} opened")
