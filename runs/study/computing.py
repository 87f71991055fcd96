"""One point of a study in its folder: computed from the start, continued, or complete already.

The folder alone determines what remains to be done.  `result.json` is written when a run has ended;
it holds the digest of the deck and the values of the table.  Without it a run of the same deck
continues from its last restart point.  A run of another deck is moved to `superseded` and the point
starts again.  A run that was stopped, or failed because of the disk, has no result; it continues
next time.
"""

from __future__ import annotations

import contextlib
import hashlib
import inspect
import itertools
import math
import os
import re
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from shockgrid.hydro.workers import count_processors
from shockgrid.problems.problem import Problem
from shockgrid.problems.problem_file import describe_mistake
from shockgrid.problems.registry import PROBLEMS
from shockgrid.regrid.errors import BadInput, RunFailure
from shockgrid.runs.deck.reading import ReadDeck, packaged_decks, read_deck, read_toml, to_toml
from shockgrid.runs.inspection.account import HEAD, describe_cautions
from shockgrid.runs.march.launching import continue_runner, start_runner
from shockgrid.runs.march.runner import Runner
from shockgrid.runs.store.directory import RunDirectory, read_run_deck
from shockgrid.runs.store.files import disk_errors, write_atomically
from shockgrid.runs.store.history import read_history
from shockgrid.runs.verify import CASES


def find_error_columns(problem: str, measured: Iterable[str] = ()) -> tuple[str, ...]:
    """Errors that `verify` checks for `problem`, and columns that begin with `error`."""

    def find_problem(deck: str) -> str:
        return deck if deck in PROBLEMS else str(read_toml(packaged_decks()[deck])["problem"])

    judged = (case.quantity for case in CASES if find_problem(case.deck) == problem)
    named = (name for name in measured if name.startswith("error"))
    return tuple(dict.fromkeys([*judged, *named]))


RESULT = "result.json"


class Result(msgspec.Struct, kw_only=True):
    """How a run ended, and its numbers, None if missing.

    failure: a sentence, "" if it succeeded; stopped: it is to continue later; values: by column, in
    the order of the table: for a result `x` also `x_theory` and `x_error`, then the problem's
    errors, then its measurements in the last row of the history; computed, errors: which of them
    are results and errors; cautions: the sentences of the summary on its reliability.
    """

    digest: str
    reason: str = ""
    failure: str = ""
    stopped: bool = False
    step: int = 0
    t: float = 0.0
    seconds: float = 0.0
    values: dict[str, float | None] = msgspec.field(default_factory=dict)
    computed: list[str] = msgspec.field(default_factory=list)
    errors: list[str] = msgspec.field(default_factory=list)
    units: dict[str, str] = msgspec.field(default_factory=dict)
    cautions: list[str] = msgspec.field(default_factory=list)

    def write(self, folder: Path) -> None:
        """Write the result into the folder of its point."""
        with disk_errors(folder):
            folder.mkdir(parents=True, exist_ok=True)
        write_atomically(folder / RESULT, msgspec.json.format(msgspec.json.encode(self), indent=1))


@dataclass(frozen=True)
class Work:
    """A point for a worker: the deck, its settings, the folder, and the number of threads.

    retry: recompute it if it failed; function: computes it from `values`, instead of a run of a
    deck.
    """

    source: str
    settings: tuple[str, ...]
    folder: Path
    threads: int | None = None
    retry: bool = False
    function: Callable[..., Mapping[str, float]] | None = None
    values: Mapping[str, Any] = field(default_factory=dict)

    @property
    def share(self) -> tuple[str, ...]:
        """The processors as a setting."""
        return () if self.threads is None else (f"run.threads={self.threads}",)


def compute_digest(deck: ReadDeck) -> str:
    """SHA-256 of the resolved deck and of the file that its problem is in, if it is in one.

    The number of threads is not part of it.
    """
    run = msgspec.structs.replace(deck.deck.run, threads=None)
    alone = msgspec.structs.replace(deck.deck, run=run)
    text = to_toml(deck.problem, alone) + (deck.file.digest if deck.file else "")
    return hashlib.sha256(text.encode()).hexdigest()


def compute_digest_of(work: Work) -> str:
    """`compute_digest` of a point's deck; of a function the digest of its text and values."""
    if work.function is None:
        return compute_digest(read_deck(work.source, work.settings))
    try:
        text = inspect.getsource(work.function)
    except (OSError, TypeError):
        text = work.source
    return hashlib.sha256(f"{text}\n{sorted(work.values.items())!r}".encode()).hexdigest()


def find_names(results: Sequence[Result | None]) -> tuple[list[str], list[str], list[str]]:
    """Names of the problem's results, of its errors and of its measurements, in their order."""
    known = [result for result in results if result is not None]
    computed = dict.fromkeys(name for result in known for name in result.computed)
    errors = dict.fromkeys(name for result in known for name in result.errors)
    names = dict.fromkeys(name for result in known for name in result.values)
    other_names = [
        n for n in names if n not in (*computed, *errors) and n.removesuffix("_theory") == n
    ]
    return list(computed), list(errors), other_names


def read_result(folder: Path, digest: str) -> Result | None:
    """The result in a folder if it is complete and of this deck, else None."""
    try:
        found = msgspec.json.decode((folder / RESULT).read_bytes(), type=Result)
    except (OSError, msgspec.DecodeError, RecursionError):
        return None
    return found if found.digest == digest else None


def find_state(folder: Path, digest: str) -> str:
    """State of a point in a folder: "done", "failed", "half", "other" (another deck) or "new"."""
    result = read_result(folder, digest)
    if result is not None:
        return "failed" if result.failure else "done"
    directory = RunDirectory(folder)
    if not directory.deck.exists():
        return "new"
    try:
        deck = read_run_deck(directory)
    except BadInput:  # of another version, or damaged
        return "other"
    if compute_digest(deck) != digest:
        return "other"
    return "half" if directory.list_points() else "new"


def compute_point(work: Work) -> Result:
    """The result of a point, computed as far as it does not exist yet.

    A physics failure is part of the result; BadInput is raised, also for mistakes in a user's file.
    """
    try:
        return _compute(work) if work.function is None else _call(work)
    except Exception as error:
        if not isinstance(error, BadInput) and (mistake := describe_mistake(error)):
            raise BadInput(mistake) from error
        raise


def _call(work: Work) -> Result:
    """The result of a user's function at a point; an exception is the point's failure."""
    assert work.function is not None
    begun = time.monotonic()
    result = Result(digest=compute_digest_of(work), reason="computed")
    try:
        found = work.function(**work.values)
        if not isinstance(found, Mapping):
            raise BadInput(f"{work.source} returned {found!r}; numbers by name are wanted (a dict)")
        result.values = {str(name): _number(value) for name, value in found.items()}
    except Exception as error:
        kind = "" if isinstance(error, BadInput | RunFailure) else f"{type(error).__name__}: "
        result.failure = result.reason = f"{kind}{error}"
    result.seconds = time.monotonic() - begun
    result.write(work.folder)
    return result


def _compute(work: Work) -> Result:
    deck = read_deck(work.source, work.settings)
    digest = compute_digest(deck)
    directory = RunDirectory(work.folder)
    known = read_result(work.folder, digest)
    if known is not None and not (known.failure and work.retry):
        return known
    state = find_state(work.folder, digest)
    share = work.share if deck.deck.run.threads is None else ()
    if state == "other":
        _set_aside(directory)
    with disk_errors(directory.path):
        (directory.path / RESULT).unlink(missing_ok=True)
    if state in ("half", "failed") and directory.list_points():
        runner = continue_runner(directory, share, True)
        if (result := _finish(runner, runner.resume, digest)) is not None:
            return result
    deck = read_deck(work.source, (*work.settings, *share))
    runner = start_runner(deck, str(work.folder), True, True, lambda text: None)
    result = _finish(runner, runner.start, digest)
    assert result is not None
    return result


def _finish(runner: Runner, call: Callable[[], Any], digest: str) -> Result | None:
    """Run to the end and write the result; None if no restart point can be used."""
    result = Result(digest=digest)
    try:
        ending = call()
        result.reason = ending.reason
        result.stopped = ending.exit_code >= 128
    except RunFailure as failure:
        result.failure = result.reason = re.split(
            "; last restart point is|; there is no restart point yet", str(failure)
        )[0]
    except BadInput as error:
        if call == runner.resume and runner.last_point is None and "is in use" not in str(error):
            return None
        raise
    problem = runner.problem
    evolution = runner.evolution
    history = read_history(runner.directory.history)
    result.step = evolution.step
    result.t = float(evolution.t)
    result.seconds = float(np.nansum(history.get("seconds_step", 0.0)))
    if not result.failure and len(history.get("t", ())):
        result.units = {n: u for n, u in problem.find_units().items() if n in problem.units}
        cautions = describe_cautions(problem, history)
        result.cautions = [sentence.removeprefix(HEAD) for sentence in cautions]
        fill_numbers(result, runner.deck.problem, problem, history, problem.measure(evolution))
    if not result.stopped:
        result.write(runner.directory.path)
    return result


def fill_numbers(
    result: Result,
    name: str,
    problem: Problem,
    history: Mapping[str, np.ndarray],
    measured: Iterable[str],
) -> None:
    """Fill in the numbers of the problem called `name` from a history; `measured`: its columns."""
    pairs = problem.results(history)
    values = result.values
    for key, (computed, theory) in pairs.items():
        error = (computed - theory) / (theory or 1.0)
        numbers = {"": computed, "_theory": theory, "_error": error}
        values |= {key + ending: _number(number) for ending, number in numbers.items()}
    errors = {key: _number(number) for key, number in problem.errors(history).items()}
    columns = {key: _last(history[key]) for key in measured if key in history}
    for key in find_error_columns(name, columns):
        if key not in errors and key in history:
            errors[key] = _last(history[key])
    for key, last in (*errors.items(), *columns.items()):
        values.setdefault(key, last)
    result.computed = list(pairs)
    result.errors = [*errors, *(f"{key}_error" for key in pairs)]


def _number(value: Any) -> float | None:
    return float(value) if math.isfinite(value) else None


def _last(column: np.ndarray) -> float | None:
    """The last finite number of a column."""
    known = column[np.isfinite(column)] if column.dtype.kind in "fi" else np.zeros(0)
    return float(known[-1]) if known.size else None


def _set_aside(directory: RunDirectory) -> None:
    """Move the run of another deck to the study's folder `superseded`; nothing is lost."""
    with directory.claimed(), disk_errors(directory.path):
        parent = directory.path.parent.parent / "superseded"
        parent.mkdir(exist_ok=True)
        names = (parent / f"{directory.path.name}-{number}" for number in itertools.count(1))
        os.replace(directory.path, next(place for place in names if not place.exists()))


def warm_up(work: Work) -> None:
    """One step of a point in memory: its kernels are then compiled for all workers."""
    problem = read_deck(work.source, (*work.settings, *work.share)).make_problem()
    with contextlib.suppress(BadInput, RunFailure):  # it is reported when the point is computed
        evolution = problem.build()
        if evolution.finished is None:
            evolution.advance()


def share_processors(workers: int) -> int | None:
    """Threads for each of so many workers; None: the default of a run."""
    return None if workers == 1 else max(1, count_processors() // workers)
