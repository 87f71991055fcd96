"""Riemann problems of random ideal gases: errors of the star states, pair by pair.

Pressures are drawn from 1e-3 to 1e3, densities from .01 to 100, both evenly in their logarithms,
gammas from 1.1 to 3.  The right gas moves: with an odd seed up to three sound speeds of the slower
gas, else up to the sum of both, either way.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from shockgrid.problems.riemann import Riemann, RiemannDeck, SideState
from shockgrid.regrid.errors import BadInput, RunFailure

ROWS = 2  # of cells: nothing varies across


def make_random_pair(seed: int) -> tuple[SideState, SideState]:
    """States left and right."""
    random = np.random.default_rng(seed)
    sides = []
    sounds = []
    for _ in range(2):
        rho = 10.0 ** random.uniform(-2.0, 2.0)
        p = 10.0 ** random.uniform(-3.0, 3.0)
        gamma = random.uniform(1.1, 3.0)
        sides.append({"rho": float(rho), "p": float(p), "gamma": float(gamma)})
        sounds.append(float(np.sqrt(gamma * p / rho)))
    most = 3.0 * min(sounds) if seed % 2 else sum(sounds)
    sides[1]["u"] = float(most * random.uniform(-1.0, 1.0))
    return SideState(**sides[0]), SideState(**sides[1])


def find_worst_star(problem: Riemann, row) -> float:
    """Largest relative error of the star states in a row of `measure`; NaN: one is unknown."""
    stars = problem.star_states().items()
    return float(np.max([abs(row[f"star_{n}"] - exact) / size for n, (exact, size) in stars]))


def measure_random_pairs(seeds: Iterable[int], cells: int = 200) -> dict[int, float | str]:
    """Largest relative error of the star states of each pair, with the defaults of `riemann`.

    NaN where a plateau has no cell; the sentence where a pair is refused or its run fails.
    """
    found: dict[int, float | str] = {}
    for seed in seeds:
        left, right = make_random_pair(seed)
        try:
            problem = Riemann(RiemannDeck(left=left, right=right, cells=cells, rows=ROWS))
            simulation = problem.build()
            while simulation.finished is None:
                simulation.advance()
        except (BadInput, RunFailure) as reason:
            found[seed] = str(reason)
        else:
            found[seed] = find_worst_star(problem, problem.measure(simulation))
    return found
