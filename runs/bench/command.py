"""`shockgrid bench`: machine, speeds, shares."""

from __future__ import annotations

from collections.abc import Callable

from runs.bench.commands import RUNS, measure_command
from runs.bench.flows import measure_flow, measure_threads
from runs.bench.peer import Peer
from runs.bench.steps import measure_steps
from runs.bench.tables import Tables, describe_machine

EXPLANATION = """\
flow: million cell updates a CPU second on one thread. A whole step holds the sides, the history row
with the quality of every cell, and the ledger; where the grid is rebuilt, the regridder too.
flow-parts: how the time of such a step divides. steps: calls of kernels and of all else in a step
of a small run, CPU time inside and outside of kernels. commands: whole commands, start and output
included, kernels compiled before; what their shares leave of the wall time is start and output."""


def bench(
    cells: int,
    rounds: int,
    runs: str,
    path: str | None,
    peer: str | None,
    say: Callable[[str], None],
) -> None:
    """Measure and print; into the JSON file `path`, if one is named.

    runs: a key of `RUNS`; peer: a built checkout of CloverLeaf_ref to measure beside, or None.
    Raises BadInput.
    """
    words = ["shockgrid bench", f"--cells {cells}", f"--rounds {rounds}"]
    command = " ".join([*words, f"--runs {runs}", *["--peer CHECKOUT"] * (peer is not None)])
    tables = Tables(path, command, say)
    beside = Peer(peer) if peer else None
    say(describe_machine().replace(" at the end", " now"))
    say(EXPLANATION)
    measure_flow(tables, cells, rounds, beside)
    measure_threads(tables, (cells // 2, cells), rounds)
    measure_steps(tables, rounds)
    for words_of_run in RUNS[runs]:
        measure_command(tables, words_of_run, rounds, beside)
    tables.write()
