"""A slow judge of boundaries on which no grid was found: linear programs, from several starts.

    python benchmarks/slow_untangler.py KEPT.npz [--minutes 5] [--most-nodes 400]

`KEPT.npz` is what `benchmarks/random_motions.py --keep` writes.  Nothing of it is shared with the
regridders: the least corner area is made as large as it can be, by linear programs on linearised
areas within a trust region (sequential linear programming, HiGHS), begun from a plain Coons patch,
from the solution of Laplace's equation, and from random grids.  It finds a grid or it does not: no
proof of the second.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import coo_matrix, csr_matrix, hstack
from scipy.sparse.linalg import spsolve

STEPS = 60
LEAST_TRUST = 1e-6


class Areas:
    """Corner areas of a grid (2, ni+1, nj+1), but for the block's own, and their derivatives."""

    def __init__(self, ni: int, nj: int):
        self.shape = ni + 1, nj + 1
        number = np.arange((ni + 1) * (nj + 1)).reshape(self.shape)
        low, high = slice(None, -1), slice(1, None)
        rows = []
        for p, q in ((low, low), (high, low), (high, high), (low, high)):
            far_p = high if p is low else low
            far_q = high if q is low else low
            own = number[p, q]
            along = number[far_p, q]
            across = number[p, far_q]
            turn = (p is low) == (q is low)
            second, third = (along, across) if turn else (across, along)
            rows.append(np.array([own.ravel(), second.ravel(), third.ravel()]))
        triangles = np.concatenate(rows, axis=1)
        inner = np.zeros(self.shape, dtype=bool)
        inner[1:-1, 1:-1] = True
        self.triangles = triangles[:, inner.ravel()[triangles].any(axis=0)]
        self.fixed = triangles[:, ~inner.ravel()[triangles].any(axis=0)]
        corners = number[[0, 0, -1, -1], [0, -1, 0, -1]]
        self.fixed = self.fixed[:, ~np.isin(self.fixed[0], corners)]
        self.inner = np.flatnonzero(inner.ravel())
        self.column = np.full(number.size, -1)
        self.column[self.inner] = np.arange(self.inner.size)

    def compute(self, points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
        a, b, c = (points[:, triangles[k]] for k in range(3))
        return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])

    def derive(self, points: np.ndarray) -> csr_matrix:
        """Rows: triangles; columns: x of the inner nodes, then y."""
        count = self.inner.size
        parts = []
        for k in range(3):
            own = self.column[self.triangles[k]]
            b, c = (points[:, self.triangles[(k + m) % 3]] for m in (1, 2))
            row = np.flatnonzero(own >= 0)
            parts.append((row, own[row], (b[1] - c[1])[row]))
            parts.append((row, own[row] + count, (c[0] - b[0])[row]))
        row, column, value = (np.concatenate(part) for part in zip(*parts, strict=True))
        return coo_matrix((value, (row, column)), (self.triangles.shape[1], 2 * count)).tocsr()


def make_starts(boundary: np.ndarray, rng: np.random.Generator, count: int):
    """Insides to begin from: Coons, Laplace, then `count` random ones."""
    ni, nj = boundary.shape[1] - 1, boundary.shape[2] - 1
    u, v = np.arange(ni + 1)[:, None] / ni, np.arange(nj + 1)[None] / nj
    b = boundary
    coons = (1 - u) * b[:, :1] + u * b[:, -1:] + (1 - v) * b[:, :, :1] + v * b[:, :, -1:]
    corners = (b[:, :1, :1], b[:, -1:, :1], b[:, :1, -1:], b[:, -1:, -1:])
    weights = (1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v
    coons = coons - sum(w * c for w, c in zip(weights, corners, strict=True))
    coons[:, [0, -1]] = b[:, [0, -1]]
    coons[:, :, [0, -1]] = b[:, :, [0, -1]]
    yield coons
    number = np.full((ni + 1, nj + 1), -1)
    number[1:-1, 1:-1] = np.arange((ni - 1) * (nj - 1)).reshape(ni - 1, nj - 1)
    for start in range(count + 1):
        rows = []
        columns = []
        values = []
        right = np.zeros((2, (ni - 1) * (nj - 1)))
        for i in range(1, ni):
            for j in range(1, nj):
                k = number[i, j]
                total = 0.0
                for p, q in ((i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)):
                    weight = 1.0 if start == 0 else float(np.exp(rng.normal()))
                    total += weight
                    if number[p, q] < 0:
                        right[:, k] += weight * b[:, p, q]
                    else:
                        rows.append(k), columns.append(number[p, q]), values.append(-weight)
                rows.append(k), columns.append(k), values.append(total)
        matrix = csr_matrix((values, (rows, columns)))
        grid = coons.copy()
        for c in range(2):
            grid[c, 1:-1, 1:-1] = spsolve(matrix, right[c]).reshape(ni - 1, nj - 1)
        yield grid


def find_grid(boundary: np.ndarray, seed: int = 0, count: int = 3, limit: float = np.inf):
    """A grid on `boundary` (2, ni+1, nj+1; positive area) with all areas positive, or None."""
    ni, nj = boundary.shape[1] - 1, boundary.shape[2] - 1
    areas = Areas(ni, nj)
    begin = time.perf_counter()
    number = areas.inner.size
    plain = np.where(np.isnan(boundary), 0.0, boundary)
    if areas.fixed.size and (areas.compute(plain.reshape(2, -1), areas.fixed) <= 0.0).any():
        return None
    edges = np.hypot(*np.diff(boundary[:, :, 0], axis=1))
    for grid in make_starts(plain, np.random.default_rng(seed), count):
        points = grid.reshape(2, -1).copy()
        trust = float(edges.mean()) * 2.0
        least_trust = LEAST_TRUST * trust
        for _ in range(STEPS):
            here = areas.compute(points, areas.triangles)
            if here.min() > 0.0:
                return points.reshape(grid.shape)
            if time.perf_counter() - begin > limit:
                return None
            slopes = areas.derive(points)
            matrix = hstack([-slopes, np.ones((here.size, 1))]).tocsr()
            cost = np.zeros(2 * number + 1)
            cost[-1] = -1.0
            bounds = [(-trust, trust)] * (2 * number) + [(None, None)]
            answer = linprog(cost, A_ub=matrix, b_ub=here, bounds=bounds, method="highs")
            if answer.x is None:
                trust *= 0.3
                continue
            move = answer.x[:-1].reshape(2, number)
            while trust > least_trust:
                trial = points.copy()
                trial[:, areas.inner] += move
                now = areas.compute(trial, areas.triangles).min()
                if now > here.min():
                    points = trial
                    trust *= 1.5 if np.abs(move).max() > 0.9 * trust else 1.0
                    break
                trust = 0.3 * trust
                move = 0.3 * move
            if trust <= least_trust or answer.x[-1] - here.min() < 1e-9 * abs(here.min()):
                break
    return None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("kept", type=Path)
    parser.add_argument("--minutes", type=float, default=5.0)
    parser.add_argument("--most-nodes", type=int, default=400)
    parser.add_argument("--outcome", default="named, none found")
    options = parser.parse_args()
    kept = np.load(options.kept)
    begin = time.perf_counter()
    tried = 0
    found = []
    for n, outcome in enumerate(kept["outcome"]):
        boundary = kept[f"boundary_{n}"]
        if outcome != options.outcome or boundary[0].size > options.most_nodes:
            continue
        if min(boundary.shape[1:]) < 3:
            continue
        if time.perf_counter() - begin > 60.0 * options.minutes:
            break
        corners = boundary[:, [0, -1, -1, 0], [0, 0, -1, -1]]
        previous = kept[f"nodes_{n}"]
        low, high = previous[:, -1, -1] - previous[:, 0, 0], previous[:, 0, -1] - previous[:, -1, 0]
        positive = low[0] * high[1] - low[1] * high[0] > 0.0
        grid = find_grid(boundary if positive else boundary[::-1], limit=60.0)
        tried += 1
        if grid is not None:
            found.append(n)
            print(f"motion {n}: a grid is found, cells {boundary[0].shape}, {corners.shape}")
    print(f"{len(found)} of {tried} solved: {found}")


if __name__ == "__main__":
    main()
