"""Small runs of five problems, which take a second, and their like that nothing disturbed."""

from __future__ import annotations

import shutil
from pathlib import Path

from shockgrid.runs.store.directory import RunDirectory
from shockgrid.runs.store.files import LOCK
from soak.child import Done, call, count_changes

OFTEN = ("output.dumps=4", "output.restart_every=0.02", "run.threads=1")
SMALL = {
    "interface-instability": ("cells=8", "kct_end=4"),
    "plate-on-wedge": ("cells=[24,4]", "run.max_steps=60"),
    "riemann": ("cells=32",),
    "heated-cavity": ("cells=16",),
    "conical-target": ("cells=16", "run.max_steps=40"),
}


def list_words(problem: str, directory: Path, *more: str) -> list[str]:
    """The command that runs a small problem in `directory`."""
    settings = [word for text in (*SMALL[problem], *OFTEN) for word in ("--set", text)]
    return ["run", problem, "-q", "-o", str(directory), *settings, *more]


class Undisturbed:
    """Runs to compare with, made when they are asked for."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.seconds: dict[str, float] = {}
        self.changes: dict[str, int] = {}

    def find(self, problem: str) -> Path:
        """The directory of the run of `problem` that nothing disturbed."""
        path = self.folder / problem
        if not path.exists():
            # in this process first: its kernels are then loaded in all copies
            warm = self.folder / f"{problem}-warm"
            done = call(list_words(problem, warm), self.folder, cpu=900)
            if done.code:
                raise SystemExit(f"soak: {problem} does not run: {done.err or done.out}")
            load_kernels(problem)
            shutil.rmtree(warm)
            self.changes[problem] = count_changes(list_words(problem, warm), self.folder, warm)
            done = call(list_words(problem, path), self.folder)
            self.seconds[problem] = done.seconds
        return path


def load_kernels(problem: str) -> None:
    """Take two steps of a small problem in this process."""
    from shockgrid.runs.deck.reading import read_deck

    evolution = read_deck(problem, (*SMALL[problem], "run.threads=1")).make_problem().build()
    for _ in range(2):
        evolution.advance()


def compare(one: Path, other: Path) -> Done:
    """`shockgrid compare` at its tolerance of zero."""
    return call(["compare", str(one), str(other)], one.parent)


def find_other_files(one: Path, other: Path) -> list[str]:
    """Dumps and gauges of two directories that differ in their bytes, by name."""
    found = []
    for step, path in RunDirectory(one).list_points("dump"):
        like = RunDirectory(other).dump_path(step)
        if not like.exists() or path.read_bytes() != like.read_bytes():
            found.append(path.name)
    gauges = [RunDirectory(path).gauges for path in (one, other)]
    texts = [path.read_bytes() if path.exists() else b"" for path in gauges]
    return found + ["gauges.csv"] * (texts[0] != texts[1])


def find_left_overs(directory: Path) -> list[str]:
    """Files of a directory that no run leaves: parts of files."""
    return sorted(p.name for p in directory.rglob(".*") if p.is_file() and p.name != LOCK)


class TrialsOfRuns:
    """What kinds of trials share that end in the bits of undisturbed runs."""

    def __init__(self, seed: int, undisturbed: Undisturbed):
        self.seed = seed
        self.undisturbed = undisturbed

    def prepare(self) -> None:
        """Make the runs to compare with."""
        for problem in SMALL:
            self.undisturbed.find(problem)
