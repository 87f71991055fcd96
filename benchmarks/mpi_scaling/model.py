"""What a step costs on ranks: constants fitted to measured runs, carried to more of them.

A step takes, on the rank that has most to do,

    T = own work + work done alike by all ranks + messages + the first rank's record,

    own work    u C + u_b B_own + i N           cells C, iterations x nodes N of its B_own blocks
    alike       p P + p_b B + s                 faces P along the sides of all blocks B
    messages    m (c + a log2 R) + (w + 1/b) D  with m messages and D bytes per step to every rank

and r for the history's row and what the first rank has to say.  u, i, p, s, c, w, r are fitted to
runs of one machine, where a = 1/b = 0; the latency a and the bandwidth b of a network are assumed.
Each part of a step is fitted by itself, with relative errors and without negative constants.

Note: constants of a machine with its cores to itself; a run beside others looks slower.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares, lsq_linear

from benchmarks.mpi_scaling.cases import Timing
from shockgrid.hydro.ranks.messages import CELLS_DEEP, NODES_DEEP

RING_BYTES = 8 * (2 * NODES_DEEP + 5 * CELLS_DEEP)  # that a face of a side stands for in a step
# of a block that is cut: rows at each cut, numbers per cell
GHOST_ROWS = 2
GHOST_NUMBERS = 6
LEAST_GAIN = 0.5  # efficiency at which another rank is said to gain nothing


@dataclass(frozen=True)
class Network:
    """A network: `latency` [s] of a message between two ranks, `bandwidth` [bytes/s] of each.

    A message to all R ranks takes the latency log2 R times, rounded up.
    """

    latency: float = 2e-6
    bandwidth: float = 1e10

    def take(self, ranks: int, calls: float, size: float) -> float:
        """Seconds of `calls` messages to all ranks, of `size` bytes together."""
        if ranks == 1:
            return 0.0
        return calls * self.latency * math.ceil(math.log2(ranks)) + size / self.bandwidth


SAME_MACHINE = Network(0.0, math.inf)  # what its messages take is in the fitted constants


@dataclass(frozen=True)
class Costs:
    """Fitted constants [s]: of a cell, a block, a node and iteration, a face of a side, a step, a
    message, a byte."""

    cell: float
    own_block: float
    iteration: float
    face: float
    block: float
    step: float
    message: float
    byte: float
    record: float


@dataclass(frozen=True)
class Load:
    """What the fullest of `ranks` ranks has to do in a step; numbers are means a step.

    cells, own_blocks: of its own; node_iterations: iterations times nodes there; faces, blocks: of
    all; calls, size: messages and their bytes; cuts: messages to neighbours and reductions where
    blocks are cut in `strips`, `cut_size` their bytes.
    """

    ranks: int
    cells: float
    own_blocks: float
    node_iterations: float
    faces: float
    blocks: float
    calls: float
    size: float
    cuts: float = 0.0
    cut_size: float = 0.0
    strips: float = 1.0


def predict(costs: Costs, load: Load, network: Network = SAME_MACHINE) -> dict[str, float]:
    """Seconds of a step by part: "own work", "alike", "messages", "record"."""
    own = costs.cell * load.cells + costs.own_block * load.own_blocks
    messages = 0.0
    if load.ranks > 1:
        calls = load.calls + load.cuts
        size = load.size + load.cut_size
        messages = costs.message * calls + costs.byte * size + network.take(load.ranks, calls, size)
    return {
        "own work": own + costs.iteration * load.node_iterations,
        "alike": costs.face * load.faces + costs.block * load.blocks + costs.step,
        "messages": messages,
        "record": costs.record,
    }


def describe_load(timing: Timing) -> Load:
    """What a measured run had to do."""
    case = timing.case
    size = case.cells * case.cells
    iterations = timing.steps["node_iterations"]
    return Load(
        ranks=max(1, case.ranks),
        cells=size * case.own_blocks,
        own_blocks=case.own_blocks,
        node_iterations=float(np.mean(iterations)) / max(1, case.ranks),
        faces=4.0 * case.cells * case.blocks,
        blocks=case.blocks,
        calls=timing.counts["calls"],
        size=timing.counts["bytes"],
    )


def fit(timings: Sequence[Timing]) -> Costs:
    """Constants from runs of one thread a rank: of one rank for the work, of more for messages.

    Raises ValueError where there are too few of them.
    """
    one = [t for t in timings if t.case.ranks <= 1 and t.case.threads == 1]
    alone = [t for t in one if t.case.kind != "mushroom"]
    bent = [t for t in one if t.case.kind == "mushroom"]
    more = [t for t in timings if t.case.ranks > 1 and t.case.own_blocks < t.case.blocks]
    if len(alone) < 3 or not bent or len(more) < 2:
        raise ValueError("too few runs: three of one rank, two of more, and a mushroom are needed")
    loads = [describe_load(t) for t in alone]
    cell, own_block = _fit_part(
        alone, loads, ("inside", "regrid"), lambda load: (load.cells, load.own_blocks)
    )
    rest = _fit_part(alone, loads, ("rest",), lambda load: (load.cells, load.blocks, 1.0))
    sides = _fit_part(alone, loads, ("sides", "lines"), lambda load: (load.faces, load.blocks))
    loads = [describe_load(t) for t in more]
    message, byte = _fit_part(more, loads, ("messages",), lambda load: (load.calls, load.size))
    (copied,) = _fit_part(more, loads, ("packing",), lambda load: (load.size,))
    return Costs(
        cell=cell + rest[0],
        own_block=own_block,
        iteration=_fit_iteration(bent),
        face=sides[0],
        block=sides[1] + rest[1],
        step=rest[2],
        message=message,
        byte=byte + copied,
        record=min(t.seconds["record"] for t in one),
    )


def _fit_part(
    timings: Sequence[Timing],
    loads: Sequence[Load],
    parts: Sequence[str],
    terms: Callable[[Load], tuple[float, ...]],
) -> list[float]:
    """Constants, none negative, of the terms whose sum is the seconds of some parts of a step."""
    seconds = np.array([sum(t.seconds[part] for part in parts) for t in timings])
    matrix = np.array([terms(load) for load in loads], dtype=np.float64)
    scale = matrix.max(axis=0)  # cells and blocks differ by a million
    found = lsq_linear(matrix / scale / seconds[:, None], np.ones(len(seconds)), (0.0, np.inf))
    return (found.x / scale).tolist()


def _fit_iteration(timings: Sequence[Timing]) -> float:
    """Seconds of an iteration at a node: the slope of a step's regridding over its iterations."""
    seconds = np.concatenate([t.steps["regrid"] for t in timings])
    counts = np.concatenate([t.steps["node_iterations"] for t in timings])
    scale = float(np.median(seconds))
    size = float(counts.max())
    if size == 0.0:
        raise ValueError("the regridder made no iteration in any step")

    def miss(guess):
        return guess[0] + guess[1] * counts / size - seconds / scale

    found = least_squares(miss, (1.0, 1.0), bounds=(0.0, np.inf), loss="soft_l1", f_scale=0.1)
    return float(found.x[1]) * scale / size


def compute_size(faces: float, blocks: float) -> float:
    """Bytes that every rank hears in a step, of so many blocks with so many faces."""
    return RING_BYTES * faces + 8.0 * 40.0 * blocks


def load_strong(ranks: int, cells: float, blocks: int, iterations: float, calls: float) -> Load:
    """So many cells in so many square blocks, cut in strips where there are more ranks than blocks.

    iterations: of the regridder a node and step.  Each cut has two ghost rows on either side, and
    every iteration a row, two sums over the strips, all told by messages.  Where the ranks are no
    multiple of the blocks the strips are of unequal blocks, but of the same size.
    """
    side = math.sqrt(cells / blocks)
    strips = max(1.0, ranks / blocks)
    own = math.ceil(blocks / min(ranks, blocks))
    cuts = 0.0
    cut_size = 0.0
    if strips > 1.0:
        cuts = 2.0 + 3.0 * iterations
        cut_size = 8.0 * side * 2.0 * (GHOST_ROWS * GHOST_NUMBERS + 2.0 * iterations)
    mine = own * cells / blocks / strips
    faces = 4.0 * side * blocks
    size = compute_size(faces, blocks)
    return Load(
        ranks, mine, own, iterations * mine, faces, blocks, calls, size, cuts, cut_size, strips
    )


def load_weak(ranks: int, cells: float, iterations: float, calls: float) -> Load:
    """A square block of so many cells on every rank."""
    faces = 4.0 * math.sqrt(cells) * ranks
    size = compute_size(faces, ranks)
    return Load(ranks, cells, 1.0, iterations * cells, faces, ranks, calls, size)


def keep_neighbours(load: Load) -> Load:
    """The same, if a rank had only the perimeters of its own blocks or strips and of their four
    neighbours."""
    part = min(1.0, 5.0 * load.own_blocks / (load.blocks * load.strips))
    return replace(load, faces=load.faces * part, blocks=load.blocks * part, size=load.size * part)


def find_crossover(efficiency: Callable[[int], float], most: int) -> int | None:
    """The fewest ranks, up to `most`, at which the efficiency is below `LEAST_GAIN`; or None."""
    for ranks in range(1, most + 1):
        if efficiency(ranks) < LEAST_GAIN:
            return ranks
    return None
