"""Programmed burn: a detonation front of given speed that brings the explosive its heat.

The front starts from a point or a plane at t = 0 and goes on at the speed D; over a width of a few
cells behind it the part burnt rises from 0 to 1, and with it the energy from the explosive at rest
to the products (`hydro.eos.jwl`).  The heat follows the material: in dt a cell gets what its
material gains on its way x to x + u dt.  Moved at D = the Chapman–Jouguet speed the wave passes the
states between rest and CJ [Wilkins 1964, the method; the form is ours].  The trap: a front thinner
than three cells brings too little or too much heat.
"""

from __future__ import annotations

import math

import numpy as np

from hydro.eos import JWL
from regrid.errors import BadInput


class ProgrammedBurn:
    """A source law (`hydro.sources`) that burns all blocks of JWL material.

    origin (2,): a point of the front at t = 0 [m]; direction (2,): where a plane front goes, None
    for one that spreads from the point; width: of the front [m]; speed [m/s]: None for the CJ
    speed of each block's material.  Raises BadInput for numbers that are not positive.
    """

    def __init__(self, origin, direction, width: float, speed: float | None = None):
        if not width > 0.0 or not (speed is None or speed > 0.0):
            raise BadInput(
                f"burn: width is {width:g} and speed {speed or 0:g}; both must be positive"
            )
        self.origin, self.width, self.speed = np.asarray(origin, float), width, speed
        self.direction = None
        if direction is not None:
            length = math.hypot(*direction)
            if length == 0.0:
                raise BadInput("burn: the direction of a plane front must not be (0, 0)")
            self.direction = np.asarray(direction, float) / length
        self._known: dict[JWL, tuple[float, float]] = {}

    def _find(self, eos: JWL) -> tuple[float, float]:
        """Speed of the front and heat of a material."""
        if eos not in self._known:
            self._known[eos] = (self.speed or eos.find_detonation()[0], eos.heat)
        return self._known[eos]

    def compute_burnt(self, speed: float, x, y, t: float) -> np.ndarray:
        """Part burnt, 0 to 1, at the points x, y [m] at time t [s]."""
        x, y = x - self.origin[0], y - self.origin[1]
        if self.direction is None:
            way = np.hypot(x, y)
        else:
            way = x * self.direction[0] + y * self.direction[1]
        return np.clip((speed * t - way) / self.width, 0.0, 1.0)

    def __call__(self, block, x, y, t, dt):
        if not isinstance(block.eos, JWL):
            return 0.0, 0.0, 0.0
        speed, heat = self._find(block.eos)
        _, u, v, _ = block.state[:, 1:-1, 1:-1]
        before = self.compute_burnt(speed, x, y, t)
        after = self.compute_burnt(speed, x + dt * u, y + dt * v, t + dt)
        return 0.0, 0.0, heat * (after - before)
