"""Growth and roll-up of an interface between two incompressible fluids as a vortex sheet.

Independent of the grids and the scheme of `hydro`: an interface between fluids of constant density
is a sheet of vorticity along a periodic curve.  With the place z = y + i x (growth is along x), the
label a from 0 to 2 pi and the circulation g of the sheet per label, it moves at the mean q of the
velocities on both sides,

    conj(q) = 1/(2 i L) PV ∫ g cot(pi (z - z')/L) da',   L the wavelength,

and the difference of the densities makes circulation [BakerMeironOrszag1982]:

    dg/dt = 2 A [dq/dt · z_a + (g²/|z_a|²)_a / 8],   A = (rho2 - rho1)/(rho2 + rho1),

with d/dt at points that move at q, and the first fluid at smaller x.  dq/dt contains dg/dt: each
step solves a linear system.  A shock's impulse on a fluid at rest, the speed V along x, makes
g = 2 A [q · z_a + V x_a] at once.

A sheet is unstable at every wavelength.  Like the interfaces of `hydro` it is given a smoothing
length d: waves of the circulation along it decay at the rate

    V d³ k⁴,   V the mean of |g|/|z_a| plus that of |q - mean q| along the sheet.

The interfaces of `hydro` let waves of the curve decay at that rate (theory F6.3).  On a straight
sheet both give the same growth (theory F6.6), but here energy is only lost.

Points are kept at even distances along the curve by a tangential velocity, and become more as the
curve grows [HouLowengrubShelley1994].  The integral is the sum over sources between the points,
derivatives are those of Fourier series: both are exact to round-off while the curve is resolved.
Time steps are those of Runge and Kutta of fourth order.
"""

from __future__ import annotations

import math

import numpy as np

SLIP_PART = 0.1  # of the distance of points by which the sheet slips in a step, at most
POINTS_GROWTH = 1.15  # of the points, as soon as they are too far apart
SOURCES_PER_POINT = 2  # of the integral: turns of a roll may be as near as half of the points
FINE_POINTS = 8192  # of the first curve, to space the sheet's points on it
FILTER_STRENGTH = 36.0  # at the shortest wave, exp(-36) is round-off
FILTER_ORDER = 24


class VortexSheet:
    """A periodic sheet; lengths in wavelengths, x = amplitude cos(2 pi y) at first.

    `atwood`: A; `speed`: of the impulse; `smoothing`: d; `distance`: of points, at most.
    """

    def __init__(
        self,
        amplitude: float,
        atwood: float,
        speed: float,
        smoothing: float,
        distance: float = 1.0 / 64.0,
    ):
        self.atwood = atwood
        self.smoothing = smoothing
        self.distance = distance
        self.t = 0.0
        length = _measure_wave(amplitude, FINE_POINTS)[-1]
        self._set_points(_count_points(length, distance))
        y = _space_evenly(amplitude, self.points)
        self.z = y + 1j * amplitude * np.cos(2.0 * math.pi * y)
        slope = self._find_slope(self.z)
        cotangent = self._find_cotangents(self.z)[0]
        self.g = self._solve(slope, cotangent, 2.0 * atwood * speed * slope.imag)

    def _set_points(self, points: int) -> None:
        """Labels, Fourier operators and weights of so many points."""
        self.points = points
        wavenumbers = np.fft.fftfreq(points, 1.0 / points)
        self._derive = 1j * np.where(np.abs(wavenumbers) < points / 2, wavenumbers, 0.0)
        shortness = np.abs(wavenumbers) / (0.5 * points)
        self._filter = np.exp(-FILTER_STRENGTH * shortness**FILTER_ORDER)
        self._label = 2.0 * math.pi * np.arange(points) / points
        # sources of the integral, between the points
        sources = SOURCES_PER_POINT * points
        self._source_label = 2.0 * math.pi * (np.arange(sources) + 0.5) / sources
        self._weight = 2.0 * math.pi / sources / 2j  # in the units of conj(q)

    def _add_points(self) -> None:
        """More points where the curve has grown, on the Fourier series through the old ones."""
        length = float(np.abs(self._find_slope(self.z)).mean()) * 2.0 * math.pi
        if length <= self.points * self.distance:
            return
        points = _count_points(POINTS_GROWTH * length, self.distance)
        wave = _interpolate(self.z - self._label / (2.0 * math.pi), points)
        self.g = _interpolate(self.g, points).real
        self._set_points(points)
        self.z = wave + self._label / (2.0 * math.pi)

    @property
    def amplitude(self) -> float:
        """Half of the extent along x, of the trigonometric curve through the points."""
        fine = _interpolate(self.z.imag, 8 * self.points)
        return 0.5 * float(np.ptp(fine.real))

    def trace(self, count: int) -> np.ndarray:
        """Points x, y (2, count) of the trigonometric curve through the sheet's points."""
        label = np.arange(count) / count
        z = _interpolate(self.z - self._label / (2.0 * math.pi), count) + label
        return np.array([z.imag, z.real])

    def measure_invariants(self) -> tuple[float, float]:
        """Circulation of a wavelength, which stays 0, and its mean place x, which stays 0 too.

        The mean place is the area between the sheet and x = 0.
        """
        step = 2.0 * math.pi / self.points
        area = float(np.sum(self.z.imag * self._find_slope(self.z).real) * step)
        return float(self.g.sum() * step), area

    def measure_energy(self) -> float:
        """Kinetic energy of both fluids over their mean density, in a wavelength.

        Half of the flux of the potential through the sheet: with the potentials p1, p2 on both
        sides, whose difference along the sheet is the circulation, and the normal velocity.
        """
        step = 2.0 * math.pi / self.points
        slope = self._find_slope(self.z)
        speed = self._find_mean_speed(self.z, self.g)
        through = (np.conj(slope) * speed).imag  # times |z_a|
        along = (np.conj(slope) * speed).real
        # potentials of the mean velocity and of half of the jump, up to constants
        mean = self._integrate(along)
        half_jump = 0.5 * self._integrate(self.g)
        first = (1.0 - self.atwood) * (mean + half_jump)
        second = (1.0 + self.atwood) * (mean - half_jump)
        return 0.5 * float(np.sum((first - second) * through) * step)

    def advance_to(self, t: float) -> None:
        """March to the time `t`."""
        while self.t < t * (1.0 - 1e-13):
            self._add_points()
            dt = min(self._choose_step(), t - self.t)
            self._step(dt)
            self.t += dt

    def _choose_step(self) -> float:
        """A step in which the sheet slips by a part of the points' distance."""
        slope = self._find_slope(self.z)
        distance = float(np.abs(slope).mean()) * 2.0 * math.pi / self.points
        slip = float(np.abs(self.g / slope).max())
        return SLIP_PART * distance / max(slip, np.finfo(float).tiny)

    def _step(self, dt: float) -> None:
        """A step of Runge and Kutta of fourth order."""
        z = self.z
        g = self.g
        total_z = np.zeros_like(z)
        total_g = np.zeros_like(g)
        late_z, late_g = z, g
        for part, weight in ((0.5, 1.0), (0.5, 2.0), (1.0, 2.0), (0.0, 1.0)):
            rate_z, rate_g = self._find_rates(late_z, late_g)
            total_z += weight / 6.0 * rate_z
            total_g += weight / 6.0 * rate_g
            late_z = z + part * dt * rate_z
            late_g = g + part * dt * rate_g
        straight = self._label / (2.0 * math.pi)
        wave = z + dt * total_z - straight
        self.z = np.fft.ifft(np.fft.fft(wave) * self._filter) + straight
        decay = np.exp(-dt * self._find_decay())
        self.g = np.fft.ifft(np.fft.fft(g + dt * total_g) * self._filter * decay).real

    def _find_decay(self) -> np.ndarray:
        """Rates (n,) at which the waves of the circulation decay."""
        slope = np.abs(self._find_slope(self.z))
        speed = self._find_mean_speed(self.z, self.g)
        scale = np.abs(self.g / slope).mean() + np.abs(speed - speed.mean()).mean()
        return scale * self.smoothing**3 * np.abs(self._derive / slope.mean()) ** 4

    def _find_rates(self, z: np.ndarray, g: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """dz/dt and dg/dt (n,) at the points."""
        slope = self._find_slope(z)
        length = np.abs(slope)
        tangent = slope / length
        cotangent, square = self._find_cotangents(z)
        source_g = _spread(g).real
        speed = np.conj(_add_up(cotangent, source_g))
        strength = g / length
        # along the normal: the mean velocity and the smoothing
        curvature = (np.conj(tangent) * self._differentiate(tangent)).imag / length
        normal_speed = (np.conj(tangent) * speed).imag
        # along the tangent: what keeps the points' distances even, beyond the mean velocity
        turning = curvature * length
        slide = self._integrate(turning * normal_speed)
        extra = slide - (np.conj(tangent) * speed).real
        rate = tangent * (slide + 1j * normal_speed)
        # baroclinic: dq/dt at points that move at q, without what dg/dt adds to it
        approach = rate[:, None] - _spread(rate)[None, :]
        change = np.conj(-math.pi * _add_up(square * approach, source_g))
        change -= extra / length * self._differentiate(speed)
        pressed = (np.conj(slope) * change).real + self._differentiate(strength**2) / 8.0
        right = 2.0 * self.atwood * pressed + self._differentiate(extra * strength)
        return rate, self._solve(slope, cotangent, right)

    def _solve(self, slope: np.ndarray, cotangent: np.ndarray, right: np.ndarray) -> np.ndarray:
        """The f with f = 2 A q(f) · z_a + right, q(f) the mean velocity of a circulation f."""
        matrix = _gather((slope[:, None] * cotangent).real)
        return np.linalg.solve(np.eye(self.points) - 2.0 * self.atwood * matrix, right)

    def _find_cotangents(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Weights (n, sources) that make conj(q) of g there, and those of 1/sin² instead of cot."""
        straight = 1.0 / (2.0 * math.pi)
        sources = _spread(z - self._label * straight) + self._source_label * straight
        cotangent = 1.0 / np.tan(math.pi * (z[:, None] - sources[None, :]))
        return self._weight * cotangent, self._weight * (1.0 + cotangent**2)

    def _find_mean_speed(self, z: np.ndarray, g: np.ndarray) -> np.ndarray:
        """q (n,)."""
        return np.conj(_add_up(self._find_cotangents(z)[0], _spread(g).real))

    def _find_slope(self, z: np.ndarray) -> np.ndarray:
        """z_a (n,)."""
        straight = 1.0 / (2.0 * math.pi)
        return self._differentiate(z - self._label * straight) + straight

    def _differentiate(self, values: np.ndarray) -> np.ndarray:
        """Derivative along the label of a periodic function (n,)."""
        found = np.fft.ifft(np.fft.fft(values) * self._derive)
        return found if np.iscomplexobj(values) else found.real

    def _integrate(self, values: np.ndarray) -> np.ndarray:
        """Integral along the label of what of a periodic function (n,) has no mean, with mean 0."""
        parts = np.fft.fft(values)
        known = self._derive != 0.0
        parts[known] /= self._derive[known]
        parts[~known] = 0.0
        return np.fft.ifft(parts).real


def _interpolate(values: np.ndarray, points: int) -> np.ndarray:
    """Values (points,), complex, of the Fourier series through fewer values (n,)."""
    parts = np.fft.fft(values)
    half = (values.size + 1) // 2
    longer = np.zeros(points, dtype=complex)
    longer[:half] = parts[:half]
    longer[-half + 1 :] = parts[-half + 1 :]
    return np.fft.ifft(longer) * (points / values.size)


def _spread(values: np.ndarray) -> np.ndarray:
    """Values (sources,), complex, at the sources between the points."""
    return _interpolate(values, 2 * SOURCES_PER_POINT * values.size)[1::2]


def _gather(rows: np.ndarray) -> np.ndarray:
    """The matrix (n, n) that does to values at points what rows (n, sources) do at sources.

    That is the transpose of `_spread`, row by row.
    """
    count, sources = rows.shape
    fine = np.zeros((count, 2 * sources))
    fine[:, 1::2] = rows
    parts = np.fft.fft(fine, axis=1)
    half = (count + 1) // 2
    kept = np.zeros((count, count), dtype=complex)
    kept[:, :half] = parts[:, :half]
    kept[:, -half + 1 :] = parts[:, -half + 1 :]
    return np.fft.ifft(kept, axis=1).real


def _add_up(weights: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Sums (n,) of weights (n, m) times values (m,).

    A product of matrices would start threads, which for so few numbers cost more than they save.
    """
    return (weights * values).sum(axis=1)


def _count_points(length: float, distance: float) -> int:
    """An even number of points at most so far apart on a curve."""
    return 2 * math.ceil(0.5 * length / distance)


def _measure_wave(amplitude: float, count: int) -> np.ndarray:
    """Lengths (count + 1,) of x = amplitude cos(2 pi y) up to even heights from 0 to 1."""
    y = (np.arange(count) + 0.5) / count
    steps = np.sqrt(1.0 + (2.0 * math.pi * amplitude * np.sin(2.0 * math.pi * y)) ** 2)
    return np.concatenate([[0.0], np.cumsum(steps)]) / count


def _space_evenly(amplitude: float, points: int) -> np.ndarray:
    """Heights y (n,) of points at even distances along x = amplitude cos(2 pi y)."""
    length = _measure_wave(amplitude, FINE_POINTS)
    heights = np.linspace(0.0, 1.0, FINE_POINTS + 1)
    return np.interp(np.arange(points) / points, length / length[-1], heights)
