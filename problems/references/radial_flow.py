"""Plane, cylindrical or spherical flow of an ideal gas in one dimension, by brute force.

A plain second-order scheme on a fixed fine grid (minmod slopes, HLL fluxes, Runge-Kutta steps of
[ShuOsher1988]), that shares no formula with the flow solver: a reference where there is no
exact solution.  With the exponent n of the radius, r^n rho, r^n rho u and r^n rho E are conserved
but for the pressure on the sides of the shells, n r^(n-1) p.
"""

from __future__ import annotations

import numpy as np


def compute_radial_flow(
    gamma: float, exponent: int, edges: np.ndarray, start: np.ndarray, t_end: float
) -> np.ndarray:
    """Density, velocity and pressure (3, n) of shells at `t_end` from those at t = 0.

    edges (n + 1,): radii of the shells, the first and the last one are walls (or the centre);
    start (3, n): averages; exponent 0 plane, 1 cylindrical, 2 spherical.
    """
    area = edges**exponent
    volume = np.diff(edges ** (exponent + 1)) / (exponent + 1)
    step = np.diff(edges)

    def find_primitive(conserved):
        rho = conserved[0]
        u = conserved[1] / rho
        return np.array([rho, u, (gamma - 1.0) * (conserved[2] - 0.5 * rho * u * u)])

    def find_conserved(state):
        rho, u, p = state
        return np.array([rho, rho * u, p / (gamma - 1.0) + 0.5 * rho * u * u])

    def find_change(conserved):
        state = find_primitive(conserved)
        wide = np.empty((3, state.shape[1] + 2))
        wide[:, 1:-1] = state
        wide[:, 0], wide[:, -1] = state[:, 0], state[:, -1]
        wide[1, [0, -1]] *= -1.0
        rise = np.diff(wide)
        slope = np.where(
            rise[:, 1:] * rise[:, :-1] > 0.0,
            np.sign(rise[:, 1:]) * np.minimum(abs(rise[:, 1:]), abs(rise[:, :-1])),
            0.0,
        )
        low, high = state - 0.5 * slope, state + 0.5 * slope
        mirror = np.array([[1.0], [-1.0], [1.0]])
        left = np.concatenate((mirror * low[:, :1], high), axis=1)
        right = np.concatenate((low, mirror * high[:, -1:]), axis=1)
        fluxes, values, speeds = [], [], []
        for q in (left, right):
            rho, u, p = q
            u_conserved = find_conserved(q)
            fluxes.append(np.array([rho * u, rho * u * u + p, u * (u_conserved[2] + p)]))
            values.append(u_conserved)
            c = np.sqrt(gamma * p / rho)
            speeds.append((u - c, u + c))
        slow = np.minimum(np.minimum(speeds[0][0], speeds[1][0]), 0.0)
        fast = np.maximum(np.maximum(speeds[0][1], speeds[1][1]), 0.0)
        flux = fast * fluxes[0] - slow * fluxes[1] + slow * fast * (values[1] - values[0])
        flux /= fast - slow
        change = -np.diff(area * flux) / volume
        change[1] += state[2] * np.diff(area) / volume
        return change

    conserved, t = find_conserved(np.asarray(start, float)), 0.0
    while t < t_end:
        rho, u, p = find_primitive(conserved)
        dt = min(0.4 * float((step / (abs(u) + np.sqrt(gamma * p / rho))).min()), t_end - t)
        first = conserved + dt * find_change(conserved)
        conserved = 0.5 * (conserved + first + dt * find_change(first))
        t += dt
    return find_primitive(conserved)
