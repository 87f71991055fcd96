"""Perturbations of layers in a row, marched in log t: the arithmetic of `linear_growth`.

A row of zones goes outwards from the interface on either side of it.  In each, with the derivative
D across it and coefficients at its points, at time t (k = 1):

    t p' = carry Dp - stretch (expand Du + t v) + bulk u + pile p
    t u' = carry Du - push Dp + lift p + drag u
    t v' = carry Dv + t light p + source

Where a row goes on from zone to zone the characteristics of both meet; at its end `edge` closes it,

    t p' = first (t p' + z t u'),    t u' = second t p',    t v' = third t p

and at the interface the characteristics of the two innermost zones do.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from regrid.jit import compiled_once, kernel

P, U, V = range(3)
CARRY, STRETCH, EXPAND, BULK, PILE, PUSH, LIFT, DRAG, LIGHT, SOURCE = range(10)
COEFFICIENTS = 10


@dataclass(frozen=True)
class Zone:
    """A layer or a fan: derivative matrix (n, n), rows COEFFICIENTS (10, n), impedance z at its
    outer end, what closes that end (None: the next zone does), first state (3, n)."""

    matrix: np.ndarray
    coefficients: np.ndarray
    z: float
    edge: tuple[float, float, float] | None
    start: np.ndarray


@compiled_once
def fill_rates(t, state, slopes, coefficients, sizes, edges, impedances, inner, slope, rates):
    """t d/dt of p, u, v (3, points) at fixed x/t; `inner` zones lie on the first side.

    slope (3, n): scratch.
    """
    first = 0
    for zone in range(sizes.size):
        size = sizes[zone]
        for q in range(3):
            for j in range(size):
                slope[q, j] = 0.0
            for i in range(size):
                value = state[q, first + i]
                for j in range(size):
                    slope[q, j] += value * slopes[zone, i, j]
        c = coefficients[zone]
        for j in range(size):
            k = first + j
            p, u, v = state[P, k], state[U, k], state[V, k]
            rates[P, k] = (
                c[CARRY, j] * slope[P, j]
                - c[STRETCH, j] * (slope[U, j] * c[EXPAND, j] + t * v)
                + (c[BULK, j] * u + c[PILE, j] * p)
            )
            rates[U, k] = (
                c[CARRY, j] * slope[U, j]
                - slope[P, j] * c[PUSH, j]
                + (c[LIFT, j] * p + c[DRAG, j] * u)
            )
            rates[V, k] = c[CARRY, j] * slope[V, j] + (t * c[LIGHT, j] * p + c[SOURCE, j])
        first += size
    first = 0
    for zone in range(sizes.size):
        last = first + sizes[zone] - 1
        z = impedances[zone]
        outgoing = rates[P, last] + z * rates[U, last]
        if zone + 1 < sizes.size and zone + 1 != inner:
            incoming = rates[P, last + 1] - z * rates[U, last + 1]
            rates[P, last] = 0.5 * (outgoing + incoming)
            rates[U, last] = 0.5 * (outgoing - incoming) / z
            rates[V, last] = rates[V, last + 1]
        else:
            rates[P, last] = edges[zone, 0] * outgoing
            rates[U, last] = edges[zone, 1] * rates[P, last]
            rates[V, last] = t * edges[zone, 2] * state[P, last]
        first = last + 1
    cut = 0
    for zone in range(inner):
        cut += sizes[zone]
    z, other = impedances[0], impedances[inner]
    from_first = rates[P, 0] - z * rates[U, 0]
    from_second = rates[P, cut] - other * rates[U, cut]
    rates[P, 0] = (other * from_first + z * from_second) / (z + other)
    rates[P, cut] = rates[P, 0]
    rates[U, cut] = (from_first - from_second) / (z + other)
    rates[U, 0] = -rates[U, cut]


@kernel
def fill_velocities(
    times,
    step,
    middle,
    state,
    slopes,
    coefficients,
    sizes,
    edges,
    impedances,
    inner,
    work,
    velocities,
    ends,
):
    """March `state` (3, points) by the classical Runge-Kutta rule in log t, `step` a step.

    middle: exp(step / 2), from a time to the middle of the step;
    slopes (zones, n, n): transposed matrices; work
    (4, 3, points): scratch; velocities (n,): of the interface, at `times`; ends (2, 2, n): p
    and v at the outer ends of both sides.
    """
    zones = slopes, coefficients, sizes, edges, impedances, inner
    cut = 0
    for zone in range(inner):
        cut += sizes[zone]
    count = state.shape[1]
    slope, rates, total, trial = work[0], work[1], work[2], work[3]
    for n in range(times.size - 1):
        for stage in range(4):
            time = times[n] if stage == 0 else times[n] * middle if stage < 3 else times[n + 1]
            if stage == 0:
                fill_rates(time, state, *zones, slope, rates)
            else:
                fill_rates(time, trial, *zones, slope, rates)
            way = step if stage == 2 else 0.5 * step
            weight = 2.0 if stage == 1 or stage == 2 else 1.0
            for q in range(3):
                for k in range(count):
                    before = 0.0 if stage == 0 else total[q, k]
                    total[q, k] = before + weight * rates[q, k]
                    trial[q, k] = state[q, k] + way * rates[q, k]
        for q in range(3):
            for k in range(count):
                state[q, k] += step / 6.0 * total[q, k]
        velocities[n + 1] = state[U, cut]
        ends[0, 0, n + 1], ends[0, 1, n + 1] = state[P, cut - 1], state[V, cut - 1]
        ends[1, 0, n + 1], ends[1, 1, n + 1] = state[P, count - 1], state[V, count - 1]


@dataclass(frozen=True)
class March:
    """What a march found: `velocities` (n,) of the interface, p and v at the outer `ends` (2, 2, n)
    of both sides at its times, and the last `states` (3, points) of all zones, in their order."""

    velocities: np.ndarray
    ends: np.ndarray
    states: list[np.ndarray]


def march_layers(first: list[Zone], second: list[Zone], times, step: float) -> March:
    """March to the last of the `times` (n,), `step` apart in log t; p and u are 0 at the first.

    first, second: the rows of zones from the interface outwards, on either side.
    """
    zones = [*first, *second]
    sizes = np.array([zone.start.shape[1] for zone in zones])
    slopes = np.zeros((len(zones), sizes.max(), sizes.max()))
    coefficients = np.zeros((len(zones), COEFFICIENTS, sizes.max()))
    for number, (zone, size) in enumerate(zip(zones, sizes, strict=True)):
        slopes[number, :size, :size] = zone.matrix.T
        coefficients[number, :, :size] = zone.coefficients
    edges = np.array([zone.edge or (0.0, 0.0, 0.0) for zone in zones])
    impedances = np.array([zone.z for zone in zones])
    state = np.concatenate([zone.start for zone in zones], axis=1)
    velocities, ends = np.zeros(len(times)), np.zeros((2, 2, len(times)))
    ends[0, 1, 0], ends[1, 1, 0] = first[-1].start[V, -1], second[-1].start[V, -1]
    fill_velocities(
        times, step, math.exp(0.5 * step), state, slopes, coefficients, sizes, edges, impedances,
        len(first), np.empty((4, *state.shape)), velocities, ends,
    )  # fmt: skip
    return March(velocities, ends, np.split(state, np.cumsum(sizes)[:-1], axis=1))
