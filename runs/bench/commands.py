"""Whole commands as a user gives them, in a process of their own: start, steps, dumps, screen."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from regrid.errors import BadInput
from runs.bench.child_time import read_child_time
from runs.bench.peer import Peer
from runs.bench.rounds import compare_speeds
from runs.bench.tables import Tables
from runs.store.reader import RunData

PARTS = ("sides", "regrid", "flow")
# which commands each choice of `--runs` measures
RUNS: dict[str, tuple[tuple[str, ...], ...]] = {
    "none": (),
    "default": (("interface-instability",),),
    "long": (("interface-instability",), ("interface-instability-mushroom",)),
    "large": (
        ("interface-instability",),
        ("interface-instability-mushroom",),
        ("interface-instability", "--set", "cells=256"),
    ),
}


def measure_command(tables: Tables, words: tuple[str, ...], rounds: int, peer: Peer | None) -> None:
    """Table `commands`: `shockgrid run WORDS`, warm; the first of its runs is not counted."""
    speeds, others, seconds, walls = [], [], [], []
    with tempfile.TemporaryDirectory() as folder:
        output = str(Path(folder) / "run")
        program = [sys.executable, "-m", "shockgrid", "run", *words, "-q", "--force", "-o", output]
        for number in range(rounds + 1):
            before, begin = read_child_time(), time.perf_counter()
            done = subprocess.run(program, capture_output=True, text=True)
            after, end = read_child_time(), time.perf_counter()
            if done.returncode:
                raise BadInput(f"{' '.join(words)}: {done.stderr.strip()}")
            run = RunData(output)
            steps = run.dumps[-1].step
            cells = sum(np.prod(np.array(b.nodes.shape[1:]) - 1) for b in run.dumps[-1].blocks)
            if number == 0:
                continue
            used = after.user - before.user + after.system - before.system
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
