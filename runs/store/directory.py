"""A run directory: what lies where, and who may write there.

Files of a run:

    deck.toml      the resolved deck
    history.csv    one row a step
    gauges.csv     one row a step of the deck's gauges, where it has some
    dumps/         dump_000123.h5: pictures and restart points, evenly over the run;
                   restart_000120.h5: restart points by wall time
    run.xmf        all dumps, for ParaView
    summary.txt    the closing screen
    run.log        what was done here, and when
    verdict.json   how it ended, and what limits trust in it
    problem.py     the file of a problem of one's own as it was, and problem.json: whence, digest
"""

from __future__ import annotations

import contextlib
import os
import re
import shlex
import time
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

from regrid.errors import BadInput
from runs.store.files import disk_errors

KEPT_RESTARTS = 2
STUDY_FILE = "study.toml"  # what a study is known by; its runs lie in its folder `runs`
_NAME = re.compile(r"(dump|restart)_(\d+)\.h5")


class RunDirectory:
    """The paths of one run; reading and listing never writes."""

    def __init__(self, path: Path | str):
        self.path = Path(path)
        self.dumps_folder = self.path / "dumps"
        self.deck = self.path / "deck.toml"
        self.history = self.path / "history.csv"
        self.gauges = self.path / "gauges.csv"
        self.sidecar = self.path / "run.xmf"
        self.summary = self.path / "summary.txt"
        self.log = self.path / "run.log"
        self.verdict = self.path / "verdict.json"
        self.lock = self.path / ".running"
        self.problem_copy = self.path / "problem.py"
        self.problem_note = self.path / "problem.json"

    def __str__(self) -> str:
        return str(self.path)

    @property
    def quoted(self) -> str:
        """The path as a shell takes it, for commands shown to a person."""
        return shlex.quote(str(self.path))

    def dump_path(self, step: int) -> Path:
        return self.dumps_folder / f"dump_{step:06d}.h5"

    def restart_path(self, step: int) -> Path:
        return self.dumps_folder / f"restart_{step:06d}.h5"

    def list_files(self, kind: str = "dump") -> list[tuple[int, Path]]:
        """Steps and paths of the dumps (or the "restart" files), by step."""
        return [entry for entry in self.list_points() if entry[1].name.startswith(kind)]

    def list_points(self) -> list[tuple[int, Path]]:
        """Everything to restart from, by step."""
        if not self.dumps_folder.is_dir():
            return []
        found = []
        for path in self.dumps_folder.iterdir():
            match = _NAME.fullmatch(path.name)
            if match:
                found.append((int(match[2]), path))
        return sorted(found)

    def drop_old_restarts(self, keep: int = KEPT_RESTARTS) -> None:
        """Remove all but the newest restart files; dumps stay."""
        restarts = self.list_files("restart")
        for _, path in restarts[: max(0, len(restarts) - keep)]:
            path.unlink(missing_ok=True)

    def set_aside_after(self, step: int) -> int:
        """Move dumps of later steps into `superseded`; returns how many there were."""
        later = [path for number, path in self.list_points() if number > step]
        if later:
            folder = self.path / "superseded"
            with disk_errors(folder):
                folder.mkdir(exist_ok=True)
                for path in later:
                    os.replace(path, folder / path.name)
        return len(later)

    def note(self, text: str) -> None:
        """Append a line to run.log, with the time of day."""
        stamp = time.strftime("%Y-%m-%d %H:%M:%S")
        with disk_errors(self.log), open(self.log, "a", encoding="utf-8") as file:
            file.write(f"{stamp}  {text}\n")

    @contextlib.contextmanager
    def claimed(self):
        """Hold the directory for one process; BadInput when another has it already.

        The lock is the system's: it goes with its process, however that ends.
        """
        in_use = BadInput(f"{self.path} is in use: another shockgrid runs there")
        with disk_errors(self.lock):
            file = open(self.lock, "a", encoding="utf-8")
        with file:
            try:
                if fcntl is not None:
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise in_use from None
            if not _is_at(file.fileno(), self.lock):  # who had it ended meanwhile and removed it
                raise in_use
            try:
                yield self
            finally:
                with contextlib.suppress(OSError):
                    self.lock.unlink(missing_ok=True)


def _is_at(descriptor: int, path: Path) -> bool:
    """Is an open file still the one that lies at a path?"""
    try:
        return os.path.samestat(os.fstat(descriptor), os.stat(path))
    except FileNotFoundError:
        return False


def create_directory(wanted: str | None, problem: str, force: bool = False) -> RunDirectory:
    """A fresh run directory: `wanted`, or out/<problem>-<next free number>.

    A directory that holds anything is refused unless `force`, which removes an old run's files
    (and nothing else) from it.
    """
    if wanted is None:
        return _next_free(problem)
    directory = RunDirectory(wanted)
    if not wanted:
        raise BadInput("-o: the output directory needs a name")
    if directory.path.exists() and not directory.path.is_dir():
        raise BadInput(f"{wanted} is a file, a run needs a folder; choose another with -o")
    with disk_errors(directory.path):
        try:
            directory.path.mkdir(parents=True, exist_ok=True)
        except FileNotFoundError as error:  # such as /proc, where no folders are made
            words = f"the output directory {wanted} cannot be created; choose another with -o"
            raise BadInput(words) from error
        inside = sorted(path.name for path in directory.path.iterdir())
    if inside and not force:
        shown = ", ".join(inside[:4]) + (", ..." if len(inside) > 4 else "")
        raise BadInput(
            f"the output directory {wanted} is not empty ({shown}); choose another with -o, "
            "or --force to replace the run in it"
        )
    if inside:
        _remove_run(directory)
    with disk_errors(directory.dumps_folder):
        directory.dumps_folder.mkdir(exist_ok=True)
    return directory


def _next_free(problem: str) -> RunDirectory:
    parent = Path("out")
    with disk_errors(parent):
        parent.mkdir(exist_ok=True)
        taken = [
            int(path.name.rpartition("-")[2])
            for path in parent.glob(f"{problem}-*")
            if path.name.rpartition("-")[0] == problem and path.name.rpartition("-")[2].isdigit()
        ]
        number = max(taken, default=0) + 1
        while True:  # another run may take the same number at the same moment
            path = parent / f"{problem}-{number}"
            try:
                path.mkdir()
                break
            except FileExistsError:
                number += 1
        directory = RunDirectory(path)
        directory.dumps_folder.mkdir()
    return directory


def _remove_run(directory: RunDirectory) -> None:
    if not directory.deck.exists() and directory.path.exists():
        raise BadInput(
            f"{directory} holds no run (no deck.toml), so --force does not clear it; "
            "choose another directory with -o"
        )
    with directory.claimed(), disk_errors(directory.path):
        for _, path in directory.list_points():
            path.unlink()
        for path in (
            directory.history,
            directory.gauges,
            directory.sidecar,
            directory.summary,
            directory.log,
            directory.verdict,
            directory.deck,
            directory.problem_copy,
            directory.problem_note,
        ):
            path.unlink(missing_ok=True)


def open_directory(path: str | Path) -> RunDirectory:
    """An existing run directory for reading; BadInput where there is none."""
    directory = RunDirectory(path)
    if not directory.path.exists():
        raise BadInput(f"{path} does not exist")
    if not directory.path.is_dir():
        raise BadInput(f"{path} is a file; a run directory is wanted")
    if not directory.deck.exists() and (directory.path / STUDY_FILE).exists():
        raise BadInput(
            f"{path} is a study, no run: its runs lie in {directory.path / 'runs'}; its table: "
            f"shockgrid study {directory.quoted}"
        )
    if not directory.deck.exists():
        raise BadInput(f"{path} is no run directory: it has no deck.toml")
    return directory
