"""The runs that are measured: decks, ranks, threads; each clocked from outside and step by step.

The flow is `interface-instability` in a square of so many cells per block, with the shock at the
interface from the first steps on; `blocks` is eight gases in a row, for what a block and its sides
cost apart from its cells; `mushroom` is a rolled-up interface, for the iterations of the regridder.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
WARM = 4  # steps at a run's begin that are not counted
IN_ROW = 8  # blocks of the deck `blocks`


@dataclass(frozen=True)
class Case:
    """A run: `blocks` blocks of `cells` squared each on `ranks` ranks of `threads` threads.

    ranks 0: without mpiexec.
    """

    kind: str
    cells: int
    ranks: int
    threads: int
    steps: int

    @property
    def blocks(self) -> int:
        """How many blocks it has."""
        return IN_ROW if self.kind == "blocks" else 2

    @property
    def own_blocks(self) -> int:
        """How many of them the fullest rank computes."""
        return -(-self.blocks // max(1, self.ranks))

    @property
    def how(self) -> str:
        """Ranks and threads in words."""
        if self.ranks == 0:
            return f"one process, {self.threads} thread{'s' * (self.threads > 1)}"
        crowded = ", oversubscribed" * (self.ranks > (os.cpu_count() or 1))
        return f"{self.ranks} rank{'s' * (self.ranks > 1)}{crowded}"

    def list_words(self, folder: Path) -> list[str]:
        """The command after `shockgrid`; a deck that is no packaged one goes into `folder`."""
        n = self.cells
        square = ["width=1.0", "lengths=[1.0,1.0]", "gap=0.01"]
        settings = [f"run.max_steps={self.steps}", "output.dumps=0"]
        deck = "interface-instability"
        if self.kind == "square":
            settings += [f"cells={n}", *square]
        elif self.kind == "mushroom":
            deck = f"{deck}-mushroom"
            settings = [*settings, f"cells={n}"]
        else:
            deck = str(folder / "blocks.toml")
            Path(deck).write_text(write_row_of_blocks(n), encoding="utf-8")
        words = ["run", deck, "--threads", str(self.threads), "-q"]
        return [*words, *(word for setting in settings for word in ("--set", setting))]


@dataclass
class Timing:
    """What repeated runs of a case have shown.

    `command`: wall seconds from the call to the end, the least; `seconds`: of a step and its parts,
    means of the fastest quarter of the steps of the fastest run; `counts`: messages and bytes of a
    step; `steps`: wall seconds of the regridder, its iterations times nodes, and the nodes, step by
    step, of the first run.
    """

    case: Case
    command: float = np.inf
    seconds: dict[str, float] = field(default_factory=dict)
    counts: dict[str, float] = field(default_factory=dict)
    steps: dict[str, list[float]] = field(default_factory=dict)


def write_row_of_blocks(cells: int) -> str:
    """A deck of `IN_ROW` gases, `cells` squared each, joined by interfaces behind a piston."""
    lines = ['problem = "blocks"', "run = { t_end = 1.0, cfl = 0.8 }"]
    for number in range(IN_ROW):
        low, high = float(number), float(number + 1)
        sides = ['{ side = "j_min", kind = "wall" }', '{ side = "j_max", kind = "wall" }']
        if number == 0:
            sides.append('{ side = "i_min", kind = "piston", velocity = [0.5, 0.0] }')
        if number == IN_ROW - 1:
            sides.append('{ side = "i_max", kind = "wall" }')
        corners = [[low, 0.0], [high, 0.0], [high, 1.0], [low, 1.0]]
        curves = {"j_min": (0, 1), "i_max": (1, 2), "j_max": (3, 2), "i_min": (0, 3)}
        lines += ["[[block]]", f'name = "gas{number}"', f"cells = [{cells}, {cells}]"]
        lines += [f"curves.{s} = {[corners[a], corners[b]]}" for s, (a, b) in curves.items()]
        lines += ["rho = 1.0", "p = 1.0", f"side = [{', '.join(sides)}]"]
    for number in range(IN_ROW - 1):
        lines += ["[[link]]", 'kind = "interface"']
        lines.append(f'sides = ["gas{number}.i_max", "gas{number + 1}.i_min"]')
    return "\n".join(lines) + "\n"


def find_mpiexec() -> list[str] | None:
    """mpiexec of this environment with its options, not the number; None where there is none."""
    try:
        import mpi4py  # noqa: F401
    except ImportError:
        return None
    beside = Path(sys.executable).with_name("mpiexec")
    command = str(beside) if beside.exists() else shutil.which("mpiexec")
    if command is None:
        return None
    told = subprocess.run([command, "--version"], capture_output=True, text=True).stdout
    if "Open MPI" not in told and "OpenRTE" not in told:
        return [command]
    root = hasattr(os, "geteuid") and os.geteuid() == 0
    return [command, "--oversubscribe", *["--allow-run-as-root"] * root]


def measure(timing: Timing, mpiexec: list[str]) -> None:
    """Run a case once more and keep what is less than before.  SystemExit where it fails."""
    case = timing.case
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        program = [sys.executable, "-m", "benchmarks.mpi_scaling.clocked_run", place]
        if case.ranks:
            program = [*mpiexec, "-n", str(case.ranks), *program]
        words = [*program, *case.list_words(folder), "-o", str(folder / "run")]
        environment = os.environ | {"OMP_NUM_THREADS": str(case.threads)}
        began = time.perf_counter()
        done = subprocess.run(words, capture_output=True, text=True, cwd=ROOT, env=environment)
        timing.command = min(timing.command, time.perf_counter() - began)
        if done.returncode:
            raise SystemExit(f"{' '.join(words)}: exit code {done.returncode}\n{done.stderr}")
        take(timing, [json.loads(p.read_text("utf-8")) for p in sorted(folder.glob("rank_*.json"))])


def take(timing: Timing, ranks: list[dict[str, list[float]]]) -> None:
    """Keep what the clocks of all `ranks` say of a run's steps, if it is the fastest so far.

    Of the first rank the parts; a step's `messages` are those of the rank that waits least, the
    last one to come, so that they are without what the ranks have unequal to do.
    """
    first = ranks[0]
    columns = {name: np.array(values[WARM:]) for name, values in first.items()}
    waits = np.array([rank["messages"][WARM:] for rank in ranks])
    found = {
        "sides": columns["sides"],
        "lines": columns["lines"],
        "packing": columns["packing"],
        "inside": columns["flow"],
        "regrid": columns["regrid"] - columns["lines"],
        "rest": columns["step"] - columns["sides"] - columns["regrid"] - columns["flow"],
        "record": columns["loop"] - columns["step"],
        "messages": waits.min(axis=0),
        "loop": columns["loop"],
    }
    fastest = np.argsort(found["loop"])[: max(1, len(found["loop"]) // 4)]
    means = {name: float(values[fastest].mean()) for name, values in found.items()}
    if means["loop"] < timing.seconds.get("loop", np.inf):
        timing.seconds = means
    timing.counts = {name: float(np.median(columns[name])) for name in ("calls", "bytes")}
    if not timing.steps:
        kept = {name: first[name][WARM:] for name in ("node_iterations", "nodes")}
        timing.steps = {"regrid": found["regrid"].tolist(), **kept}
