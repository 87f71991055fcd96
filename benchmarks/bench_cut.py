"""What a block that is cut among ranks costs: its regridding, its update, what travels.

    mpiexec -n 2 python benchmarks/bench_cut.py [cells per wavelength] [steps]

The mushroom, marched by every rank alone; then its largest block is cut in two, and the messages
of a cut are timed.  Three ways to regrid such a block on more ranks are computed from this: by its
home alone, by all of its ranks over again, and by lines that are shared, where every iteration of
conjugate gradients has two sums over all ranks and the rows beside theirs.
"""

from __future__ import annotations

import sys
import time

import numpy as np
from mpi4py import MPI

from shockgrid.hydro.ranks.ranks import Ranks
from shockgrid.runs.deck.reading import read_deck

# steps that are measured, messages of a kind
LAST = 50
MESSAGES = 300


def measure_seconds(comm, call) -> float:
    """Least time [s] of `call`, made by all ranks together, on the slowest of them."""
    found = []
    for _ in range(MESSAGES):
        comm.Barrier()
        began = time.perf_counter()
        call()
        found.append(comm.allreduce(time.perf_counter() - began, op=MPI.MAX))
    return min(found)


def main() -> None:
    """Print the table, on the first rank."""
    comm = MPI.COMM_WORLD
    cells = int(sys.argv[1]) if len(sys.argv) > 1 else 128
    steps = int(sys.argv[2]) if len(sys.argv) > 2 else 400
    settings = [f"cells={cells}", "run.threads=1"]
    flow = read_deck("interface-instability-mushroom", settings).make_problem().build()
    rows = [flow.advance() for _ in range(steps)][-LAST:]
    blocks = flow.blocks
    count = sum(block.ni * block.nj for block in blocks)
    regrid, update = (min(row[f"seconds_{name}"] for row in rows) for name in ("regrid", "flow"))
    iterations = sum(row["regrid_iterations"] for row in rows) / (len(rows) * len(blocks))

    largest = max(range(len(blocks)), key=lambda n: blocks[n].ni * blocks[n].nj)
    places = [(0, 1) if n == largest else (1,) for n in range(len(blocks))]
    ranks = Ranks(comm, blocks, places)
    flow.use_ranks(ranks)
    cut = ranks.cuts[largest]
    block = blocks[largest]
    size = block.ni * block.nj
    number = np.zeros(1)
    total = np.zeros(1)
    nodes = measure_seconds(comm, cut.send_nodes)
    sound = measure_seconds(comm, lambda: cut.gather_rows(block.sound))
    ghosts = measure_seconds(comm, cut.exchange_ghost_rows)
    scan = measure_seconds(comm, flow.small_cells.scan_bands)
    latency = measure_seconds(comm, lambda: comm.Allreduce(number, total))
    beside = np.zeros((2, 2, block.ni))

    def swap_rows():
        other = 1 - comm.rank
        comm.Sendrecv(beside[0], dest=other, recvbuf=beside[1], source=other)

    halo = measure_seconds(comm, swap_rows)
    if comm.rank:
        return
    per_cell = 1e9 / size
    print(f"block of {block.ni} x {block.nj} cells, cut in two; ns per cell of the block")
    print(f"regridding    {1e9 * regrid / count:8.2f}, {iterations:g} iterations per block")
    print(f"update        {1e9 * update / count:8.2f}")
    print(f"nodes to half {per_cell * nodes:8.2f}")
    print(f"sound of half {per_cell * sound:8.2f}")
    print(f"ghost rows    {per_cell * ghosts:8.2f}")
    print(f"crowding      {per_cell * scan:8.2f}, with the scan of the rates")
    print(f"a sum of all ranks {1e6 * latency:.1f} us, rows beside lines {1e6 * halo:.1f} us")
    solve = 1e9 * regrid / count
    own = 1e9 * update / count
    print("ranks  home regrids  all regrid  lines shared   (regridding and update, ns per cell)")
    for n in (2, 4, 8, 16):
        far = 2.0 * (n - 1) / n  # of what travels to half of the block
        home = solve + far * per_cell * (nodes + sound) + own / n
        every = solve + far * per_cell * sound + own / n
        shared = (solve + own) / n + per_cell * iterations * (2.0 * latency + halo)
        print(f"{n:5d}  {home:12.1f}  {every:10.1f}  {shared:12.1f}")


if __name__ == "__main__":
    main()
