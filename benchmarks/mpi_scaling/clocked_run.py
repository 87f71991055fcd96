"""A command of shockgrid whose steps are clocked, on every rank: what each took, and its parts.

    mpiexec -n 2 python -m benchmarks.mpi_scaling.clocked_run FOLDER run DECK ...

Every rank leaves FOLDER/rank_R.json: one list a column, an entry a step.  Seconds of: `step`, the
call that all ranks make; `sides`, `regrid`, `flow`, its phases; `lines`, the part of `regrid` that
all ranks do alike; `packing`, the copying of a rank's messages; `messages`, the waiting for them;
`loop`, from the end of one step to that of the next on this rank (the history and its file, and
what the first rank has to say, are in it).  Counts: `calls`, `bytes`, of messages, and
`node_iterations` of the regridder, `nodes` of all blocks.

Note: a clock of a call of a microsecond would measure itself; these are of tens of them.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from shockgrid.hydro import step as flow_step
from shockgrid.hydro.ranks.messages import Message
from shockgrid.hydro.simulation import Simulation
from shockgrid.runs.cli.main import main
from shockgrid.runs.ranks.started import find_rank

PHASES = ("sides", "regrid", "flow")
COLUMNS = ("step", *PHASES, "lines", "packing", "messages", "loop", "calls", "bytes",
           "node_iterations", "nodes")  # fmt: skip


class Clocks:
    """Seconds of calls, added up by name until they are taken."""

    def __init__(self):
        self.seconds: dict[str, float] = {}

    def wrap(self, owner: type, name: str, key: str) -> None:
        """Add the seconds of the method `name` of a class to those of `key`."""
        setattr(owner, name, self.clock(getattr(owner, name), key))

    def clock(self, call: Callable, key: str) -> Callable:
        """The call, with its seconds added up."""

        def clocked(*arguments: Any, **options: Any) -> Any:
            began = time.perf_counter()
            try:
                return call(*arguments, **options)
            finally:
                passed = time.perf_counter() - began
                self.seconds[key] = self.seconds.get(key, 0.0) + passed

        return clocked

    def take(self, key: str) -> float:
        """What was added up for `key` since the last call."""
        return self.seconds.pop(key, 0.0)


class Record:
    """The columns of one rank."""

    def __init__(self):
        self.simulation: Simulation | None = None
        self.clocks = Clocks()

    def _begin(self, simulation: Simulation) -> None:
        self.simulation = simulation
        self.ended = time.perf_counter()
        self.columns: dict[str, list[float]] = {name: [] for name in COLUMNS}
        self.counts = (0, 0, 0.0)
        self.in_shares = 0.0

    def watch(self) -> None:
        """Clock the calls of the packages from now on."""
        self.clocks.wrap(flow_step, "move_sides", "lines")
        self.clocks.wrap(Message, "share", "shares")
        advance = Simulation.advance

        def clocked(simulation: Simulation) -> dict[str, Any]:
            if simulation is not self.simulation:  # those before were marched to make its deck
                self._begin(simulation)
            self.clocks.seconds.clear()
            began = time.perf_counter()
            row = advance(simulation)
            ended = time.perf_counter()
            self._note(simulation, row, ended - began, ended - self.ended)
            self.ended = ended
            return row

        Simulation.advance = clocked  # type: ignore[method-assign]

    def _note(self, simulation: Simulation, row: dict[str, Any], step: float, loop: float) -> None:
        book = getattr(simulation._flow.blocks, "book", None)
        kinds = book.kinds if book else {}
        inside = [t for kind, t in kinds.items() if kind != "whole blocks"]
        counts = (sum(t.calls for t in inside), sum(t.bytes for t in inside),
                  sum(t.seconds for t in inside))  # fmt: skip
        calls, sizes, waited = (new - old for new, old in zip(counts, self.counts, strict=True))
        self.counts = counts
        in_shares = sum(t.seconds for kind, t in kinds.items() if kind in ("nodes", "states"))
        shares = self.clocks.take("shares")
        found = {
            "step": step,
            **{phase: row[f"seconds_{phase}"] for phase in PHASES},
            "lines": self.clocks.take("lines"),
            "packing": shares - (in_shares - self.in_shares),
            "messages": waited,
            "loop": loop,
            "calls": calls,
            "bytes": sizes,
            "node_iterations": row["regrid_node_iterations"],
            "nodes": sum(block.nodes[0].size for block in simulation._flow.blocks),
        }
        self.in_shares = in_shares
        for name in COLUMNS:
            self.columns[name].append(found[name])

    def write(self, folder: Path) -> None:
        """Leave the columns in a file of this rank."""
        path = folder / f"rank_{find_rank()}.json"
        path.write_text(json.dumps(self.columns), encoding="utf-8")


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    sys.argv = ["shockgrid", *sys.argv[2:]]
    record = Record()
    record.watch()
    try:
        code = main()
    finally:
        record.write(folder)
    sys.exit(code)
