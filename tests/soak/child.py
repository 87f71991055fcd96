"""A command in a forked copy of this process, which has all imports and kernels loaded already.

The copy may be killed: after a time, or just before its n-th change of files below a folder, which
is the same moment whenever it is tried again.  What it may use of processor time is bounded by the
system; past that its stack is in what it said.  Note: a copy of a process with threads may
stand still for ever, so that all commands here run with one.
"""

from __future__ import annotations

import faulthandler
import importlib
import os
import resource
import select
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shockgrid.runs.cli.main import main

CHANGES = {"open", "os.rename", "os.remove", "os.mkdir"}  # audit events of Python
SLACK = 20.0  # a loaded machine gives so little of its time at worst
CRASHED = 71
COMMANDS = (
    "shockgrid.runs.inspection.compare", "shockgrid.runs.inspection.compare",
    "shockgrid.runs.inspection.info", "shockgrid.runs.inspection.info",
    "shockgrid.runs.march.launching", "shockgrid.runs.march.launching",
    "shockgrid.runs.march.launching", "shockgrid.runs.store.reader",
)  # fmt: skip


@dataclass(frozen=True)
class Done:
    """How a command ended.  code: minus the signal where one ended it; seconds: wall time."""

    code: int
    out: str
    err: str
    seconds: float
    stuck: bool = False
    killed: bool = False


class Call:
    """A command that has begun; `wait` gives how it ended."""

    def __init__(
        self,
        words: Sequence[str],
        folder: Path,
        cpu: int = 60,
        kill_at: tuple[Path, int] | None = None,
        before: Callable[[], Any] | None = None,
        memory: int | None = None,
    ):
        """Begin `shockgrid *words` in `folder`.

        cpu: bound of its processor time [s]; kill_at: a folder and the number of the change below
        it at which to end (from 1); before: called in the copy first, to spoil its clocks or disk;
        memory: bound of its addresses [GiB].
        """
        self.cpu = cpu
        self.memory = memory
        self._files = tempfile.TemporaryFile(), tempfile.TemporaryFile()
        self._end, theirs = os.pipe()
        sys.stdout.flush()
        sys.stderr.flush()
        self._began = time.monotonic()
        self.pid = os.fork()
        if not self.pid:
            os.close(self._end)
            self._be_child(words, folder, kill_at, before)
        os.close(theirs)

    def _be_child(self, words, folder, kill_at, before) -> None:
        code = CRASHED
        try:
            for number, file in enumerate(self._files, start=1):
                os.dup2(file.fileno(), number)
            sys.stdout = open(1, "w", encoding="utf-8", closefd=False)
            sys.stderr = open(2, "w", encoding="utf-8", closefd=False)
            faulthandler.register(signal.SIGPROF, file=2, all_threads=False, chain=False)
            signal.setitimer(signal.ITIMER_PROF, self.cpu)
            resource.setrlimit(resource.RLIMIT_CPU, (self.cpu + 1, self.cpu + 2))
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            if self.memory:
                resource.setrlimit(resource.RLIMIT_AS, (self.memory << 30, self.memory << 30))
            os.chdir(folder)
            if before:
                before()
            if kill_at:
                _kill_self_at(*kill_at)
            code = main(list(words))
            sys.stdout.flush()
        except BaseException:
            traceback.print_exc()
        finally:
            try:
                sys.stderr.flush()
            finally:
                os._exit(code)

    def wait(self, kill_after: float | None = None) -> Done:
        """How it ended; killed after so many seconds where it has not by then."""
        limit = self.cpu * SLACK
        wanted = limit if kill_after is None else min(kill_after, limit)
        left = max(0.0, self._began + wanted - time.monotonic())
        ended = bool(select.select([self._end], [], [], left)[0])
        if not ended:
            os.kill(self.pid, signal.SIGKILL)
        _, status = os.waitpid(self.pid, 0)
        seconds = time.monotonic() - self._began
        os.close(self._end)
        code = os.waitstatus_to_exitcode(status)
        out, err = (self._read(file) for file in self._files)
        stuck = code == -signal.SIGXCPU or (not ended and kill_after is None)
        return Done(code, out, err, seconds, stuck, not stuck and code == -signal.SIGKILL)

    @staticmethod
    def _read(file) -> str:
        file.seek(0)
        text = file.read().decode("utf-8", "replace")
        file.close()
        return text


def call(words: Sequence[str], folder: Path, **options) -> Done:
    """Run a command to its end; `options` are those of `Call`."""
    return Call(words, folder, **options).wait()


def import_commands() -> None:
    """Import here what the copies would import each for itself: the modules of the commands."""
    for name in COMMANDS:
        importlib.import_module(name)


def _kill_self_at(folder: Path, number: int) -> None:
    """Be killed just before change `number` of files below `folder`."""
    below = str(folder)
    count = 0

    def watch(event: str, details: tuple) -> None:
        nonlocal count
        if event in CHANGES and str(details[0]).startswith(below):
            count += 1
            if count == number:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(watch)


def count_changes(words: Sequence[str], folder: Path, below: Path) -> int:
    """How many changes of files below a folder a command makes, to its end."""
    note = tempfile.TemporaryFile()

    def before() -> None:
        count = 0

        def watch(event: str, details: tuple) -> None:
            nonlocal count
            if event in CHANGES and str(details[0]).startswith(str(below)):
                count += 1
                os.pwrite(note.fileno(), f"{count:12d}".encode(), 0)

        sys.addaudithook(watch)

    call(words, folder, before=before)
    with note:
        note.seek(0)
        return int(note.read() or 0)
