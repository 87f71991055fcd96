"""How fast this machine computes, and where the time of a step goes.

    python benchmarks/flow_speed.py [--runs long] [--peer CHECKOUT]

CloverLeaf_ref, compiled Fortran on a grid at rest, can be measured beside it (`--peer`).  Run
nothing else meanwhile: other work distorts the timings.
"""

from __future__ import annotations

import argparse
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numba
import numpy as np
from result_tables import Tables, describe_machine, read_child_time

from shockgrid.hydro import phases
from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import EquationOfState, IdealGas, MieGruneisen
from shockgrid.hydro.history import TIMED_PARTS
from shockgrid.hydro.links import join
from shockgrid.hydro.simulation import Simulation
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.registry import make_regridder
from shockgrid.runs.store.reader import RunData

CELLS = 400
STEPS = 87
DECK = """*clover
 state 1 density=0.2 energy=1.0
 state 2 density=1.0 energy=2.5 geometry=rectangle xmin=0.0 xmax=5.0 ymin=0.0 ymax=2.0
 x_cells={cells}
 y_cells={cells}
 xmin=0.0
 ymin=0.0
 xmax=10.0
 ymax=10.0
 initial_timestep=0.04
 timestep_rise=1.5
 max_timestep=0.04
 end_step={steps}
 test_problem 0
*endclover
"""


class Peer:
    """CloverLeaf_ref in the built checkout `path`; raises BadInput where there is none."""

    name = "CloverLeaf"

    def __init__(self, path: str):
        self.program = (Path(path) / "clover_leaf").resolve()
        if shutil.which(str(self.program)) is None:
            raise BadInput(
                f"--peer {path}: there is no program clover_leaf in it; build CloverLeaf_ref there "
                "first (make COMPILER=GNU)"
            )

    def measure(self) -> float:
        """Million cell updates a CPU second of one run on one core."""
        alone = {**os.environ, "OMP_NUM_THREADS": "1"}  # threads that wait count as CPU time
        with tempfile.TemporaryDirectory() as folder:
            text = DECK.format(cells=CELLS, steps=STEPS)
            (Path(folder) / "clover.in").write_text(text, encoding="ascii")
            before = read_child_time()
            done = subprocess.run(
                [str(self.program)], cwd=folder, env=alone, capture_output=True, text=True
            )
            after = read_child_time()
        if done.returncode:
            raise BadInput(f"{self.program} ended with {done.returncode}: {done.stderr[-200:]}")
        return CELLS * CELLS * STEPS / (after.ru_utime - before.ru_utime) / 1e6


def time_rounds(
    call: Callable[[], object], count: int, times: int, rounds: int, peer: Peer | None
) -> dict[str, float]:
    """Best and median million cell updates a CPU second of `times` calls that make `count` each.

    With a peer each round has one of its runs beside it, and the ratio is of medians.
    """
    speeds = []
    others = []
    for _ in range(rounds):
        start = time.process_time()
        for _ in range(times):
            call()
        speeds.append(count * times / (time.process_time() - start) / 1e6)
        if peer:
            others.append(peer.measure())
    return compare_speeds(speeds, others, peer)


def compare_speeds(speeds: list[float], others: list[float], peer: Peer | None) -> dict[str, float]:
    """Columns of a row: best, median, and the median over the peer's."""
    middle = statistics.median(speeds)
    row = {"best, million/s": max(speeds), "median, million/s": middle}
    if peer:
        row[f"{peer.name}, million/s"] = statistics.median(others)
        row[f"over {peer.name}"] = middle / statistics.median(others)
    return row


PARTS = ("sides", "regrid", "flow")
RUNS = ("none", "default", "long", "large")  # so many of COMMANDS; the last take 25 minutes
COMMANDS: tuple[tuple[str, ...], ...] = (
    ("interface-instability",),
    ("interface-instability-mushroom",),
    ("interface-instability", "--set", "cells=256"),
)


def measure_command(tables: Tables, words: tuple[str, ...], rounds: int, peer: Peer | None) -> None:
    """Table `commands`: `shockgrid run WORDS`, warm; the first of its runs is not counted."""
    speeds = []
    others = []
    seconds = []
    walls = []
    with tempfile.TemporaryDirectory() as folder:
        output = str(Path(folder) / "run")
        program = [sys.executable, "-m", "shockgrid", "run", *words, "-q", "--force", "-o", output]
        for number in range(rounds + 1):
            before = read_child_time()
            begin = time.perf_counter()
            done = subprocess.run(program, capture_output=True, text=True)
            after = read_child_time()
            end = time.perf_counter()
            if done.returncode:
                raise BadInput(f"{' '.join(words)}: {done.stderr.strip()}")
            run = RunData(output)
            steps = run.dumps[-1].step
            cells = sum(np.prod(np.array(b.nodes.shape[1:]) - 1) for b in run.dumps[-1].blocks)
            if number == 0:
                continue
            used = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
            seconds.append(used)
            walls.append(end - begin)
            speeds.append(float(cells) * steps / used / 1e6)
            if peer:
                others.append(peer.measure())
        history = run.history
    shares = {part: float(np.nansum(history[f"seconds_{part}"])) for part in PARTS}
    tables.add(
        "commands",
        command="run " + " ".join(word for word in words if word != "--set"),
        cells=int(cells),
        steps=int(steps),
        **{"CPU s": float(np.median(seconds)), "wall s": float(np.median(walls))},
        **compare_speeds(speeds, others, peer),
        **{f"{part}, %": 100.0 * value / float(np.median(walls)) for part, value in shares.items()},
    )


# equation of state, density, pressure and speed of the flow
MATERIALS: dict[str, tuple[EquationOfState, float, float, float]] = {
    "ideal gas": (IdealGas(1.4), 1.0, 1.0, 0.3),
    "Mie-Gruneisen": (MieGruneisen(), 2707.0, 1.0e9, 100.0),
}
UPDATES = 2_000_000  # cell updates of a timing, or three steps
LONGEST = 4  # steps of all timings over the cells of a side: later the piston comes too close


def make_simulation(material: str, cells: int, mesh: str, threads: int) -> Simulation:
    """Two blocks side by side, cells × cells together, a smooth flow and a moving interface."""
    eos, rho, p, speed = MATERIALS[material]
    blocks = []
    for name, start in (("left", 0.0), ("right", 0.5)):
        x = np.linspace(start, start + 0.5, cells // 2 + 1)
        y = np.linspace(0.0, 1.0, cells + 1)
        nodes = np.array(np.meshgrid(x, y, indexing="ij"))
        centre = 0.5 * (x[1:] + x[:-1])[:, None]
        u = np.where(centre < 0.4, speed, 0.0) * np.ones(cells)
        blocks.append(Block(name, eos, nodes, rho, u, 0.0, p))
    left, right = blocks
    kind = "seam" if mesh == "fixed" else "interface"
    links = [join(kind, (left, "i_max"), (right, "i_min"))]
    if mesh == "fixed":
        put(left, "i_min", "wall")
    else:
        put(left, "i_min", "piston", velocity=(0.5 * speed, 0.0))
    put(right, "i_max", "wall")
    for block in blocks:
        put(block, "j_min", "wall")
        put(block, "j_max", "wall")
    return Simulation(
        blocks,
        links,
        t_end=1e9,
        mesh=mesh,
        threads=threads,
        make_regridder=lambda: make_regridder("barrier", threads=threads),
    )


def count_steps(cells: int, rounds: int) -> int:
    """Steps of one timing at cells × cells."""
    return max(1, min(max(3, UPDATES // (cells * cells)), LONGEST * cells // rounds))


def measure_flow(tables: Tables, cells: int, rounds: int, peer: Peer | None) -> None:
    """Tables `flow`, `flow-parts` and `flow-threads` at cells × cells."""
    repeats = count_steps(cells, rounds)
    for name in MATERIALS:
        fixed = make_simulation(name, cells, "fixed", 1)
        fixed.advance()
        block = fixed.blocks[0]
        dt = 1e-3 * fixed.dt
        phases.predict(block, dt)  # the new state's ghosts: cells of zeros would all ask for HLL
        moving = make_simulation(name, cells, "regrid", 1)
        cases: dict[str, tuple[Callable[[], object], int, int]] = {
            "flow kernel of one block": (
                lambda b=block, d=dt: phases.update(b, d),
                block.ni * block.nj,
                repeats,
            ),
            "whole step, fixed mesh": (fixed.advance, cells * cells, repeats),
            "whole step, grid rebuilt": (moving.advance, cells * cells, (repeats + 1) // 2),
        }
        for what, (call, count, times) in cases.items():
            call()
            found = time_rounds(call, count, times, rounds, peer)
            tables.add("flow", case=f"{name}, {cells}²", what=what, **found)
        row = moving.advance()
        parts = {part: row[f"seconds_{part}"] for part in TIMED_PARTS}
        shares = {f"{part}, %": 100.0 * v / sum(parts.values()) for part, v in parts.items()}
        arrays = [v for b in fixed.blocks for v in vars(b).values() if isinstance(v, np.ndarray)]
        held = round(sum(a.nbytes for a in arrays) / cells**2)
        tables.add("flow-parts", case=f"{name}, {cells}²", **shares, **{"bytes per cell": held})


def measure_threads(tables: Tables, sizes: tuple[int, ...], rounds: int) -> None:
    """Table `flow-threads`: two threads over one, by the clock on the wall."""
    if numba.config.NUMBA_NUM_THREADS < 2:
        return
    for cells in sizes:
        best = []
        simulations = [make_simulation("ideal gas", cells, "regrid", n) for n in (1, 2)]
        for simulation in simulations:
            simulation.advance()
        repeats = count_steps(cells, rounds)
        for simulation in simulations * rounds:
            start = time.perf_counter()
            for _ in range(repeats):
                simulation.advance()
            best.append(time.perf_counter() - start)
        gain = min(best[0::2]) / min(best[1::2])
        tables.add(
            "flow-threads", case=f"ideal gas, {cells}²", **{"two threads over one, wall time": gain}
        )


EXPLANATION = """\
flow: million cell updates a CPU second on one thread. A whole step holds the sides, the history row
with the quality of every cell, and the ledger; where the grid is rebuilt, the regridder too.
flow-parts: how the time of such a step divides. commands: whole commands, start and output
included, kernels compiled before; what their shares leave of the wall time is start and output."""


def main() -> None:
    """Measure and print; into the JSON file of --json, if one is named."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--cells", type=int, default=400, help="square of cells [400]")
    parser.add_argument("--rounds", type=int, default=5, help="timings of each case [5]")
    parser.add_argument("--runs", choices=RUNS, default="default", help="whole commands [default]")
    parser.add_argument("--peer", metavar="DIR", help="a built CloverLeaf_ref to measure beside")
    tables = Tables(parser)
    words = tables.options
    beside = Peer(words.peer) if words.peer else None
    if words.peer:  # a path of this machine says nothing elsewhere
        tables.command = tables.command.replace(words.peer, "CHECKOUT")
    print(describe_machine().replace(" at the end", " now"))
    print(EXPLANATION)
    measure_flow(tables, words.cells, words.rounds, beside)
    measure_threads(tables, (words.cells // 2, words.cells), words.rounds)
    for command in COMMANDS[: RUNS.index(words.runs)]:
        measure_command(tables, command, words.rounds, beside)
    tables.write()


if __name__ == "__main__":
    main()
