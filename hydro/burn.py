"""Programmed burn, a body source: a detonation front of given speed that releases the heat.

The front starts from a point or a plane at t = 0, propagates at the speed D and releases the heat
of the explosive.  The burn fraction is the greater of two [Wilkins1964]: the timed one, which rises
over the front's width, and that of the compression, (1 - V/V0)/(1 - Vcj/V0).  The timed fraction is
1 - (1 - s)², where s is the fraction of the width: with D the Chapman–Jouguet speed, the states
between rest and CJ then lie on a straight line.  Half of the width is ahead of D t; if all of it
were behind, the following wave would lag by half the width, a first-order error.  The burn fraction
is not advected: in a front that runs into material at rest, steady or a shock,

    e - e0 = (p/2) (1/rho0 - 1/rho) + burn fraction × heat,

so it follows from the cell's state, to which the missing heat is added.  Heat by the clock alone,
independent of the state, has a small error in every front of a few cells; where it is too much, a
shock runs ahead and compresses unburnt explosive to a spike that grows as the cells shrink.  (Only
the two fractions are from the source.)

With `clock_stop` the clock stops at that time, and the front propagates by itself at a speed that
measures D for the given energy.  While the explosive is compressed, the burn fraction is then 1 -
(1 - r)² with r that of the compression; once it expands, the rest burns as fast as in the timed
front, until the state is on the isentrope of the CJ state.  Without that rest, explosive reached by
a rarefaction within the front never burns, and the peak is a third too low; burning the rest
earlier gives a weak detonation, some per cent too fast.  In a diverging front the relation above
holds up to terms of width over radius.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shockgrid.hydro.eos import JWL
from shockgrid.regrid.errors import BadInput

FRONT_LEAD_FRACTION = 0.5  # fraction of the front's width that is ahead of the front
STARTED_BURN_FRACTION = 0.5  # burn fraction from which a self-propagating front burns the rest


@dataclass(frozen=True)
class Explosive:
    """Burn parameters of a material: front speed [m/s], heat and energy at rest [J/kg], and the
    compression 1 - Vcj/V0."""

    speed: float
    heat: float
    energy: float
    compression: float


def find_expanding(block) -> np.ndarray:
    """Mask (ni, nj) of the cells of a block in which the plane velocity diverges.

    Beyond the sides the velocity of the adjacent cells is used: ghosts belong to the step.
    """
    _, *velocity, _ = block.state[:, 1:-1, 1:-1]
    u, v = (np.pad(q, 1, mode="edge") for q in velocity)
    x, y = block.nodes
    through_i = (u[:-1, 1:-1] + u[1:, 1:-1]) * np.diff(y, axis=1)
    through_i -= (v[:-1, 1:-1] + v[1:, 1:-1]) * np.diff(x, axis=1)
    through_j = (v[1:-1, :-1] + v[1:-1, 1:]) * np.diff(x, axis=0)
    through_j -= (u[1:-1, :-1] + u[1:-1, 1:]) * np.diff(y, axis=0)
    return np.diff(through_i, axis=0) + np.diff(through_j, axis=1) > 0.0


def compute_products_energy(eos: JWL, rho) -> np.ndarray:
    """Specific internal energy [J/kg] at the densities `rho` on the isentrope of the CJ state."""
    _, pressure, density = eos.find_detonation()
    power = 1.0 + eos.omega

    def solid(volume):
        return eos.a * np.exp(-eos.r1 * volume) + eos.b * np.exp(-eos.r2 * volume)

    volume = eos.rho0 / rho
    start = eos.rho0 / density
    gas = (pressure - solid(start)) * start**power
    return eos.energy(rho, solid(volume) + gas * volume**-power)


class ProgrammedBurn:
    """The source of a `Simulation` (see `hydro.sources`) that burns all blocks of JWL material.

    origin (2,): a point of the front at t = 0 [m]; direction (2,) of a plane front, None for one
    that spreads from the point; width: of the front [m]; speed [m/s]: None for the CJ speed of each
    block's material; clock_stop [s]: time from which the front propagates by itself.  Raises
    BadInput for numbers that are not positive.
    """

    def __init__(
        self,
        origin,
        direction,
        width: float,
        speed: float | None = None,
        clock_stop: float = math.inf,
    ):
        if not width > 0.0 or not (speed is None or speed > 0.0):
            raise BadInput(
                f"burn: width is {width:g} and speed {speed or 0:g}; both must be positive"
            )
        if not clock_stop > 0.0:
            raise BadInput(f"burn: clock_stop is {clock_stop:g} s; it must be positive")
        self.origin = np.asarray(origin, float)
        self.width = width
        self.speed = speed
        self.clock_stop = clock_stop
        self.direction = None
        if direction is not None:
            length = math.hypot(*direction)
            if length == 0.0:
                raise BadInput("burn: the direction of a plane front must not be (0, 0)")
            self.direction = np.asarray(direction, float) / length
        self._known: dict[JWL, Explosive] = {}

    def find_explosive(self, eos: JWL) -> Explosive:
        if eos not in self._known:
            speed, _, rho = eos.find_detonation()
            energy_at_rest = float(eos.energy(eos.rho0, 0.0))
            self._known[eos] = Explosive(
                self.speed or speed, eos.heat, energy_at_rest, 1.0 - eos.rho0 / rho
            )
        return self._known[eos]

    def compute_timed(self, speed: float, x, y, t: float) -> np.ndarray:
        """Timed burn fraction, 0 to 1, at the points x, y [m] at time t [s]."""
        x, y = x - self.origin[0], y - self.origin[1]
        if self.direction is None:
            distance = np.hypot(x, y)
        else:
            distance = x * self.direction[0] + y * self.direction[1]
        edge = speed * t + FRONT_LEAD_FRACTION * self.width
        return 1.0 - (1.0 - np.clip((edge - distance) / self.width, 0.0, 1.0)) ** 2

    def __call__(self, block, x, y, t, dt):
        eos = block.eos
        if not isinstance(eos, JWL):
            return 0.0, 0.0, 0.0
        explosive = self.find_explosive(eos)
        rho, u, v, p = block.state[:, 1:-1, 1:-1]
        stop = self.clock_stop
        before = self.compute_timed(explosive.speed, x, y, min(t, stop))
        after = self.compute_timed(explosive.speed, x + dt * u, y + dt * v, min(t + dt, stop))
        squeezed = 1.0 - eos.rho0 / rho
        pressed = np.clip(squeezed / explosive.compression, 0.0, 1.0)
        if t > stop:
            pressed = 1.0 - (1.0 - pressed) ** 2
        work = 0.5 * p * squeezed / eos.rho0
        burnt = (eos.energy(rho, p) - explosive.energy - work) / explosive.heat
        lacking = np.maximum(np.maximum(after, pressed) - burnt, 0.0)
        # heat at constant volume raises p and with it the work in `burnt`
        lacking = lacking / (1.0 - 0.5 * eos.omega * rho * squeezed / eos.rho0)
        if t > stop:
            ending = (burnt > STARTED_BURN_FRACTION) & find_expanding(block)
            lacking = np.maximum(
                lacking, np.where(ending, self.find_rest(block, explosive, dt), 0.0)
            )
        return 0.0, 0.0, explosive.heat * np.where(before < 1.0, lacking, 0.0)

    def find_rest(self, block, explosive: Explosive, dt: float) -> np.ndarray:
        """Fraction (ni, nj) of the heat released within dt in cells of a self-propagating front.

        The energy missing to the products' isentrope falls as in the timed fraction, as (1 - s)²
        with s rising by D dt over the width.
        """
        eos = block.eos
        rho, _, _, p = block.state[:, 1:-1, 1:-1]
        energy = compute_products_energy(eos, rho) - (eos.heat - explosive.heat)
        missing = np.maximum(energy - eos.energy(rho, p), 0.0) / explosive.heat
        left = np.maximum(np.sqrt(missing) - explosive.speed * dt / self.width, 0.0) ** 2
        return missing - left
