"""`shockgrid study`: from its arguments to the summary."""

from __future__ import annotations

import contextlib
import re
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from shockgrid.regrid.errors import BadInput
from shockgrid.runs.deck.reading import parse_value
from shockgrid.runs.quantities import count
from shockgrid.runs.signals import (
    STOPPING,
    find_numbers,
    is_hang_up,
    leave_terminals,
    list_terminals,
)
from shockgrid.runs.study.computing import Result
from shockgrid.runs.study.definition import NUMBER, check_same_deck, read_vary
from shockgrid.runs.study.orders import describe_series
from shockgrid.runs.study.study import Study, make_study

EXIT_FAILED = 3
MOST_CAUTIONS = 10  # on the screen
STATES = {"done": "done", "failed": "failed", "half": "half done", "other": "of another deck"}


@dataclass(frozen=True)
class Request:
    """Arguments of the command; their meanings are those of its options in `runs.cli.main`."""

    source: str
    vary: Sequence[str]
    settings: Sequence[str]
    output: str | None
    jobs: int | None
    engine: str
    shown: Sequence[str]
    refine: str | None
    retry: bool
    dry_run: bool
    quiet: bool


def study(request: Request, say: Callable[[str], None], note: Callable[[str], None]) -> int:
    """Compute a study and print the results (`say`; progress goes to `note`).

    The exit code is 0 if all runs reached their end, 3 if some failed, 130 or 143 after a signal.
    """
    varied, fixed = read_words(request.vary, request.settings)
    names = [name for entry in request.shown for name in entry.split(",") if name]
    made = make_study(
        request.source, varied, request.output or "", (), fixed, names, request.refine
    )
    began = time.monotonic()
    if request.dry_run:
        made.check()
        check_same_deck(made.path, made.definition)
        say(describe_plan(made))
        return 0
    progress = Progress(made, request.quiet, note)
    with terminate_softly() as caught:
        try:
            if not made.run(request.engine, request.jobs, progress.tell, request.retry):
                return 0  # an MPI rank that only computes
        except KeyboardInterrupt as stop:  # by now all workers have stopped
            left = count(made.results.count(None), "run")
            note(f"stopped with {left} to do; repeat the command to continue")
            reported = [number for number in find_numbers(*STOPPING) if _name(number) in str(stop)]
            return (
                128 + [signal.SIGINT, *reported, *caught][-1]
            )  # `told`: signals that runs reported
        finally:
            progress.close()
    paths = made.write(note)
    if not request.quiet:
        say(describe_study(made, progress, time.monotonic() - began))
        say("written: " + "  ".join(str(path) for path in paths))
    return EXIT_FAILED if made.failures else 0


def read_words(
    vary: Sequence[str], settings: Sequence[str]
) -> tuple[dict[str, list[Any]], dict[str, Any]]:
    """Values by key from the arguments of --vary and --set; BadInput for wrong ones."""
    varied: dict[str, list[Any]] = {}
    for key, values in map(read_vary, vary):
        if key in varied:
            raise BadInput(f"--vary {key} is given twice; give all its values in one list")
        varied[key] = values
    fixed = {}
    for setting in settings:
        key, equals, text = setting.partition("=")
        if not equals or not key.strip():
            raise BadInput(f"--set {setting!r}: the form is key=value, such as cells=32")
        fixed[key.strip()] = parse_value(text)
    return varied, fixed


def describe_plan(study: Study) -> str:
    """What would be computed, one line per point."""
    points = study.definition.points
    source = study.definition.source
    lines = [f"{count(len(points), 'run')} of {source} in {study.path}/runs"]
    for point, state in zip(points, study.describe_states(), strict=True):
        state_name = "to do" if state == "new" else STATES.get(state, state)
        lines.append(f"  {point.name}: {state_name}")
    return "\n".join([*lines, "nothing was run"])


class Progress:
    """Progress of a study: a bar in a terminal, a line per run elsewhere, failures always."""

    def __init__(self, study: Study, quiet: bool, note: Callable[[str], None]):
        self.study = study
        self.quiet = quiet
        self.note = note
        self.there = self.done = self.failed = self.ended = 0
        self.bar: Any = None

    def tell(self, number: int, result: Result, there: bool) -> None:
        """Record a run that has ended or already existed."""
        points = self.study.definition.points
        if self.bar is None and not self.quiet and sys.stderr.isatty():
            from tqdm import tqdm

            self.bar = tqdm(total=len(points), unit="run", dynamic_ncols=True, smoothing=0.0)
        self.there += there
        self.done += not there and bool(result.digest)  # without one it could not start
        self.ended += 1
        self.failed += bool(result.failure)
        name = points[number].name
        if result.failure:
            self._say(f"{name}: failed: {result.failure}")
        elif self.bar is None and not there:
            seconds = f"{result.seconds:.1f} s"
            self._say(f"{self.ended}/{len(points)} {name}: {result.reason}, {seconds}")
        if self.bar is not None:
            self.bar.initial += there  # not counted for the speed
            self.bar.update(1)
            self.bar.set_postfix_str(f"{self.failed} failed" if self.failed else "")

    def _say(self, text: str) -> None:
        if self.bar is not None:
            self.bar.write(text, file=sys.stderr)
        elif not self.quiet:
            self.note(text)

    def close(self) -> None:
        """Stop updating the bar."""
        if self.bar is not None:
            self.bar.close()


@contextlib.contextmanager
def terminate_softly() -> Iterator[list[int]]:
    """Turn signals that end a run into KeyboardInterrupt; the list holds their numbers."""
    caught: list[int] = []
    terminals = list_terminals()

    def stop(number, frame):
        caught.append(number)
        if is_hang_up(number):
            leave_terminals(terminals)
        raise KeyboardInterrupt

    numbers = find_numbers(*STOPPING)
    before = {number: signal.signal(number, stop) for number in numbers}
    try:
        yield caught
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _name(number: int) -> str:
    return signal.Signals(number).name


def describe_study(study: Study, progress: Progress, seconds: float) -> str:
    """The summary: number of runs, their results, orders, failures."""
    runs = len(study.results)
    lines = [
        f"{count(runs, 'run')}: {progress.done} computed now, {progress.there} there already, "
        f"{progress.failed} failed; {seconds:.1f} s"
    ]
    lines += ["", *study.make_rows()]
    if study.orders:
        names = [*study.shown, *(name.removesuffix("_error") for name in study.shown)]
        lines += ["", f"orders over {study.refined_key}:", *describe_series(study.orders, names)]
    lines += describe_cautions(study)
    if study.failures:
        lines += ["", "failed:"]
        lines += [f"  {name}: {reason}" for name, reason in study.failures.items()]
    return "\n".join([*lines, ""])


def describe_cautions(study: Study) -> list[str]:
    """How many runs are unreliable, and why; sentences that differ only in numbers appear once."""
    cautions = study.cautions
    if not cautions:
        return []
    alike: dict[str, dict[str, str]] = {}  # the last such sentence of each run
    for name, sentence in ((name, one) for name, several in cautions.items() for one in several):
        alike.setdefault(re.sub(NUMBER, "#", sentence), {})[name] = sentence
    lines = ["", f"caution: {len(cautions)} of {count(len(study.results), 'run')}"]
    for sentences in [list(runs.values()) for runs in alike.values()][:MOST_CAUTIONS]:
        ending = ", such as" if len(set(sentences)) > 1 else ""
        lines.append(f"  in {count(len(sentences), 'run')}{ending}: {sentences[0]}")
    more = len(alike) - MOST_CAUTIONS
    return [*lines, f"  ... and {more} more in {study.path}/study.csv"] if more > 0 else lines
