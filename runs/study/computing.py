"""One point of a study in its folder: computed from the start, continued, or complete already.

The folder alone determines what remains to be done.  `result.json` is written when a run has ended;
it holds the digest of the deck and the values of the table.  Without it a run of the same deck
continues from its last restart point.  A run of another deck is moved to `superseded` and the point
starts again.  A run that was stopped, or that the disk failed, has no result; it continues the next
time.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import inspect
import math
import os
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from hydro.workers import count_processors
from problems.problem_file import describe_mistake
from problems.registry import PROBLEMS
from regrid.errors import BadInput, RunFailure
from runs.deck.reading import ReadDeck, packaged_decks, read_deck, read_toml, to_toml
from runs.inspection.account import HEAD, describe_cautions
from runs.march.launching import continue_runner, start_runner
from runs.march.runner import Runner
from runs.store.directory import RunDirectory
from runs.store.files import disk_errors, write_atomically
from runs.store.guards import read_run_deck
from runs.store.history import read_history
from runs.verify import CASES, Case


@functools.cache
def _find_problem(deck: str) -> str:
    return deck if deck in PROBLEMS else str(read_toml(packaged_decks()[deck])["problem"])


def find_error_columns(problem: str, measured: Iterable[str] = ()) -> tuple[str, ...]:
    """Names of errors that `verify` has statements about for `problem`, columns among them.

    And those of `measured` that begin with `error`.
    """
    judged = (case.quantity for case in CASES if _find_problem(case.deck) == problem)
    named = (name for name in measured if name.startswith("error"))
    return tuple(dict.fromkeys([*judged, *named]))


def find_case(deck: str, settings: tuple[str, ...], quantity: str) -> Case | None:
    """The statement of `verify` on this quantity of this very deck, None where there is none."""
    for case in CASES:
        if (case.deck, case.quantity, set(case.settings)) == (deck, quantity, set(settings)):
            return case
    return None


RESULT = "result.json"


class Result(msgspec.Struct, kw_only=True):
    """How a run ended; None stands for a number that there is not.

    values: the problem's measurements in the last row of its history; computed, theory: the
    problem's results; errors: the problem's errors, and the computed results' relative to theory.
    failure: a sentence, "" where it ended well; stopped: it is to go on another time; cautions: the
    sentences of the summary on where not to trust it.
    """

    digest: str
    reason: str = ""
    failure: str = ""
    stopped: bool = False
    step: int = 0
    t: float = 0.0
    seconds: float = 0.0
    values: dict[str, float | None] = msgspec.field(default_factory=dict)
    computed: dict[str, float | None] = msgspec.field(default_factory=dict)
    theory: dict[str, float | None] = msgspec.field(default_factory=dict)
    errors: dict[str, float | None] = msgspec.field(default_factory=dict)
    units: dict[str, str] = msgspec.field(default_factory=dict)
    cautions: list[str] = msgspec.field(default_factory=list)


@dataclass(frozen=True)
class Work:
    """A point for a worker: the deck, its settings, the folder, and its share of processors.

    retry: compute it again where it has failed; function: computes it from `values`, instead of a
    run of a deck.
    """

    source: str
    settings: tuple[str, ...]
    folder: str
    threads: int | None = None
    retry: bool = False
    function: Callable[..., Mapping[str, float]] | None = None
    values: tuple[tuple[str, Any], ...] = ()


def compute_digest(deck: ReadDeck) -> str:
    """SHA-256 of the resolved deck and of the file that its problem is in, if it is in one.

    How many threads compute it is no part of it.
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
    return hashlib.sha256(f"{text}\n{sorted(work.values)!r}".encode()).hexdigest()


def find_names(results: Sequence[Result | None]) -> tuple[list[str], list[str], list[str]]:
    """Names of the problem's results, of its errors and of its measurements, in their order."""
    known = [result for result in results if result is not None]

    def gather(part: str) -> list[str]:
        return list(dict.fromkeys(name for result in known for name in getattr(result, part)))

    return gather("computed"), gather("errors"), gather("values")


def read_result(folder: str | Path, digest: str) -> Result | None:
    """The result in a folder if it is of this deck and whole, else None."""
    try:
        found = msgspec.json.decode(Path(folder, RESULT).read_bytes(), type=Result)
    except (OSError, msgspec.DecodeError, RecursionError):
        return None
    return found if found.digest == digest else None


def find_state(folder: str | Path, digest: str) -> str:
    """What a folder holds of a point: "done", "failed", "half", "other" (another deck) or "new"."""
    result = read_result(folder, digest)
    if result is not None:
        return "failed" if result.failure else "done"
    directory = RunDirectory(folder)
    if not directory.deck.exists():
        return "new"
    try:
        deck = read_run_deck(directory)
    except BadInput:  # of another version, or torn
        return "other"
    if compute_digest(deck) != digest:
        return "other"
    return "half" if directory.list_points() else "new"


def compute_point(work: Work) -> Result:
    """The result of a point, computed as far as it is not there yet.

    A physics failure is part of the result; BadInput is raised, also for a mistake in a file of
    one's own.
    """
    try:
        return _compute(work) if work.function is None else _call(work)
    except Exception as error:
        if not isinstance(error, BadInput) and (mistake := describe_mistake(error)):
            raise BadInput(mistake) from error
        raise


def _call(work: Work) -> Result:
    """What a function of one's own gives at a point; what it raises is the point's failure."""
    assert work.function is not None
    digest, begun = compute_digest_of(work), time.monotonic()
    result = Result(digest=digest, reason="computed")
    try:
        found = work.function(**dict(work.values))
        if not isinstance(found, Mapping):
            raise BadInput(f"{work.source} returned {found!r}; numbers by name are wanted (a dict)")
        result.values = {str(name): _number(value) for name, value in found.items()}
    except Exception as error:
        told = "" if isinstance(error, BadInput | RunFailure) else f"{type(error).__name__}: "
        result.failure = result.reason = f"{told}{error}"
    result.seconds = time.monotonic() - begun
    folder = Path(work.folder)
    with disk_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
    write_atomically(folder / RESULT, msgspec.json.format(msgspec.json.encode(result), indent=1))
    return result


def _compute(work: Work) -> Result:
    settings = work.settings
    deck = read_deck(work.source, settings)
    digest = compute_digest(deck)
    state = find_state(work.folder, digest)
    known = read_result(work.folder, digest)
    if known is not None and not (known.failure and work.retry):
        return known
    directory = RunDirectory(work.folder)
    if work.threads is not None and deck.deck.run.threads is None:
        settings = (*settings, f"run.threads={work.threads}")
    if state == "other":
        _set_aside(directory)
    with disk_errors(directory.path):
        (directory.path / RESULT).unlink(missing_ok=True)
    if state in ("half", "failed"):
        share = settings[len(work.settings) :]
        with contextlib.suppress(_Unusable):
            return _finish(_go_on(directory, share), digest)
    if not directory.deck.exists():
        _drop_empty(directory)
    runner = start_runner(
        read_deck(work.source, settings), work.folder, True, True, lambda text: None
    )
    return _finish((runner, runner.start), digest)


class _Unusable(Exception):
    """No restart point of a folder can be gone on from."""


def _go_on(directory: RunDirectory, settings: tuple[str, ...]):
    runner = continue_runner(directory, settings, True)
    if not directory.list_points():
        raise _Unusable
    return runner, runner.resume


def _finish(task, digest: str) -> Result:
    """Run to the end and write the result down."""
    runner, call = task
    resumed = call == runner.resume
    result = Result(digest=digest)
    try:
        ending = call()
        result.reason, result.stopped = ending.reason, ending.exit_code >= 128
    except RunFailure as failure:
        result.failure = result.reason = _cut(str(failure))
    except BadInput as error:
        if resumed and runner.last_point is None and "is in use" not in str(error):
            raise _Unusable from error  # it had not begun: a restart point that does not fit
        raise
    _read_numbers(result, runner)
    if not result.stopped:
        path = runner.directory.path / RESULT
        write_atomically(path, msgspec.json.format(msgspec.json.encode(result), indent=1))
    return result


def _cut(sentence: str) -> str:
    """A failure without the words on how to go on."""
    for words in ("; last restart point is", "; there is no restart point yet"):
        sentence = sentence.partition(words)[0]
    return sentence


def _read_numbers(result: Result, runner: Runner) -> None:
    """What the table takes from a run that has ended, well or not."""
    problem, evolution = runner.problem, runner.evolution
    history = read_history(runner.directory.history)
    result.step, result.t = evolution.step, float(evolution.t)
    if "seconds_step" in history:
        result.seconds = float(np.nansum(history["seconds_step"]))
    if result.failure or not len(history.get("t", ())):
        return
    result.units = dict(problem.units)
    told = describe_cautions(problem, history)
    result.cautions = [sentence.removeprefix(HEAD) for sentence in told]
    measured = problem.measure(evolution)
    result.values = {name: _last(history.get(name)) for name in measured}
    results = problem.results(history)
    result.computed = {name: _number(pair[0]) for name, pair in results.items()}
    result.theory = {name: _number(pair[1]) for name, pair in results.items()}
    errors = {name: _number(value) for name, value in problem.errors(history).items()}
    for name in find_error_columns(runner.deck.problem, measured):
        if name not in errors and name in history:
            errors[name] = _last(history[name])
            result.values.pop(name, None)
    for name, (computed, theory) in results.items():
        scale = theory if theory else 1.0
        errors[f"{name}_error"] = _number((computed - theory) / scale)
    result.errors = errors


def _number(value: Any) -> float | None:
    return float(value) if math.isfinite(value) else None


def _last(column: np.ndarray | None) -> float | None:
    """The last number of a column that is one."""
    if column is None or column.dtype.kind not in "fi":
        return None
    known = column[np.isfinite(column)]
    return float(known[-1]) if known.size else None


def _set_aside(directory: RunDirectory) -> None:
    """Move the run of another deck to the study's folder `superseded`; nothing is lost."""
    with directory.claimed(), disk_errors(directory.path):
        parent = directory.path.parent.parent / "superseded"
        parent.mkdir(exist_ok=True)
        number = 1
        while (parent / f"{directory.path.name}-{number}").exists():
            number += 1
        os.replace(directory.path, parent / f"{directory.path.name}-{number}")


def _drop_empty(directory: RunDirectory) -> None:
    """Remove what a run leaves that was killed before its deck was there: half of it, no dumps."""
    with contextlib.suppress(OSError):
        directory.lock.unlink(missing_ok=True)
        directory.problem_copy.unlink(missing_ok=True)
        directory.problem_note.unlink(missing_ok=True)
        for path in (directory.deck, directory.problem_copy, directory.problem_note):
            path.with_name(f".{path.name}.part").unlink(missing_ok=True)
        directory.dumps_folder.rmdir()


def warm_up(work: Work) -> None:
    """One step of a point in memory: its kernels are then compiled for all workers."""
    settings = work.settings
    if work.threads is not None:
        settings = (*settings, f"run.threads={work.threads}")
    problem = read_deck(work.source, settings).make_problem()
    with contextlib.suppress(BadInput, RunFailure):  # it is told where the point is computed
        evolution = problem.build()
        if evolution.finished is None:
            evolution.advance()


def share_processors(workers: int) -> int | None:
    """Threads for each of so many workers; None: as many as a run takes by itself."""
    return None if workers == 1 else max(1, count_processors() // workers)
