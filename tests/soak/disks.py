"""A disk that fills in the middle of a run, at a place by chance: a small file system in memory.

Making one needs root and Linux's tmpfs; elsewhere the bound is that of the system on one file's
length, which the same writes meet.
"""

from __future__ import annotations

import contextlib
import os
import resource
import shutil
import signal
import subprocess
from pathlib import Path

from soak.child import call
from soak.kills import finish, has_deck
from soak.small_runs import SMALL, TrialsOfRuns, list_words
from soak.trial import Outcome, find_fault, make_random, tell_last

ROOM = 16 << 20  # bytes of the small file system
PAGE = 4096
FULL = "no space left", "too large", "the run will need about"  # what a run says of a full disk


class Disks(TrialsOfRuns):
    """A run on a disk with room for a part of it, then with room enough."""

    name = "disks"
    wanted = 50
    weight = 0.7
    about = "a disk that fills during a run; then space is made and the run goes on"

    def attempt(self, number: int, folder: Path) -> Outcome:
        chance = make_random(self.name, self.seed, number)
        problem = list(SMALL)[number % len(SMALL)]
        whole = self.undisturbed.find(problem)
        with small_disk(folder / "disk") as mounted:
            path = folder / "disk" / "run"
            words = list_words(problem, path)
            before = None
            if mounted:
                free = chance.randint(0, measure_pages(whole) + 2) * PAGE
                fill_up(folder / "disk" / "filler", free)
            else:
                free = chance.randint(0, max(p.stat().st_size for p in whole.rglob("*.*")))

                def before():
                    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
                    resource.setrlimit(resource.RLIMIT_FSIZE, (free, free))

            done = call(words, folder, before=before)
            if fault := find_fault(done, (0, 2)):
                return Outcome(fault.label, True, f"{problem}, {free} bytes free: {fault.words}")
            if done.code == 0:
                return Outcome("room enough")
            if not any(word in done.err for word in FULL):
                return Outcome("another message", True, tell_last(done))
            if has_deck(path) and (fault := find_fault(call(["info", str(path)], folder), (0, 2))):
                return Outcome(f"info: {fault.label}", True, fault.words)
            (folder / "disk" / "filler").unlink(missing_ok=True)
            shutil.copytree(path, folder / "run") if path.exists() else None
            outcome = finish(problem, path, whole, folder)
            if outcome.defect:
                words = f"{problem}, {free} bytes free: {outcome.words}"
                return Outcome(outcome.label, True, words)
            return Outcome(f"a message; {outcome.label}")


def measure_pages(directory: Path) -> int:
    """How many pages the files of a directory fill."""
    return sum(-(-p.stat().st_size // PAGE) for p in directory.rglob("*") if p.is_file())


def fill_up(filler: Path, free: int) -> None:
    """Fill the disk that `filler` is on until `free` bytes are left."""
    state = os.statvfs(filler.parent)
    with open(filler, "wb") as file:
        os.posix_fallocate(file.fileno(), 0, max(1, state.f_bavail * state.f_frsize - free))


@contextlib.contextmanager
def small_disk(place: Path):
    """Mount a file system of ROOM bytes at `place` for a while; False where that is not allowed."""
    place.mkdir()
    words = ["mount", "-t", "tmpfs", "-o", f"size={ROOM}", "tmpfs", str(place)]
    try:
        mounted = subprocess.run(words, capture_output=True).returncode == 0
    except FileNotFoundError:
        mounted = False
    try:
        yield mounted
    finally:
        if mounted:
            subprocess.run(["umount", "--lazy", str(place)], check=True)
