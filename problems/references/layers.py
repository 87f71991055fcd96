"""Plane waves through layers of elastic-plastic solids by a Lagrangian code of its own, in numpy.

Independent of the scheme of `hydro`: cells of fixed mass, acoustic Riemann solutions with the
impedances rho c_l of both sides, minmod slopes of velocity and stress over the mass, Heun's two
stages [Wilkins1964; Toro1997].  Both outer surfaces are free.  It serves problems that have no
closed solution, such as plates whose releases meet.

Note: contacts between layers stay closed, also in tension, and nothing spalls.  With steeper slopes
than minmod's an overshoot behind a shock unloads some cells, whose deviator then stays wrong: the
plateau behind an elastic release is 0.1% too fast at any number of cells.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from shockgrid.problems.references.elastic_plastic import Solid

COURANT_NUMBER = 0.4


@dataclass(frozen=True)
class Layer:
    """A layer of a solid: thickness [m], how many cells, speed at the start [m/s]."""

    solid: Solid
    thickness: float
    cells: int
    speed: float = 0.0


@dataclass
class LayerState:
    """The flow at one time: node places x (n + 1) [m]; of the cells (n,) speed u, specific total
    energy, density, pressure and deviator along the wave, tension positive [SI]."""

    x: np.ndarray
    u: np.ndarray
    energy: np.ndarray
    rho: np.ndarray
    p: np.ndarray
    deviator: np.ndarray
    # speed of both surfaces at the times so far: times, first surface, last surface
    trace: list[tuple[float, float, float]] = field(default_factory=list)

    @property
    def centres(self) -> np.ndarray:
        """Places of the cells' centres [m]."""
        return 0.5 * (self.x[1:] + self.x[:-1])

    @property
    def stress(self) -> np.ndarray:
        """Compressive stress p - s [Pa]."""
        return self.p - self.deviator


class LayeredPlates:
    """Layers from left to right, the first beginning at x = 0, which touch from the start."""

    def __init__(self, layers: Sequence[Layer]):
        self.layers = tuple(layers)
        edges = np.cumsum([0, *(layer.cells for layer in layers)])
        self.spans = [slice(first, last) for first, last in itertools.pairwise(edges)]
        widths = np.concatenate(
            [np.full(layer.cells, layer.thickness / layer.cells) for layer in layers]
        )
        rho = self._spread(lambda layer: layer.solid.rho0)
        self.mass = rho * widths
        self.shear_modulus = self._spread(lambda layer: layer.solid.shear_modulus)
        self.limit = self._spread(lambda layer: layer.solid.limit)
        u = self._spread(lambda layer: layer.speed)
        rest = self._spread(lambda layer: float(layer.solid.eos.energy(layer.solid.rho0, 0.0)))
        x = np.concatenate([[0.0], np.cumsum(widths)])
        zeros = np.zeros(len(u))
        self.state = LayerState(x, u, rest + 0.5 * u**2, rho, zeros, zeros)
        self.t = 0.0

    def _spread(self, value: Callable[[Layer], float]) -> np.ndarray:
        """A number of each layer in its cells (n,)."""
        return np.concatenate([np.full(layer.cells, value(layer)) for layer in self.layers])

    def _by_layer(self, method: str, *values: np.ndarray) -> np.ndarray:
        """A method of each layer's equation of state for arrays of all cells (n,)."""
        parts = [
            getattr(layer.solid.eos, method)(*(one[span] for one in values))
            for layer, span in zip(self.layers, self.spans, strict=True)
        ]
        return np.concatenate(parts)

    def _find_sound(self, state: LayerState) -> np.ndarray:
        """Speed of longitudinal waves (n,) [m/s]."""
        sound = self._by_layer("sound_speed", state.rho, state.p)
        return np.sqrt(sound**2 + 4.0 / 3.0 * self.shear_modulus / state.rho)

    def advance_to(self, t: float) -> LayerState:
        """March to the time `t` [s] and return the state, whose trace grows by each step."""
        while self.t < t * (1.0 - 1e-14):
            sound = self._find_sound(self.state)
            dt = COURANT_NUMBER * float((np.diff(self.state.x) / sound).min())
            dt = min(dt, t - self.t)
            self._step(dt)
        return self.state

    def _step(self, dt: float) -> None:
        """Heun's method: the mean of the state and of two Euler steps."""
        old = self.state
        first, speeds = self._take_euler_step(old, dt)
        second, _ = self._take_euler_step(first, dt)
        x = 0.5 * (old.x + second.x)
        u = 0.5 * (old.u + second.u)
        energy = 0.5 * (old.energy + second.energy)
        # the mean of both deviators, which is within the yield limit as they are
        deviator = 0.5 * (old.deviator + second.deviator)
        self.state = self._close(x, u, energy, deviator)
        self.t += dt
        self.state.trace = old.trace
        self.state.trace.append((self.t, float(speeds[0]), float(speeds[-1])))

    def _take_euler_step(self, old: LayerState, dt: float) -> tuple[LayerState, np.ndarray]:
        """The state after dt, and the speeds of the nodes (n + 1)."""
        speeds, tension = self._solve_faces(old)
        x = old.x + dt * speeds
        u = old.u + dt / self.mass * np.diff(tension)
        energy = old.energy + dt / self.mass * np.diff(tension * speeds)
        compression = np.diff(old.x) / np.diff(x)
        deviator = old.deviator - 4.0 / 3.0 * self.shear_modulus * np.log(compression)
        deviator = np.clip(deviator, -self.limit, self.limit)
        return self._close(x, u, energy, deviator), speeds

    def _close(self, x, u, energy, deviator) -> LayerState:
        """The state with density and pressure that belong to it."""
        rho = self.mass / np.diff(x)
        p = self._by_layer("pressure", rho, energy - 0.5 * u**2)
        return LayerState(x, u, energy, rho, p, deviator)

    def _solve_faces(self, state: LayerState) -> tuple[np.ndarray, np.ndarray]:
        """Speed [m/s] and tension [Pa] of the nodes (n + 1)."""
        tension = -state.stress
        impedance = state.rho * self._find_sound(state)
        half = 0.5 * self.mass
        u_slope = self._limit_slopes(state.u)
        t_slope = self._limit_slopes(tension)
        u_before = (state.u + half * u_slope)[:-1]
        u_after = (state.u - half * u_slope)[1:]
        t_before = (tension + half * t_slope)[:-1]
        t_after = (tension - half * t_slope)[1:]
        z_before = impedance[:-1]
        z_after = impedance[1:]
        total = z_before + z_after
        u_face = (z_before * u_before + z_after * u_after + t_after - t_before) / total
        t_face = (
            z_after * t_before + z_before * t_after + z_before * z_after * (u_after - u_before)
        ) / total
        # free surfaces
        first = state.u[0] - half[0] * u_slope[0]
        first += (tension[0] - half[0] * t_slope[0]) / impedance[0]
        last = state.u[-1] + half[-1] * u_slope[-1]
        last -= (tension[-1] + half[-1] * t_slope[-1]) / impedance[-1]
        speeds = np.concatenate([[first], u_face, [last]])
        return speeds, np.concatenate([[0.0], t_face, [0.0]])

    def _limit_slopes(self, values: np.ndarray) -> np.ndarray:
        """Minmod slopes over the mass; none at the outer cells and across contacts."""
        distance = 0.5 * (self.mass[1:] + self.mass[:-1])
        slopes = np.diff(values) / distance
        for span in self.spans[:-1]:
            slopes[span.stop - 1] = 0.0
        before = np.concatenate([[0.0], slopes])
        after = np.concatenate([slopes, [0.0]])
        smaller = np.where(np.abs(before) < np.abs(after), before, after)
        return np.where(before * after > 0.0, smaller, 0.0)
