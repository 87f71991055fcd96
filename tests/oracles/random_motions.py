"""Random motions of the sides of valid grids: what the barrier regridder makes of each, counted.

    python tests/oracles/random_motions.py [--count 100000] [--seed 0] [--write] [--keep FILE]

Grids of 2 x 7 to 40 x 30 cells, either way up, are moved in four ways: smooth, noisy, bumped, a
single node.  Each answer is judged by exact arithmetic on what was returned, in code that the
regridder does not use: every cell convex but for corners of the block that the sides turn over,
sides untouched, the boundary simple.  `--write` makes docs/results/random-motions.txt, `--keep`
a file of the motions that have no grid on a simple boundary.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from shockgrid.regrid.barrier.regridder import BarrierRegridder
from shockgrid.regrid.errors import RegridFailure
from shockgrid.regrid.measure.corners import BLOCK_CORNERS, compute_corner_signs, compute_turns
from shockgrid.regrid.sides import SIDES

KINDS = ("smooth", "noisy", "bumped", "single node")
OUTCOMES = (
    "valid",
    "named, boundary crosses",
    "named, none exists",
    "named, none found",
    "wrong: cells not convex",
    "wrong: boundary crosses",
    "wrong: sides moved",
    "wrong: named a crossing that is none",
)
MOTIONS_A_GRID = 8
# of a motion, in cells
LEAST_SIZE = 0.01
MOST_SIZE = 20.0


def make_grid(rng: np.random.Generator) -> np.ndarray:
    """A valid grid (2, ni+1, nj+1): a graded box sheared by waves, turned, maybe mirrored."""
    ni = round(2.0 * 20.0 ** rng.random())
    nj = round(7.0 * (30.0 / 7.0) ** rng.random())
    while True:
        steps = [rng.uniform(0.3, 1.7, count) for count in (ni, nj)]
        x, y = (np.concatenate([[0.0], np.cumsum(step) / step.sum()]) for step in steps)
        x = np.repeat(x[:, None], nj + 1, axis=1) * rng.uniform(0.3, 3.0)
        y = np.repeat(y[None], ni + 1, axis=0)
        wave = rng.uniform(-0.25, 0.25, 2)
        phase = rng.uniform(-2.0, 2.0, 2)
        x, y = (
            x + wave[0] * np.sin(2.0 * np.pi * y + phase[0]),
            y + wave[1] * np.sin(2.0 * np.pi * x + phase[1]),
        )
        angle = rng.uniform(0.0, 2.0 * np.pi)
        cos = np.cos(angle)
        sin = np.sin(angle)
        nodes = np.array((cos * x - sin * y, sin * x + cos * y))
        if rng.random() < 0.3:
            nodes = nodes.transpose(0, 2, 1)
        if rng.random() < 0.3:
            nodes = nodes[:, ::-1]
        nodes = np.ascontiguousarray(nodes)
        if abs(compute_corner_signs(nodes).sum()) == 4 * ni * nj:
            return nodes


def make_motion(rng: np.random.Generator, nodes: np.ndarray) -> tuple[str, np.ndarray]:
    """Its kind and the new sides, NaN inside; the corners of the block move in a third of them."""
    boundary = nodes.copy()
    boundary[:, 1:-1, 1:-1] = np.nan
    inside = nodes[:, -1, -1] - nodes[:, 0, 0], nodes[:, -1, 0] - nodes[:, 0, -1]
    area = 0.5 * abs(inside[0][0] * inside[1][1] - inside[0][1] * inside[1][0])
    cell = np.sqrt(area / ((nodes.shape[1] - 1) * (nodes.shape[2] - 1)))
    size = cell * LEAST_SIZE * (MOST_SIZE / LEAST_SIZE) ** rng.random()
    kind = KINDS[rng.integers(len(KINDS))]
    if kind == "single node":
        side = SIDES[rng.integers(4)]
        node = rng.integers(boundary[side].shape[1])
        boundary[side][:, node] += rng.normal(scale=size, size=2)
        return kind, boundary
    for side in SIDES:
        if rng.random() < 0.4:
            continue
        line = boundary[side]
        count = line.shape[1]
        part = np.linspace(0.0, 1.0, count)
        if kind == "smooth":
            waves = np.array([np.sin(np.pi * k * part) for k in (1, 2, 3)])
            move = (size * rng.normal(size=(2, 3)) / (1.0, 2.0, 3.0)) @ waves
        elif kind == "noisy":
            move = rng.normal(scale=size, size=(2, count))
            for _ in range(rng.integers(0, 3)):
                move[:, 1:-1] = 0.25 * (move[:, :-2] + move[:, 2:]) + 0.5 * move[:, 1:-1]
        else:
            width = rng.uniform(0.03, 0.3)
            bump = np.exp(-(((part - rng.random()) / width) ** 2))
            move = size * rng.normal(size=(2, 1)) * bump
        move[:, [0, -1]] = 0.0
        line += move
    if rng.random() < 0.3:
        for i in (0, -1):
            for j in (0, -1):
                boundary[:, i, j] += rng.normal(scale=0.5 * size, size=2)
    return kind, boundary


def make_motions(seed: int, count: int) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Kind, valid grid and new sides of `count` motions, the same ones for the same seed."""
    rng = np.random.default_rng(seed)
    for number in range(count):
        if number % MOTIONS_A_GRID == 0:
            nodes = make_grid(rng)
        kind, boundary = make_motion(rng, nodes)
        yield kind, nodes, boundary


def is_simple(nodes: np.ndarray) -> bool:
    """Does the boundary of `nodes` neither cross nor touch itself?  Exact; every pair of edges."""
    x = np.concatenate((nodes[:, :, 0], nodes[:, -1, 1:], nodes[:, -2::-1, -1]), axis=1)
    x = np.concatenate((x, nodes[:, 0, -2:0:-1]), axis=1)
    after = np.roll(x, -1, axis=1)
    low, high = np.minimum(x, after), np.maximum(x, after)
    near = (low[0][:, None] <= high[0]) & (low[0] <= high[0][:, None])
    near &= (low[1][:, None] <= high[1]) & (low[1] <= high[1][:, None])
    p, q = np.nonzero(np.triu(near, 1))
    if (x == after).all(axis=0).any():
        return False
    count = x.shape[1]
    meeting = (q - p == 1) | (q - p == count - 1)
    first, second = p[~meeting], q[~meeting]
    a = x[:, first]
    b = after[:, first]
    c = x[:, second]
    d = after[:, second]
    with_c = compute_turns(a, b, c)[0]
    with_d = compute_turns(a, b, d)[0]
    with_a = compute_turns(c, d, a)[0]
    with_b = compute_turns(c, d, b)[0]
    if ((with_c * with_d <= 0) & (with_a * with_b <= 0)).any():
        return False
    # Two edges that share a node touch elsewhere only where the second folds back onto the first.
    before = np.roll(x, 1, axis=1)
    straight = compute_turns(before, after, x)[0] == 0
    for k in np.flatnonzero(straight):
        if ((before[:, k] - x[:, k]) * (after[:, k] - x[:, k])).sum() > 0.0:
            return False
    return True


def judge(nodes: np.ndarray, boundary: np.ndarray, answer) -> str:
    """The outcome: `answer` is a grid (2, ni+1, nj+1) or the failure that was raised."""
    simple = is_simple(boundary)
    if isinstance(answer, RegridFailure):
        if answer.cause == "lines-cross":
            return OUTCOMES[7] if simple else OUTCOMES[1]
        if not simple:
            return OUTCOMES[1]
        return OUTCOMES[2] if "no valid grid exists" in answer.what else OUTCOMES[3]
    if not all(np.array_equal(answer[side], boundary[side]) for side in SIDES):
        return OUTCOMES[6]
    sign = np.sign(compute_corner_signs(nodes).sum())
    convex = sign * compute_corner_signs(answer) > 0
    for corner in BLOCK_CORNERS:
        convex[corner] = True  # their nodes are all given
    if not convex.all():
        return OUTCOMES[4]
    return OUTCOMES[0] if simple else OUTCOMES[5]


def count_outcomes(seed: int, count: int, regridder=None, keep=None, limit=np.inf) -> dict:
    """Outcomes of `count` motions, or of as many as `limit` seconds allow: {kind: {outcome: n}}.

    `keep(outcome, kind, nodes, boundary)` is called for all but plain ones.
    """
    regridder = regridder or BarrierRegridder()
    counts = {kind: dict.fromkeys(OUTCOMES, 0) for kind in KINDS}
    begin = time.perf_counter()
    for kind, nodes, boundary in make_motions(seed, count):
        try:
            answer = regridder.regrid(nodes, boundary).nodes
        except RegridFailure as failure:
            answer = failure
        outcome = judge(nodes, boundary, answer)
        counts[kind][outcome] += 1
        if keep is not None and outcome not in OUTCOMES[:2]:
            keep(outcome, kind, nodes, boundary)
        if time.perf_counter() - begin > limit:
            break
    return counts


class Keeper:
    """Motions kept in a file: arrays `outcome`, `kind`, `nodes_N`, `boundary_N`."""

    def __init__(self):
        self.outcomes: list[str] = []
        self.kinds: list[str] = []
        self.arrays: dict[str, np.ndarray] = {}

    def __call__(self, outcome, kind, nodes, boundary):
        number = len(self.outcomes)
        self.outcomes.append(outcome)
        self.kinds.append(kind)
        self.arrays[f"nodes_{number}"] = nodes.copy()
        self.arrays[f"boundary_{number}"] = boundary

    def write(self, path: Path) -> None:
        np.savez_compressed(path, outcome=self.outcomes, kind=self.kinds, **self.arrays)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--count", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--minutes", type=float, default=np.inf)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--keep", type=Path)
    options = parser.parse_args()
    keeper = Keeper() if options.keep else None
    begin = time.perf_counter()
    counts = count_outcomes(options.seed, options.count, None, keeper, 60.0 * options.minutes)
    seconds = time.perf_counter() - begin
    tried = sum(sum(row.values()) for row in counts.values())
    for outcome in OUTCOMES:
        row = "".join(f"{counts[kind][outcome]:12d}" for kind in KINDS)
        print(f"{outcome:40s}{row}")
    print(f"{tried} motions of seed {options.seed}, {1e6 * seconds / tried:.0f} us each")
    if keeper:
        keeper.write(options.keep)
    if options.write:
        sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
        from benchmarks.result_tables import make_table, write_result

        rows = []
        for outcome in OUTCOMES:
            found = [counts[kind][outcome] for kind in KINDS]
            rows.append([outcome, *map(str, found), str(sum(found))])
        lines = make_table(["outcome", *KINDS, "all"], rows)
        write_result("random-motions", [f"{tried} motions, seed {options.seed}.", "", *lines])


if __name__ == "__main__":
    main()
