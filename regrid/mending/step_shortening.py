"""Node-wise shortening of a step until no corner area falls below its floor (theory R3.5)."""

from __future__ import annotations

import numpy as np

from regrid.jit import kernel
from regrid.measure.corners import compute_doubled_area, find_triangle

FRACTION, FAILS = range(2)  # rows of the scratch: part of the step kept, round of the last failure
HALVINGS = 8  # after this many, a node that still offends stays where it was


@kernel
def shorten_steps(base, trial, old, least_ratio, tau):
    """Pull `trial` back towards `base` at the nodes of every corner triangle that fails.

    A corner fails when its area is not above `least_ratio` of its area in `old`; `base` must
    pass.  `tau` (2, ni+1, nj+1) is scratch.  Returns the number of rounds.
    """
    ni, nj = base.shape[1] - 1, base.shape[2] - 1
    for i in range(ni + 1):
        for j in range(nj + 1):
            tau[FRACTION, i, j] = 1.0
            tau[FAILS, i, j] = 0.0
    change = trial - base
    smallest = 0.5**HALVINGS
    marked = np.zeros(ni + 1, dtype=np.int64)  # the last round, from 1, that marked nodes of a row
    for round in range(100 * HALVINGS):
        failed = False
        for i in range(ni):
            if round > 0 and marked[i] < round and marked[i + 1] < round:
                continue
            for j in range(nj):
                # what the round before has not touched passes still
                touched = max(
                    max(tau[FAILS, i, j], tau[FAILS, i, j + 1]),
                    max(tau[FAILS, i + 1, j], tau[FAILS, i + 1, j + 1]),
                )
                if touched < round:
                    continue
                for corner in range(4):
                    p, q, far_i, far_j = find_triangle(i, j, corner)
                    if (p == 0 or p == ni) and (q == 0 or q == nj):
                        continue
                    new = compute_doubled_area(trial, i, j, corner)
                    was = compute_doubled_area(old, i, j, corner)
                    if not (new > least_ratio * was and new > 0.0):
                        failed = True
                        mark = round + 1.0
                        tau[FAILS, p, q] = tau[FAILS, far_i, q] = tau[FAILS, p, far_j] = mark
                        marked[i] = marked[i + 1] = round + 1
        if not failed:
            return round
        for i in range(1, ni):
            if marked[i] <= round:
                continue
            for j in range(1, nj):
                if tau[FAILS, i, j] > round:
                    tau[FRACTION, i, j] = (
                        0.5 * tau[FRACTION, i, j] if tau[FRACTION, i, j] > smallest else 0.0
                    )
                    for k in range(2):
                        trial[k, i, j] = base[k, i, j] + tau[FRACTION, i, j] * change[k, i, j]
    return -1
