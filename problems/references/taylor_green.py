"""The steady cell of turning gas that a source of heat keeps up, in the unit square between walls.

u = sin(pi x) cos(pi y), v = -cos(pi x) sin(pi y), rho = 1, p = 1 + (cos 2 pi x + cos 2 pi y)/4 with
rho de/dt = pi/(4 (g - 1)) (cos 3 pi x cos pi y - cos pi x cos 3 pi y).
"""

from __future__ import annotations

import math

import numpy as np

GAMMA = 5.0 / 3.0


def compute_flow(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """u, v [m/s] and p [Pa] of the steady flow."""
    a, b = math.pi * x, math.pi * y
    p = 1.0 + 0.25 * (np.cos(2.0 * a) + np.cos(2.0 * b))
    return np.sin(a) * np.cos(b), -np.cos(a) * np.sin(b), p


def compute_velocity(nodes: np.ndarray) -> np.ndarray:
    """Velocity [m/s] of the flow at nodes (2, ni + 1, nj + 1) of a grid between the walls."""
    velocity = np.array(compute_flow(*nodes)[:2])
    velocity[0, [0, -1]], velocity[1, :, [0, -1]] = 0.0, 0.0  # sin(pi) is not zero
    return velocity


def follow_flow(nodes: np.ndarray, t: float, steps: int) -> np.ndarray:
    """Nodes that have followed the flow for t [s], by so many steps of Runge and Kutta."""
    step = t / steps
    for _ in range(steps):
        first = compute_velocity(nodes)
        second = compute_velocity(nodes + 0.5 * step * first)
        third = compute_velocity(nodes + 0.5 * step * second)
        fourth = compute_velocity(nodes + step * third)
        nodes = nodes + step / 6.0 * ((first + fourth) + 2.0 * (second + third))
    return nodes


def heat(block, x, y, t, dt):
    """The source (`hydro.sources`): heat per mass that keeps the flow steady."""
    pi = math.pi
    wave = np.cos(3 * pi * x) * np.cos(pi * y) - np.cos(pi * x) * np.cos(3 * pi * y)
    return 0.0, 0.0, dt * pi / (4.0 * (GAMMA - 1.0)) * wave
