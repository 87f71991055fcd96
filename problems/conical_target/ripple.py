"""A ripple on the line between the cone and the lead: its shape, its growth, what theory says.

The ripple is a wave of one length along the cone's side, put on it across the side.  Over one wave
at either end it rises from nothing, so that the ends and the angles there stay: graphite that
begins as a sharper edge between steel and lead is squeezed out of it.

The whole side bends while the shock runs along it and after.  Therefore the amplitude is measured
place by place: the line within a wavelength to either side is fitted by a parabola and a sine and
cosine of that length, weighted by a squared cosine that is nothing at the window's ends, and the
amplitude is that of the latter two.  The window goes with the wave, which drifts after the shock's
passage (`problems.references.refracted_shock`).  The traps: in a window of one wavelength parabola
and wave cannot be told apart, and the amplitude depends on where the crests are (twofold at k a =
1); while the shock is within a window the line has a kink there, and the fit means nothing.
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np

from problems.references.hugoniot import shock_with_particle_speed
from problems.references.refracted_shock import CrossedLine, cross_line
from problems.references.riemann import solve_riemann
from problems.references.shock_polars import Body
from regrid.errors import BadInput
from regrid.measure.quality import find_bad_cells

LEAST_CELLS = 6  # a wave: the thickness of interfaces holds shorter ones back (theory F6.6)
POINTS = 24  # between two nodes, in fits
COVERED = 0.93  # of a window that the line has to fill


class SideFrame:
    """Places along the cone's first side and heights over it, towards the lead [m]."""

    def __init__(self, deck):
        self.start = np.array([deck.front, deck.base])
        way = np.array([deck.cone, deck.tip - deck.base])
        self.length = float(np.hypot(*way))
        self.along = way / self.length
        self.across = np.array([-self.along[1], self.along[0]])

    def measure(self, line: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Place and height (n,) of the points of a line (2, n)."""
        away = line - self.start[:, None]
        return self.along @ away, self.across @ away


class Ripple:
    """The ripple that a deck of `conical-target` asks for; `materials` as its problem has them."""

    def __init__(self, deck, materials: dict):
        self.deck, self.materials = deck, materials
        self.frame = SideFrame(deck)
        self.amplitude, self.wavelength = deck.ripple_amplitude, deck.ripple_wavelength
        self.wavenumber = 2.0 * math.pi / self.wavelength
        length = self.frame.length
        if self.amplitude > 0.0 and 3.0 * self.wavelength > length:
            raise BadInput(
                f"deck: ripple_wavelength is {self.wavelength:g} m; the cone's side is "
                f"{length:.4g} m long and must have room for three waves"
            )

    def __bool__(self) -> bool:
        return self.amplitude > 0.0

    def compute_heights(self, position: np.ndarray) -> np.ndarray:
        """Heights (n,) [m] over the side at the places (n,) along it [m]."""
        inside = np.minimum(position, self.frame.length - position) / self.wavelength
        rise = np.sin(0.5 * math.pi * np.clip(inside, 0.0, 1.0)) ** 2
        return self.amplitude * rise * np.sin(self.wavenumber * position + self.deck.ripple_phase)

    def compute_shift(self, line: np.ndarray) -> np.ndarray:
        """How far (2, n) the nodes of the straight side (2, n) are moved by the ripple."""
        heights = self.compute_heights(self.frame.measure(line)[0])
        return self.frame.across[:, None] * heights

    def check(self, cells: int, grids: dict[str, np.ndarray]) -> None:
        """Raise BadInput for waves of too few of the side's `cells`, or grids that they fold."""
        if not self:
            return
        number = cells * self.wavelength / self.frame.length
        if number < LEAST_CELLS:
            raise BadInput(
                f"deck: ripple_wavelength is {self.wavelength:g} m, {number:.3g} cells of the "
                f"cone's side; give at least {LEAST_CELLS * self.frame.length / cells:.3g} m "
                "or more `cells`"
            )
        if any(len(find_bad_cells(nodes)) for nodes in grids.values()):
            raise BadInput(
                f"deck: ripple_amplitude is {self.amplitude:g} m on waves of {self.wavelength:g} "
                "m; cells beside the cone's side would not be convex, give a smaller one"
            )

    @property
    def cells_a_wave(self) -> float:
        """Cells of the cone's side on a wave, as the deck asks for them."""
        deck = self.deck
        return deck.cells * deck.cone / deck.radius * self.wavelength / self.frame.length

    # --- theory --------------------------------------------------------------------------------

    @cached_property
    def first_shock(self) -> tuple[float, float]:
        """When the plane shock reaches the cone's base [s], and its speed in it [m/s]."""
        deck, made = self.deck, self.materials
        impactor, shell, filling = (made[name] for name in ("impactor", "shell", "filling"))
        impact = solve_riemann(
            impactor.eos, (impactor.rho0, deck.speed, 0.0), shell.eos, (shell.rho0, 0.0, 0.0)
        )
        in_shell = shock_with_particle_speed(shell.eos, shell.rho0, 0.0, impact.u)
        base = solve_riemann(
            shell.eos, (in_shell.rho, impact.u, in_shell.p), filling.eos, (filling.rho0, 0.0, 0.0)
        )
        in_cone = shock_with_particle_speed(filling.eos, filling.rho0, 0.0, base.u)
        return deck.front / in_shell.shock_speed, in_cone.shock_speed

    def cross(self, speed: float | None = None) -> CrossedLine | None:
        """Theory of the shock that passes the side at `speed` (None: of the plane shock).

        None where there is none: the shock does not lead in the cone.
        """
        filling, target = self.materials["filling"], self.materials["target"]
        speed = self.first_shock[1] / self.frame.along[0] if speed is None else speed
        try:
            return cross_line(Body(filling.eos, filling.rho0), Body(target.eos, target.rho0), speed)
        except BadInput:
            return None

    # --- measurement ---------------------------------------------------------------------------

    @cached_property
    def waves(self) -> np.ndarray:
        """Places (m,) along the side, a wavelength apart, where amplitudes are measured [m]."""
        count = int(self.frame.length / self.wavelength - 1.0 + 1e-9)
        spare = self.frame.length - (count - 1) * self.wavelength
        return 0.5 * spare + np.arange(count) * self.wavelength

    @cached_property
    def _passage(self) -> tuple[np.ndarray, float, float]:
        """When the plane shock is at the waves (m,), how fast they drift then, its speed there."""
        begin, speed = self.first_shock
        point = speed / self.frame.along[0]
        crossed = self.cross()
        return begin + self.waves / point, crossed.drift if crossed else 0.0, point

    def measure(self, line: np.ndarray, t: float) -> dict[str, float]:
        """Amplitude [m] of every wave of the side's line (2, n) at the time t [s]."""
        passed, drift, point = self._passage
        row = {}
        dense = densify(line)
        position, height = self.frame.measure(dense)
        for number, (middle, hit) in enumerate(zip(self.waves, passed, strict=True)):
            since = max(0.0, t - hit)
            length = self.wavelength * (1.0 - drift / point if since > 0.0 else 1.0)
            row[f"ripple_{number}"] = fit_wave(position, height, middle + drift * since, length)
        return row


def densify(line: np.ndarray) -> np.ndarray:
    """POINTS times as many points (2, m) on the cubic spline through the line's nodes (2, n)."""
    arc = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(line, axis=1)))))
    fine = np.interp(
        np.arange(POINTS * (arc.size - 1) + 1) / POINTS, np.arange(arc.size, dtype=float), arc
    )
    from scipy.interpolate import CubicSpline  # slow to load

    return CubicSpline(arc, line, axis=1)(fine)


def fit_wave(position: np.ndarray, height: np.ndarray, middle: float, length: float) -> float:
    """Amplitude of a wave of that length in a line (n,) around `middle`, beside a parabola.

    Least squares within a wavelength to either side, weighted by the line's steps and by
    cos²(pi (place - middle)/(2 length)); NaN where the line does not fill the window.
    """
    part = (position - middle) / length
    chosen = np.abs(part) <= 1.0
    if chosen.sum() < 5 * LEAST_CELLS or np.ptp(part[chosen]) < 2.0 * COVERED:
        return math.nan
    step = np.hypot(np.gradient(position), np.gradient(height))[chosen]
    part = part[chosen]
    weight = np.sqrt(step / step.sum()) * np.cos(0.5 * math.pi * part)
    angle = 2.0 * math.pi * part
    columns = np.array([np.ones(part.size), part, part**2, np.cos(angle), np.sin(angle)])
    found = np.linalg.lstsq((columns * weight).T, height[chosen] * weight, rcond=None)[0]
    return float(math.hypot(found[3], found[4]))
