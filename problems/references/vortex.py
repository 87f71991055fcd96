"""Isentropic vortex carried by a uniform stream in a periodic square, [Yee1999], [Shu1998].

With d = (dx, dy) from the centre and r = |d|, in units where density and pressure far away are 1:

    (u, v) = stream + beta/(2 pi) exp((1 - r²)/2) (-dy, dx),
    T = 1 - (gamma - 1) beta²/(8 gamma pi²) exp(1 - r²),   rho = T^(1/(gamma - 1)),   p = rho T.

An exact solution of the Euler equations for all time.  The trap: the pictures of the periodic
square cut the vortex off at r = 5, where its speed is down to 2e-5 of the stream.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

GAUSS_POINTS = 4


@dataclass(frozen=True)
class Vortex:
    """The vortex: strength, ratio of specific heats, stream, period and its centre at t = 0."""

    beta: float = 5.0
    gamma: float = 1.4
    stream: tuple[float, float] = (1.0, 1.0)
    period: float = 10.0
    centre: tuple[float, float] = (5.0, 5.0)

    def sample(self, x, y, t: float = 0.0):
        """rho, u, v, p at the points `x`, `y` (one shape), each of that shape, at time t."""
        offsets = []
        for position, centre, speed in zip((x, y), self.centre, self.stream, strict=True):
            distance = np.asarray(position, dtype=float) - centre - speed * t
            offsets.append(distance - self.period * np.round(distance / self.period))
        dx, dy = offsets
        square = dx * dx + dy * dy
        turn = self.beta / (2.0 * math.pi) * np.exp(0.5 * (1.0 - square))
        warmth = (self.gamma - 1.0) * self.beta**2 / (8.0 * self.gamma * math.pi**2)
        temperature = 1.0 - warmth * np.exp(1.0 - square)
        rho = temperature ** (1.0 / (self.gamma - 1.0))
        u, v = self.stream[0] - turn * dy, self.stream[1] + turn * dx
        return rho, u, v, rho * temperature

    def compute_cell_averages(self, nodes: np.ndarray, t: float = 0.0):
        """rho, u, v, p of the cells of a grid, each (ni, nj), from averaged conserved quantities.

        nodes: (2, ni+1, nj+1).  Density, momentum and total energy are averaged over each
        quadrilateral (bilinear map, 4 x 4 Gauss points); u, v, p are those of the averages.
        """
        points, weights = np.polynomial.legendre.leggauss(GAUSS_POINTS)
        points, weights = 0.5 * (points + 1.0), 0.5 * weights
        south_west, south_east = nodes[:, :-1, :-1], nodes[:, 1:, :-1]
        north_west, north_east = nodes[:, :-1, 1:], nodes[:, 1:, 1:]
        volume = 0.0
        totals = [0.0, 0.0, 0.0, 0.0]
        for a, weight_a in zip(points, weights, strict=True):
            for b, weight_b in zip(points, weights, strict=True):
                south = (1.0 - a) * south_west + a * south_east
                north = (1.0 - a) * north_west + a * north_east
                x, y = (1.0 - b) * south + b * north
                along = (1.0 - b) * (south_east - south_west) + b * (north_east - north_west)
                across = north - south
                share = along[0] * across[1] - along[1] * across[0]
                share = weight_a * weight_b * share
                rho, u, v, p = self.sample(x, y, t)
                total = p / (self.gamma - 1.0) + 0.5 * rho * (u * u + v * v)
                volume = volume + share
                for k, value in enumerate((rho, rho * u, rho * v, total)):
                    totals[k] = totals[k] + share * value
        rho, momentum_x, momentum_y, total = (value / volume for value in totals)
        u, v = momentum_x / rho, momentum_y / rho
        p = (self.gamma - 1.0) * (total - 0.5 * rho * (u * u + v * v))
        return rho, u, v, p
