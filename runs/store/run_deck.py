"""The deck of a run directory with its problem, which may be in a file of one's own.

Of such a file a copy is kept, with its digest and where it was.  To look at a run the copy is as
good as the file; a run goes on only with the file as it was, or with the copy where the file is
gone.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from problems.problem_file import ProblemFile, compute_digest, is_problem_file, read_problem_file
from problems.registry import is_problem, load_problem
from regrid.errors import BadInput
from runs.deck.reading import ReadDeck, read_toml, resolve_deck
from runs.store.directory import RunDirectory
from runs.store.files import write_atomically
from runs.store.guards import check_deck


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
    then told what is wrong with the log alone.  Raises BadInput, too, for a deck or a
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
        place, digest = Path(note["file"]), str(note["sha256"])
        copy = compute_digest(directory.problem_copy.read_bytes())
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise BadInput(
            f"{directory}: {directory.problem_copy.name} or {directory.problem_note.name}, which "
            "keep the file of its problem, is missing or damaged"
        ) from error
    if copy != digest:
        raise BadInput(
            f"{directory.problem_copy} has changed since the run began; what it keeps is the file "
            "of the problem as it was, which is lost"
        )
    if place.is_file() and compute_digest(place.read_bytes()) == digest:
        return read_problem_file(place)
    if strict and place.is_file():
        raise BadInput(
            f"{place} has changed since the run in {directory} began, and a run goes on with the "
            f"same file only: bring it back from {directory.problem_copy}, or begin a new run"
        )
    return read_problem_file(directory.problem_copy, name=place.name, beside=place.parent)
