"""A run directory: what lies where, who may write there, and what does not fit together there.

docs/files.md lists the files of a run.  The log notes the digest of the deck at each start, and
those of summary and verdict at each end; a file that has none of the noted digests was edited or
damaged.  Of a deck the dumps are the judge: the log itself is guarded by nothing.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import shlex
import time
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from shockgrid.problems.problem_file import (
    ProblemFile,
    compute_digest,
    is_problem_file,
    read_problem_file,
)
from shockgrid.problems.registry import is_problem, load_problem
from shockgrid.regrid.errors import BadInput, find_nearest
from shockgrid.regrid.text_files import check_regular, escape_controls
from shockgrid.runs.deck.checking import find_changes, show
from shockgrid.runs.deck.reading import ReadDeck, read_toml, resolve_deck
from shockgrid.runs.store.dumps import open_dump
from shockgrid.runs.store.files import (
    DUMPS,
    KEPT_NAMES,
    LOCK,
    NoLocks,
    disk_errors,
    get_part,
    replace_file,
    try_lock,
    write_atomically,
)
from shockgrid.runs.store.provenance import NOTED_DIGITS, hash_deck

SHOWN_KEYS = 3  # changed keys
KEPT_RESTARTS = 2
STUDY_FILE = "study.toml"  # what a study is known by; its runs lie in its folder `runs`
_NAME = re.compile(r"(dump|restart)_(\d+)\.h5")
_TEMPORARY = re.compile(rf"\.{_NAME.pattern}\.part")


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

    def list_points(self, kind: str = "") -> list[tuple[int, Path]]:
        """Steps and paths of the dumps and restart points, or of those of one `kind`, by step."""
        there = self.dumps_folder.iterdir() if self.dumps_folder.is_dir() else ()
        named = [(match, path) for path in there if (match := _NAME.fullmatch(path.name))]
        return sorted((int(m[2]), path) for m, path in named if m[1].startswith(kind))

    def drop_old_restarts(self, keep: int = KEPT_RESTARTS) -> None:
        """Remove all but the newest restart files; dumps stay."""
        restarts = self.list_points("restart")
        for _, path in restarts[: max(0, len(restarts) - keep)]:
            path.unlink(missing_ok=True)

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
        """Move a file of the run into `superseded`, in place of one of its name there."""
        folder = self.path / "superseded"
        with disk_errors(folder):
            folder.mkdir(exist_ok=True)
            replace_file(path, folder / path.name)

    def note(self, text: str) -> None:
        """Append a line to run.log, with the time of day."""
        stamp = time.strftime("%Y-%m-%d %H:%M:%S")
        with disk_errors(self.log), open(self.log, "a", encoding="utf-8") as file:
            file.write(f"{stamp}  {escape_controls(text)}\n")

    @contextlib.contextmanager
    def claimed(self, caution: Callable[[str], None] = lambda text: None):
        """Hold the directory for one process; BadInput when another has it already.

        The lock is the system's, on a file that stays: it goes with its process, however that ends.
        `caution` is given a sentence where the file system has no locks: nothing is held then.
        """
        with disk_errors(self.lock):
            file = open(self.lock, "a", encoding="utf-8")
        with file:
            try:
                free = try_lock(file)
            except NoLocks as error:
                free = True
                caution(
                    f"the file system of {self.path} has no locks ({error}): nothing keeps another "
                    "shockgrid from writing there at the same time"
                )
            if not free:
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
            raise BadInput(
                f"the output directory {wanted} cannot be created; choose another with -o"
            ) from error
        inside = _list_inside(directory)
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
    form = re.compile(rf"{re.escape(problem)}-(\d+)")
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
    if not directory.deck.exists():
        raise BadInput(
            f"{directory} holds no run (no deck.toml), so --force does not clear it; "
            "choose another directory with -o"
        )
    with directory.claimed(), disk_errors(directory.path):
        for _, path in directory.list_points():
            path.unlink()
        for path in _find_leftovers(directory):
            path.unlink()
        for name in KEPT_NAMES:
            (directory.path / name).unlink(missing_ok=True)


def _find_leftovers(directory: RunDirectory) -> list[Path]:
    """Files that a killed run was about to write."""
    found = [part for name in KEPT_NAMES if (part := get_part(directory.path / name)).is_file()]
    if directory.dumps_folder.is_dir():
        found += [p for p in directory.dumps_folder.iterdir() if _TEMPORARY.fullmatch(p.name)]
    return found


def _list_inside(directory: RunDirectory) -> list[str]:
    """Names in a folder, but for what a run leaves that was killed before its deck was written."""
    own = {directory.lock, get_part(directory.deck)}
    if directory.dumps_folder.is_dir() and not any(directory.dumps_folder.iterdir()):
        own.add(directory.dumps_folder)
    return sorted(path.name for path in directory.path.iterdir() if path not in own)


def _list_runs(folder: Path) -> list[str]:
    """Paths of the run directories in a folder."""
    return sorted(str(deck.parent) for deck in folder.glob("*/deck.toml"))


def open_directory(path: str | os.PathLike) -> RunDirectory:
    """An existing run directory for reading; BadInput where there is none."""
    directory = RunDirectory(path)
    if not directory.path.exists():
        meant = find_nearest(str(directory.path), _list_runs(directory.path.parent))
        raise BadInput(f"{path} does not exist" + (f"; did you mean {meant}?" if meant else ""))
    if not directory.path.is_dir():
        raise BadInput(f"{path} is a file; a run directory is wanted")
    if not directory.deck.exists():
        explanation = "it has no deck.toml"
        if (directory.path / STUDY_FILE).exists():
            explanation = (
                f"its runs lie in {directory.path / 'runs'}; its table: shockgrid study {path}"
            )
        elif inside := _list_runs(directory.path):
            explanation += (
                "; there are runs in it: " + ", ".join(inside[:5]) + ", ..." * (len(inside) > 5)
            )
        elif not _list_inside(directory):
            explanation += (
                " yet: a run is just starting there, or ended before a step; if it ended, start it "
                f"again: shockgrid run PROBLEM_OR_DECK -o {directory.quoted}"
            )
        raise BadInput(f"{path} is not a run directory: {explanation}")
    for file in (directory.deck, directory.history, directory.summary, directory.log):
        check_regular(file)
    return directory


def write_noted(directory: RunDirectory, path: Path, text: str) -> None:
    """Write a file of the run whose digest the log notes first; see `is_noted`."""
    directory.note(f"{path.stem}: SHA-256 {hash_deck(text)[:NOTED_DIGITS]}")
    write_atomically(path, text)


def is_noted(directory: RunDirectory, path: Path) -> bool:
    """Has a file one of the digests that the log has noted of it?  True where it has none."""
    try:
        log = directory.log.read_text(encoding="utf-8", errors="replace")
        noted = re.findall(rf"\b{path.stem}: SHA-256 ([0-9a-f]{{{NOTED_DIGITS}}})", log)
        return not noted or hashlib.sha256(path.read_bytes()).hexdigest()[:NOTED_DIGITS] in noted
    except OSError:  # told of where it is read
        return True


def check_noted(directory: RunDirectory, path: Path) -> None:
    """Raise BadInput where a file is not as it was written."""
    if not is_noted(directory, path):
        raise BadInput(f"{path} is not as it was written: edited or damaged")


def check_deck(directory: RunDirectory) -> str:
    """Raise BadInput where deck.toml is neither the deck of a start nor that of the last dump.

    Key by key the dump is the judge, since its checksum guards it.  Returns a sentence where it
    says that the deck is right and the log knows it not; "" where all agree.
    """
    if is_noted(directory, directory.deck):
        return ""
    found = read_stored_deck(directory)
    differences = ""
    way = "no dump that can be read has it"
    if found is not None:
        text = directory.deck.read_text(encoding="utf-8", errors="replace")
        with contextlib.suppress(tomllib.TOMLDecodeError):
            changed = list(find_changes(tomllib.loads(found.text), tomllib.loads(text)))
            if not changed:
                return (
                    f"{directory.log} has no start with the digest of {directory.deck.name}, whose "
                    f"keys are those in {found.path.name}: the log was edited or damaged, the deck "
                    "is taken"
                )
            changes = [f"{one.key} is {show(one.now)}, was {show(one.before)}" for one in changed]
            more = [f"and {len(changes) - SHOWN_KEYS} more"] * (len(changes) > SHOWN_KEYS)
            differences = f" ({'; '.join(changes[:SHOWN_KEYS] + more)})"
        way = (
            f"the last dump has it: shockgrid info --deck {shlex.quote(str(found.path))} > "
            f"{shlex.quote(str(directory.deck))}"
        )
    raise BadInput(
        f"{directory.deck} is not as it was written{differences}; set it right ({way}), and change "
        "keys with restart --set, or with --set in a new run"
    )


class StoredDeck(NamedTuple):
    """The deck in a dump: its text, the file it is from, the end time [s] of the run then."""

    text: str
    path: Path
    t_end: float


def read_stored_deck(directory: RunDirectory, at: int | None = None) -> StoredDeck | None:
    """The deck of the last dump that can be read, or of step `at`; None where there is none."""
    for step, path in reversed(directory.list_points()):
        if at in (None, step):
            with contextlib.suppress(BadInput, KeyError, OSError):  # told where its state is read
                with open_dump(path) as file:
                    return StoredDeck(str(file.attrs["deck"]), path, float(file.attrs["t_end"]))
    return None


def keep_problem_file(directory: RunDirectory, file: ProblemFile) -> None:
    """Copy a problem's file into the directory of its run, with its place and digest."""
    if file.path.resolve() == directory.problem_copy.resolve():
        return  # a run that goes on with its copy
    note = {"file": str(file.path.resolve()), "sha256": file.digest}
    write_atomically(directory.problem_note, json.dumps(note, indent=1) + "\n")
    write_atomically(directory.problem_copy, file.text)


def read_run_deck(
    directory: RunDirectory,
    settings: tuple[str, ...] = (),
    strict: bool = False,
    say: Callable[[str], None] = lambda text: None,
) -> ReadDeck:
    """The checked deck of a run, `settings` laid over it.

    strict: for going on; raises BadInput where the problem's file is no longer as it was.  say: is
    then given what is wrong with the log alone.  Raises BadInput, too, for a deck or a
    kept file that cannot be read.
    """
    if strict and (fault := check_deck(directory)):
        say(fault)
    table = read_toml(directory.deck)
    file = None
    if is_problem_file(table.get("problem")):
        file = _read_kept(directory, strict)
    elif is_problem(table.get("problem")):
        table = {**load_problem(table["problem"]).Deck.absent, **table}
    return resolve_deck(table, str(directory.deck), settings, file)


def _read_kept(directory: RunDirectory, strict: bool) -> ProblemFile:
    """The file of the problem of a run: where it was, if it is as it was, else the copy."""
    try:
        note = json.loads(directory.problem_note.read_text(encoding="utf-8"))
        place = Path(note["file"])
        digest = str(note["sha256"])
        copy = compute_digest(directory.problem_copy.read_bytes())
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise BadInput(
            f"{directory}: {directory.problem_copy.name} or {directory.problem_note.name}, which "
            "store the file of its problem, is missing or damaged; start it again: shockgrid run "
            f"PROBLEM_FILE -o {directory.quoted} --force"
        ) from error
    if copy != digest:
        raise BadInput(
            f"{directory.problem_copy} has changed since the run started; it was the copy of the "
            "file of the problem, which is lost"
        )
    if place.is_file() and compute_digest(place.read_bytes()) == digest:
        return read_problem_file(place)
    if strict and place.is_file():
        raise BadInput(
            f"{place} has changed since the run in {directory} started, and a run continues only "
            f"with the same file: restore it from {directory.problem_copy}, or start a new run"
        )
    return read_problem_file(directory.problem_copy, name=place.name, beside=place.parent)


def write_verdict(directory: RunDirectory, verdict: dict[str, Any]) -> None:
    """Write a verdict; numbers that are not finite become null, which JSON has."""
    plain = msgspec.json.encode(verdict, enc_hook=lambda value: value.item())
    text = msgspec.json.format(plain, indent=1).decode("utf-8")
    write_noted(directory, directory.verdict, text + "\n")


def read_verdict(directory: RunDirectory) -> dict[str, Any] | None:
    """The verdict of a run; None where it has not ended, or was ended by force.

    Raises BadInput for a file that is not as it was written.
    """
    path = directory.verdict
    if not path.exists():
        return None
    check_noted(directory, path)
    try:
        return dict(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError, RecursionError) as error:
        raise BadInput(f"{path} is damaged: it cannot be read") from error
