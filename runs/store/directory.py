"""A run directory: what lies where, and who may write there.

docs/files.md lists the files of a run.
"""

from __future__ import annotations

import contextlib
import os
import re
import shlex
import time
from pathlib import Path

from regrid.errors import BadInput
from regrid.text_files import check_regular, escape_controls
from runs.store.checksum import PART_NAME, find_parts_by_name
from runs.store.files import (
    DUMPS,
    KEPT_NAMES,
    LOCK,
    disk_errors,
    get_part,
    replace_file,
    try_lock,
)

KEPT_RESTARTS = 2
STUDY_FILE = "study.toml"  # what a study is known by; its runs lie in its folder `runs`
_TEMPORARY = re.compile(r"\.(.+)\.part")
_NAME = re.compile(r"(dump|restart)_(\d+)\.h5")


class RunDirectory:
    """The paths of one run; reading and listing never writes."""

    def __init__(self, path: str | os.PathLike):
        self.path = Path(path)
        self.dumps_folder = self.path / DUMPS
        self.deck = self.path / "deck.toml"
        self.history = self.path / "history.csv"
        self.gauges = self.path / "gauges.csv"
        self.sidecar = self.path / "run.xmf"
        self.summary = self.path / "summary.txt"
        self.log = self.path / "run.log"
        self.verdict = self.path / "verdict.json"
        self.early_picture = self.path / "early-end.png"
        self.early_words = self.path / "early-end.txt"
        self.lock = self.path / LOCK
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
            parts = find_parts_by_name(path)
            path.unlink(missing_ok=True)  # first: then its parts are no restart point's
            for part in parts:
                part.unlink(missing_ok=True)

    def set_aside_after(self, step: int) -> int:
        """Move dumps of later steps into `superseded`; returns how many there were."""
        later = [path for number, path in self.list_points() if number > step]
        for path in later:
            self.set_aside(path)
        return len(later)

    def forget_early_end(self) -> None:
        """Remove what an early end has left, as the run continues."""
        for path in (self.early_picture, self.early_words):
            with disk_errors(path):
                path.unlink(missing_ok=True)

    def set_aside(self, path: Path) -> None:
        """Move a file of the run into `superseded`, in place of one of its name there.

        The parts of a dump go first: as long as its index stays, they are not taken for leftovers.
        """
        folder = self.path / "superseded"
        with disk_errors(folder):
            folder.mkdir(exist_ok=True)
            for one in (*find_parts_by_name(path), path):
                replace_file(one, folder / one.name)

    def note(self, text: str) -> None:
        """Append a line to run.log, with the time of day."""
        stamp = time.strftime("%Y-%m-%d %H:%M:%S")
        with disk_errors(self.log), open(self.log, "a", encoding="utf-8") as file:
            file.write(f"{stamp}  {escape_controls(text)}\n")

    @contextlib.contextmanager
    def claimed(self):
        """Hold the directory for one process; BadInput when another has it already.

        The lock is the system's, on a file that stays: it goes with its process, however that ends.
        """
        with disk_errors(self.lock):
            file = open(self.lock, "a", encoding="utf-8")
        with file:
            if not try_lock(file):
                raise BadInput(f"{self.path} is in use: another shockgrid runs there")
            for path in _find_leftovers(self):  # those of other commands are theirs
                with contextlib.suppress(OSError):
                    path.unlink()
            yield self


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
    parent, form = Path("out"), re.compile(rf"{re.escape(problem)}-(\d+)")
    with disk_errors(parent):
        parent.mkdir(exist_ok=True)
        taken = [int(m[1]) for path in parent.iterdir() if (m := form.fullmatch(path.name))]
        number = max(taken, default=0) + 1
        while True:  # another run may take the same number at the same moment
            directory = RunDirectory(parent / f"{problem}-{number}")
            try:
                directory.path.mkdir()
                break
            except FileExistsError:
                number += 1
        directory.dumps_folder.mkdir()
    return directory


def _remove_run(directory: RunDirectory) -> None:
    if not directory.deck.exists() and not _holds_beginning(directory):
        raise BadInput(
            f"{directory} holds no run (no deck.toml), so --force does not clear it; "
            "choose another directory with -o"
        )
    with directory.claimed(), disk_errors(directory.path):
        for _, path in directory.list_points():
            path.unlink()  # then its parts have no index, and are among the leftovers
        for path in _find_leftovers(directory):
            path.unlink()
        for name in KEPT_NAMES:
            (directory.path / name).unlink(missing_ok=True)


def _find_leftovers(directory: RunDirectory) -> list[Path]:
    """Files that a killed run was about to write, and parts of dumps without an index."""
    found = [part for name in KEPT_NAMES if (part := get_part(directory.path / name)).is_file()]
    if directory.dumps_folder.is_dir():
        for path in directory.dumps_folder.iterdir():
            temporary = _TEMPORARY.fullmatch(path.name)
            name = temporary[1] if temporary else path.name
            of_dump = PART_NAME.fullmatch(name)
            dump = path.with_name(f"{of_dump[1]}.h5" if of_dump else name)
            if _NAME.fullmatch(dump.name) and (temporary or not dump.exists()):
                found.append(path)
    return found


def _holds_beginning(directory: RunDirectory) -> bool:
    """Is this what a run leaves that was killed before its deck was written, and nothing else?"""
    dumps = directory.dumps_folder
    own = {dumps, directory.lock, get_part(directory.deck)}
    there = set(directory.path.iterdir())
    return dumps.is_dir() and there <= own and not any(dumps.iterdir())


def open_directory(path: str | os.PathLike) -> RunDirectory:
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
    if not directory.deck.exists() and _holds_beginning(directory):
        raise BadInput(
            f"{path} has no deck yet: a run is just starting there, or ended before a step; "
            f"if it ended, start it again: shockgrid run PROBLEM_OR_DECK -o {directory.quoted} "
            "--force"
        )
    if not directory.deck.exists():
        raise BadInput(f"{path} is not a run directory: it has no deck.toml")
    for file in (directory.deck, directory.history, directory.summary, directory.log):
        check_regular(file)
    return directory
