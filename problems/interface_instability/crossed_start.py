"""The state just after the shock has crossed the interface: grids and cells of both blocks.

A captured shock that runs over a bent line leaves waves of a few cells on it and layers of wrong
density beside it.  Here the run begins a time T after the shock met the mean line, T being such
that the nearer of the two waves that it leaves is `layer` cells away.  Everything is known then:

- Each row of cells sees the plane Riemann shocked, at its own time and place (theory F15.1).
- Linear compressible theory gives what has grown since then, harmonic by harmonic of the line
  (theory F15.2 to F15.4).
- A shock stands on a grid line, with the discrete profile that it has on cells that move as those
  of the run (`problems.initial_states`), and meets the lines beyond at once in all rows (theory
  F15.6).  Head and tail of a rarefaction are grid lines.
"""

import functools
import math
from dataclasses import dataclass

import numpy as np

from shockgrid.problems.initial_states import Front, settle_front
from shockgrid.problems.interface_instability.shocked import Shocked
from shockgrid.problems.interface_instability.spacing import grow_steps
from shockgrid.problems.references.linear_growth import PerturbedFlow, PerturbedLayer
from shockgrid.problems.references.riemann import compute_cell_averages

CLEAR_TIME_RATIO = 8.0  # least T over the time in which the shock runs over the line's amplitude
THIN_RAREFACTION_CELLS = 0.5  # cells: a thinner rarefaction is no more than its cells' averages
FAINT_HARMONIC_PART = 1e-9  # of the largest: harmonics that are round-off
FRONT_REACH_WAVELENGTHS = 1.0  # wavelengths beyond a front in which lines become straight
LEAST_JUMP = 1e-3  # of the pressure: a weaker shock's cells are its jump, mixed by volume


@dataclass(frozen=True)
class Wave:
    """A harmonic of the first line: h(y) = amplitude cos(wavenumber y + phase) [m]."""

    wavenumber: float
    amplitude: float
    phase: float


def find_waves(y: np.ndarray, x: np.ndarray, even: bool) -> list[Wave]:
    """All harmonics of a line x (n,) at even heights y (n,), whose sum is x at these heights.

    Between walls (`even`) cosines alone.
    """
    cells = y.size - 1
    unit = (math.pi if even else 2.0 * math.pi) / (y[-1] - y[0])
    if even:
        parts = np.fft.rfft(np.concatenate([x, x[-2:0:-1]])) / cells
    else:
        parts = np.fft.rfft(x[:-1]) * 2.0 / cells
    parts[0] = 0.0
    if even or cells % 2 == 0:
        parts[-1] *= 0.5
    least = FAINT_HARMONIC_PART * np.abs(parts).max()
    return [
        Wave(unit * number, float(abs(part)), float(np.angle(part)))
        if abs(part.imag) > FAINT_HARMONIC_PART * abs(part)
        else Wave(unit * number, float(part.real), 0.0)
        for number, part in enumerate(parts)
        if abs(part) > least
    ]


def find_nearer_speed(base) -> float:
    """Speed [m/s], from the interface, of the nearer of the waves that leave it."""
    return min(base.u - base.left_wave.tail, base.right_wave.tail - base.u)


class CrossedStart:
    """The state after the shock met the mean line, at the start of the run.

    line: first places x (n,) [m] of the interface's nodes; ends: first places [m] of the far sides,
    which are_open or are not.
    """

    def __init__(
        self, shocked: Shocked, line: np.ndarray, ends: tuple[float, float], are_open: bool
    ):
        self.shocked = shocked
        self.since = -shocked.arrival
        self.base = shocked.linear_growth.base
        self.shock = shocked.shock
        self.y = shocked.heights
        self.ends = ends
        self.are_open = are_open
        self.waves = find_waves(self.y, line, shocked.deck.sides == "wall")

    @functools.cached_property
    def fields(self) -> list:
        """Linear theory's perturbed flow of each harmonic at T."""
        theory = self.shocked.linear_growth
        return [theory.compute_fields(wave.wavenumber * self.since) for wave in self.waves]

    def sum_waves(self, y: np.ndarray, parts, sine: bool = False) -> np.ndarray:
        """Sum over the harmonics of `parts` (an array or number each) times the wave at y (m,)."""
        total = 0.0
        for wave, part in zip(self.waves, parts, strict=True):
            angle = wave.wavenumber * y + wave.phase
            shape = np.sin(angle) if sine else np.cos(angle)
            total = total + wave.amplitude * np.multiply.outer(part, shape)
        return total + np.zeros(np.shape(y))

    @functools.cached_property
    def line(self) -> np.ndarray:
        """Places x (n,) [m] of the interface's nodes."""
        return self.base.u * self.since + self.sum_waves(
            self.y, [flow.amplitude for flow in self.fields]
        )

    @functools.cached_property
    def sides(self) -> list:
        """Both blocks."""
        return [Side(self, sign) for sign in (-1.0, 1.0)]

    def make_states(self) -> list[np.ndarray]:
        """rho, u, v, p (4, ni, nj) of the cells of both blocks at the start."""
        signal = max(side.front.measure_signal() for side in self.sides)
        return [side.make_state(signal) for side in self.sides]


class Side:
    """One block in distances outwards from the interface: sign -1 the first, 1 the second."""

    def __init__(self, start: CrossedStart, sign: float):
        self.start = start
        self.sign = sign
        shocked = start.shocked
        base = start.base
        shock = shocked.shock
        deck = shocked.deck
        if sign < 0.0:
            self.eos = shocked.eos_first
            self.wave = base.left_wave
            rho = base.rho_left
            self.ahead = shock.rho, sign * shock.particle_speed, shock.p
        else:
            self.eos = shocked.eos_second
            self.wave = base.right_wave
            rho = base.rho_right
            self.ahead = shocked.rho_second, 0.0, deck.pressure
        self.behind = rho, sign * base.u, base.p
        self.end_speed = (self.behind if start.are_open else self.ahead)[1]
        self.length = abs(start.ends[int(sign > 0.0)] - base.u * start.since)
        self.speeds = [abs(self.wave.tail - base.u)]  # of fronts, from the interface
        size = deck.wavelength / deck.cells
        if abs(self.wave.head - self.wave.tail) * start.since > THIN_RAREFACTION_CELLS * size:
            self.speeds.append(abs(self.wave.head - base.u))
        self.away, self.places = self._make_spacing(size)

    def _make_spacing(self, size: float) -> tuple[np.ndarray, list[int]]:
        """Distances (n,) of the mean nodes from the interface, and the fronts' numbers in them."""
        edges = [0.0]
        places = [0]
        sizes = size
        positions = [np.zeros(1)]
        for speed in self.speeds:
            width = speed * self.start.since - edges[-1]
            count = max(1, round(width / size))
            sizes = width / count
            positions.append(edges[-1] + sizes * np.arange(1.0, count + 1.0))
            edges.append(float(positions[-1][-1]))
            places.append(places[-1] + count)
        if len(self.speeds) > 1:
            sizes = size
        remaining_length = self.length - edges[-1]
        even = self.start.shocked.deck.uniform * self.start.shocked.deck.wavelength
        positions.append(
            edges[-1] + self._grade(remaining_length, sizes, max(0.0, even - edges[-1]))
        )
        return np.concatenate(positions), places[1:]

    def _grade(self, length: float, size: float, even: float) -> np.ndarray:
        """Distances (n,) up to `length` of nodes that begin with `size`, grown beyond `even`."""
        stretch = self.start.shocked.deck.stretch
        steps = [size] * max(1, round(min(even, length) / size))
        steps = grow_steps(steps, stretch, length)
        # the first cells keep their size, those beyond take up what is too much, in proportion
        # to their distance from the first
        positions = np.cumsum(steps)
        part = positions / positions[-1]
        return positions - (positions[-1] - length) * part**2

    @property
    def is_shock(self) -> bool:
        return len(self.speeds) == 1 and self.wave.kind == "shock"

    @functools.cached_property
    def front(self) -> Front:
        """The shock on the mean nodes."""
        speed = self.sign * self.wave.head
        place = self.places[0]
        return Front(self.eos, self.behind, self.ahead, speed, self.away, place, self.end_speed)

    def get_layer(self, flow: PerturbedFlow) -> PerturbedLayer:
        """The side's own of both."""
        return flow.first if self.sign < 0.0 else flow.second

    def make_nodes(self) -> np.ndarray:
        """First grid (2, ni + 1, nj + 1), with lines through the interface and the fronts."""
        start = self.start
        x = start.base.u * start.since + self.sign * self.away[:, None] + np.zeros(start.y.size)
        bends = [
            self._bend_lines(wave, flow)
            for wave, flow in zip(start.waves, start.fields, strict=True)
        ]
        x += start.sum_waves(start.y, bends)
        x = x[::-1] if self.sign < 0.0 else x
        return np.array([x, np.broadcast_to(start.y, x.shape)])

    def _bend_lines(self, wave: Wave, flow: PerturbedFlow) -> np.ndarray:
        """Amplitudes (n,) over a0 of the mean nodes' lines, for one harmonic.

        Each is what makes the shock meet the whole line at once, as linear theory has both; so
        that it has the same place in the cells of all rows.  What the line moves with the interface
        until then is part of it (theory F15.6).  Lines beyond the reach are straight.
        """
        start = self.start
        theory = self.start.shocked.linear_growth
        front = self.away[self.places[-1]]
        amplitudes = [flow.amplitude]
        for speed in self.speeds:
            u = start.base.u + self.sign * speed
            amplitudes.append(1.0 - u / start.shock.shock_speed)
        reach = FRONT_REACH_WAVELENGTHS * 2.0 * math.pi / wave.wavenumber
        left = np.maximum(0.0, 1.0 - np.maximum(0.0, self.away - front) / min(reach, self.length))
        fade = left * left * (3.0 - 2.0 * left)
        if not self.is_shock:
            return np.interp(self.away, [0.0, *self.away[self.places]], amplitudes) * fade
        rate = (self.end_speed - self.behind[1]) / self.length  # of the cells' growth
        passage = (self.away - front) / (self.speeds[0] - self.away * rate)
        passage = np.maximum(passage, 0.0)
        t = start.since + passage
        rest = 1.0 - self.away / self.length
        shape = theory.get_front(0 if self.sign < 0.0 else 1, wave.wavenumber, t)
        if math.isnan(self.get_layer(flow).front):
            shape = np.full(t.size, amplitudes[1])
        bend = shape - theory.get_amplitude(wave.wavenumber, t) * rest
        bend = (bend / (1.0 + rate * passage) + flow.amplitude * rest) * fade
        number = self.places[0]
        slope = (bend[number + 1] - bend[number]) / (self.away[number + 1] - front)
        inner = self.away[:number]
        straight = bend[number] + slope * (inner - front)
        offset = flow.amplitude - (bend[number] - slope * front)
        bend[:number] = straight + offset * (1.0 - inner / front) ** 3
        return bend

    def _make_row(self, signal: float) -> tuple[np.ndarray, np.ndarray]:
        """rho, u outwards and p (3, n) of the cells of a row, and the part (n,) of the jump from
        the state ahead to that behind which they have."""
        count = self.away.size - 1
        row = np.repeat(np.array(self.ahead)[:, None], count, axis=1)
        row[:, : self.places[0]] = np.array(self.behind)[:, None]
        if self.is_shock:
            if abs(self.behind[2] - self.ahead[2]) > LEAST_JUMP * abs(self.ahead[2]):
                deck = self.start.shocked.deck
                cfl = deck.run.cfl * self.front.measure_signal() / signal
                first, settled = settle_front(self.front, cfl=cfl, limiter=deck.limiter)
                row[:, first : first + settled.shape[1]] = settled[:, : count - first]
            jump = self.behind[1] - self.ahead[1]
            return row, (row[1] - self.ahead[1]) / jump if jump else np.zeros(count)
        edges = self.start.base.u * self.start.since + self.sign * self.away
        rho, momentum, p = compute_cell_averages(
            self.start.base, edges[:: int(self.sign)], self.start.since
        )
        fan = np.array([rho, self.sign * momentum / rho, p])[:, :: int(self.sign)]
        cells = slice(self.places[0], self.places[-1])
        row[:, cells] = fan[:, cells]
        inside = np.zeros(count)
        inside[: self.places[-1]] = 1.0
        return row, inside

    def make_state(self, signal: float) -> np.ndarray:
        """rho, u, v, p (4, ni, nj) of the cells; `signal` [1/s]: the fastest of both sides."""
        start = self.start
        row, part = self._make_row(signal)
        rows = start.y.size - 1
        state = np.repeat(row[:, :, None], rows, axis=2)
        middle = 0.5 * (self.away[1:] + self.away[:-1]) / start.since
        y = 0.5 * (start.y[1:] + start.y[:-1])
        inside = slice(0, int(np.flatnonzero(part > 1e-9)[-1]) + 1 if part.any() else 0)
        layers = [self.get_layer(flow) for flow in start.fields]
        fields = [layer.interpolate(middle[inside]) * part[inside] for layer in layers]
        # for a harmonic of amplitude a theory's are for k a0 = 1; means over the rows' heights
        high = start.y[1] - start.y[0]
        scales = [w.wavenumber * np.sinc(0.5 * w.wavenumber * high / math.pi) for w in start.waves]
        parts = [scale * field for scale, field in zip(scales, fields, strict=True)]
        v = np.zeros((row.shape[1], rows))
        if parts:
            for n, q in enumerate((0, 1, 3)):
                state[n, inside] += start.sum_waves(y, [field[q] for field in parts])
            v[inside] = start.sum_waves(y, [field[2] for field in parts], sine=True)
        rho, u, p = state
        state = np.array([rho, self.sign * u, v, p])
        return state[:, ::-1] if self.sign < 0.0 else state
