"""Running: the loop over steps, dumps, restart points, the history, and how a run may end.

A run ends in one of five ways: finished (exit 0, or 3 where it has not reached what it is for),
at its limit of wall time (a restart point is written, exit code 0), stopped by a signal (the same,
exit code 128 and the signal's number), failed in its physics (exit 3), or out of disk (exit 2).  In
each the directory can be read and continued.  SIGUSR1 writes a restart point, and the run
continues.  Dumps fall on the first step past their time and never change dt.
"""

from __future__ import annotations

import contextlib
import math
import os
import platform
import re
import signal
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from shockgrid.hydro.history import compute_chosen_columns
from shockgrid.problems.column_groups import find_columns
from shockgrid.problems.deck import Output
from shockgrid.problems.evolution import Evolution, get_missed, get_start_row
from shockgrid.problems.problem import Problem
from shockgrid.regrid.compilation.first_calls import read_clock
from shockgrid.regrid.errors import BadInput, RunFailure
from shockgrid.regrid.text_files import escape_controls
from shockgrid.runs.deck.reading import ReadDeck
from shockgrid.runs.early_end.causes import ENDS
from shockgrid.runs.gauges import Gauges
from shockgrid.runs.inspection import account
from shockgrid.runs.march.compiling import compiling
from shockgrid.runs.march.progress import (
    REMAPPED,
    Outlook,
    Progress,
    describe_gauges,
    describe_threads,
)
from shockgrid.runs.quantities import count, describe_seconds, describe_time, drop_units, is_time
from shockgrid.runs.ranks.world import World, describe_ranks
from shockgrid.runs.signals import (
    POINT,
    STOPPING,
    find_numbers,
    is_hang_up,
    leave_terminals,
    list_terminals,
)
from shockgrid.runs.store.directory import (
    RunDirectory,
    keep_problem_file,
    read_verdict,
    write_noted,
)
from shockgrid.runs.store.dumps import EMPTY, Names, list_arrays, make_image
from shockgrid.runs.store.files import write_atomically, write_sealed
from shockgrid.runs.store.history import (
    HistoryWriter,
    check_columns,
    find_restart_point,
    is_light,
    read_history,
    restore,
    truncate_history,
)
from shockgrid.runs.store.paraview import Sidecar
from shockgrid.runs.store.provenance import describe_provenance, find_provenance


class Background:
    """A file that a thread writes while the run continues, one at a time."""

    def __init__(self) -> None:
        self._writing: Future[Any] | None = None

    def start(self, write: Callable[[], Any]) -> None:
        """Call `write` in the thread, when what is being written is."""
        self.finish()
        self._writing = self._executor.submit(write)

    def finish(self, wait: bool = True) -> None:
        """Wait for the file, or only look; raises what its writing has raised, once."""
        if self._writing is not None and (wait or self._writing.done()):
            self._writing.exception()  # waits; interrupted, it can be waited for again
            writing = self._writing
            self._writing = None
            writing.result()

    @contextlib.contextmanager
    def running(self) -> Iterator[None]:
        """For the block; where something has failed in it, that is what is told."""
        with ThreadPoolExecutor(1, thread_name_prefix="dump") as self._executor:
            try:
                yield
            except BaseException:
                with contextlib.suppress(BadInput):
                    self.finish()
                raise
            self.finish()


# times the longest of the last steps and the longest write: time left for both
TIME_LEFT_MARGIN = 2.0
REMEMBERED_STEPS = 50  # steps
FORM = re.compile(r"(?:(\d+(?:\.\d+)?)h)?(?:(\d+(?:\.\d+)?)m)?(?:(\d+(?:\.\d+)?)s?)?")
CLOCK = re.compile(r"(\d+):([0-5]\d):([0-5]\d)")


def parse_duration(text: str) -> float:
    """Seconds [s] of a duration: 2h, 90m, 1h30m, 1:30:00 or a number of seconds.

    Raises BadInput for anything else, and for no time at all.
    """
    found = CLOCK.fullmatch(text.strip()) or FORM.fullmatch(text.strip())
    parts = zip(found.groups() if found else (), (3600.0, 60.0, 1.0), strict=False)
    seconds = sum(float(part) * scale for part, scale in parts if part is not None)
    if not 0.0 < seconds < float("inf"):
        raise BadInput(
            f"--max-wall {text!r} is not a time; write 2h, 90m, 1h30m, 1:30:00 or seconds, above 0"
        )
    return seconds


class WallLimit:
    """Wall time that a run may take, counted from when this is made.

    At least one step is made, so that runs in a queue come to their end.
    """

    def __init__(self, text: str):
        self.text = text
        self.end = time.monotonic() + parse_duration(text)
        self._steps: deque[float] = deque(maxlen=REMEMBERED_STEPS)
        self._write = 0.0

    def __str__(self) -> str:
        return f"--max-wall {self.text}"

    @property
    def reached(self) -> bool:
        """Would one more step, and the restart point after it, come too late?"""
        if not self._steps:
            return False
        needed = TIME_LEFT_MARGIN * (max(self._steps) + self._write)
        return time.monotonic() + needed >= self.end

    def note_step(self, seconds: float) -> None:
        """Remember how long a step has taken [s], without the compiling of kernels."""
        self._steps.append(seconds)

    def note_write(self, seconds: float) -> None:
        """Remember how long a restart point has taken [s]."""
        self._write = max(self._write, seconds)


def is_dump_due(output: Output, t_end: float, t_before: float, t: float) -> bool:
    """Does a dump's time lie in (t_before, t]?  Depends on these alone, as a restart must."""
    if any(t_before < time <= t for time in output.times):
        return True
    if output.every is not None:
        return math.floor(t / output.every) > math.floor(t_before / output.every)
    if not output.dumps or not math.isfinite(t_end):
        return False
    return math.floor(t * output.dumps / t_end) > math.floor(t_before * output.dumps / t_end)


MISSED = "not-steady"  # the cause of an end that is not what the run is for


@dataclass(frozen=True)
class Ending:
    """How a run ended: why, the exit code, and the screen for the person."""

    reason: str
    exit_code: int
    screen: str


class Stopped(Exception):
    """A signal or the limit of wall time stops the run: its words and the exit code."""


class Runner:
    """One run in one directory, from its first step or from a restart point."""

    def __init__(
        self,
        deck: ReadDeck,
        directory: RunDirectory,
        problem: Problem,
        evolution: Evolution,
        gauges: Gauges,
        quiet: bool = False,
        after_step: Callable[[float], str | None] | None = None,
    ):
        """gauges: what `check_requests` (`runs.march.launching`) has found good; after_step: called
        after each step with the time before it; words end the run."""
        self.deck = deck
        self.after_step = after_step
        self.deck_text = deck.to_toml()
        self.directory = directory
        self.quiet = quiet
        self.problem = problem
        self.evolution = evolution
        self.columns: list[str] | None = None
        self.chosen = find_columns(deck.deck.output.columns)
        self.last_point: int | None = None
        self.sidecar = Sidecar(directory.sidecar)
        self.gauges = gauges
        self.limit: WallLimit | None = None  # of wall time; whoever starts the run may set one
        self.writing = Background()
        self.world: World | None = None  # ranks of MPI that share the run; set like the limit
        self.restored = False
        self.remapped = ""  # a warning: which part of the history is of other cells
        self._signal = 0
        self._point_wanted = False

    def start(self) -> Ending:
        """Run in a new directory, from the beginning or the state that another run has given."""
        with self.directory.claimed(self._caution):
            write_atomically(self.directory.deck, self.deck_text)
            if self.deck.file:
                keep_problem_file(self.directory, self.deck.file)
            self._note_start(f"start from step {self.evolution.step}" if self.restored else "start")
            return self._run()

    def resume(self, at: int | None = None, say=lambda text: None) -> Ending:
        """Go on from the last good restart point, or from the one of step `at`."""
        with self.directory.claimed(self._caution):
            check_columns(self.directory.history, self.evolution, self._measure())
            tables = [self.directory.history]
            tables += [self.directory.gauges] * bool(self.gauges.points)
            state, step, rows = find_restart_point(self.directory, at, say, tables)
            if step or all(one.rows for one in rows):  # else it is as it was built
                restore(self.evolution, state, self.directory, step)
                self.restored = True
                self.gauges.set_state(state)
            for one in rows:
                if one.fault:
                    say(f"{one.path} {one.fault}: cut back to step {step} and computed again")
                    if one.path.exists():
                        self.directory.set_aside(one.path)
            columns = [truncate_history(one.path, step, one) for one in rows]
            self.columns = columns[0]
            self.gauges.columns = columns[-1]
            if self.evolution.finished:
                say(
                    f"this run has finished ({self.evolution.finished}); "
                    f"continue with --set run.t_end=T, T > {self.evolution.t:.6g}"
                )
            elif not self.quiet:
                t = describe_time(self.evolution.t, self.problem.t_unit)
                say(f"{self.directory} continues from step {step}, {t}")
            moved = self.directory.set_aside_after(step)
            if moved:
                say(f"{count(moved, 'later file')} moved to {self.directory}/superseded")
            with contextlib.suppress(BadInput):  # of a damaged verdict
                trust = (read_verdict(self.directory) or {"trust": []})["trust"]
                self.remapped = "".join(one["words"] for one in trust if one["rule"] == REMAPPED)
            self._note_start(f"restart from step {step}")
            write_atomically(self.directory.deck, self.deck_text)
            self.last_point = step
            self.directory.forget_early_end()
            return self._run()

    def _caution(self, text: str) -> None:
        """A caution about the disk, for the person and the log."""
        self.directory.note(f"caution: {text}")
        if not self.quiet:
            print(f"caution: {escape_controls(text)}", file=sys.stderr)

    def _note_start(self, what: str) -> None:
        made, deck = describe_provenance(find_provenance(self.deck_text))
        self.directory.note(
            f"{what}: {self.deck.problem} ({self.deck.described}); {deck}; {made}; "
            f"{platform.node()}, {os.cpu_count()} cores"
        )

    def _run(self) -> Ending:
        began = time.monotonic()
        cpu_began = time.process_time()
        status = "stopped"
        self.history = HistoryWriter(self.directory.history, self.columns)
        self.gauges.open(self.directory.gauges)
        self.progress = Progress(self.evolution, self.quiet, t_unit=self.problem.t_unit)
        self.outlook = Outlook(
            self.deck, self.problem, self.evolution, self.directory, self.progress.say
        )
        try:
            with self._signals_caught(), self.writing.running(), compiling(self.quiet):
                reason = self._march()
            missed = get_missed(self.evolution)
            reason, code = (f"{reason}, {missed}", 3) if missed else (reason, 0)
            status = "ended early" if missed else "finished" if self.evolution.finished else status
        except Stopped as stop:
            reason, code = stop.args
        except (RunFailure, BadInput) as error:  # BadInput here: the disk, mostly
            if isinstance(error, RunFailure):
                error = error.tell(drop_units(str(error), self.problem.t_unit))
            with contextlib.suppress(BadInput):
                self.directory.note(f"failed: {error}")
            self.outlook.fail(error)
            message = f"{error}; {self._way_on()}"
            if isinstance(error, RunFailure):
                raise self._explain(error.tell(message)) from error
            if not self.evolution.step:
                raise  # the deck, found out late
            raise type(error)(message) from error
        except KeyboardInterrupt:
            raise KeyboardInterrupt(self._way_on()) from None
        finally:
            self.progress.close()
            self.history.close()
            self.gauges.close()
        seconds = time.monotonic() - began
        cpu_seconds = time.process_time() - cpu_began  # of all threads
        self.directory.note(
            f"{reason} at step {self.evolution.step}, "
            f"{describe_time(self.evolution.t, self.problem.t_unit)}, {seconds:.1f} s "
            f"of wall time, {cpu_seconds:.1f} s of processor time"
        )
        history = read_history(self.directory.history)
        name = ENDS[MISSED].name if code == 3 else ""
        verdict = self.outlook.close(status, reason, history, name, self.remapped)
        try:
            screen = "\n".join(self._describe_run(f"{reason}: ", seconds, history, verdict))
        except RunFailure as error:  # of what is computed for the screen alone
            self.outlook.fail(error)
            raise self._explain(error) from error
        if code == 3:
            advice = self._explain(RunFailure(reason, cause=MISSED)).early_end.lines
            screen = "\n".join([screen, *advice])
        write_noted(self.directory, self.directory.summary, screen + "\n")
        return Ending(reason, code, screen)

    def _describe_run(
        self,
        reason: str,
        seconds: float,
        history: Mapping[str, np.ndarray],
        verdict: Mapping[str, Any],
    ) -> list[str]:
        """The lines of the screen at the end."""
        evolution = self.evolution
        problem = self.problem
        directory = self.directory
        t_unit = problem.t_unit
        cells = account.count_cells(evolution)
        names = [block.name for block in evolution.blocks]
        steps = f", {count(evolution.step, 'step')}" if is_time(t_unit) else ""
        lines = [
            f"{reason}{describe_time(evolution.t, t_unit)}{steps}, {cells} cells in "
            f"{count(len(names), 'block')}, {describe_seconds(seconds)}",
            account.describe_verdict(verdict),
            *account.describe_run(history, cells, names),
            *describe_gauges(problem.deck, directory),
        ]
        motion = getattr(evolution, "motion", None)
        if motion is not None and motion.blocks.size > 1:
            lines.append(f"ranks of MPI: {motion.blocks.size}; on the first of them")
        lines.append(f"threads: {describe_threads(problem.deck.run.threads, evolution)}")
        lines += describe_ranks(self.world, directory.note)
        if len(history.get("step", ())) > 1:
            own = account.describe_own(problem, history, evolution)
            lines += ["", own] if own else []
        cautions = account.describe_cautions(problem, history)
        lines += ["", *cautions] if cautions else []
        dumps = count(len(directory.list_points("dump")), "dump")
        lines += [
            "",
            f"in {directory}: {dumps}, history.csv, run.xmf (ParaView, VisIt, pyvista.XdmfReader)",
            f"see it:      shockgrid plot {directory.quoted}    shockgrid info {directory.quoted}",
        ]
        if evolution.finished is None:
            lines.append(f"continue:    {problem.say_restart(directory.quoted)}")
        return lines

    def _march(self) -> str:
        """Step until there is a reason to stop; the state then is in a dump."""
        evolution = self.evolution
        run = self.deck.deck.run
        if self.columns is None:
            first_row = {"step": evolution.step, "t": evolution.t}
            first_row |= get_start_row(evolution)
            self.history.start(first_row | self._measure())
        if self.last_point is None:
            self._dump_light() if self.deck.deck.output.light else self._dump()
        written = time.monotonic()
        if self.world is not None:
            self.directory.note(self.world.begin(self.deck, self.evolution, self.restored))
        while True:
            reason = evolution.finished
            if reason is None and run.max_steps is not None and evolution.step >= run.max_steps:
                reason = f"max_steps = {run.max_steps} reached"
                if evolution.step > run.max_steps:
                    reason = f"max_steps = {run.max_steps} passed before this start"
            if reason is not None:
                self._dump()
                self.writing.finish()
                self.directory.drop_old_restarts(keep=0)
                return reason
            if self._signal:
                self._write_restart_point()
                raise Stopped(f"stopped by {signal.Signals(self._signal).name}", 128 + self._signal)
            if self.limit is not None and self.limit.reached:
                self._write_restart_point()
                raise Stopped(f"{self.limit} reached", 0)
            t_before = evolution.t
            clock = read_clock()
            row = evolution.advance()
            seconds = read_clock() - clock
            self._record(row, seconds)
            self.writing.finish(wait=False)
            if self.limit is not None:
                self.limit.note_step(seconds)
            light = self.deck.deck.output.light
            if is_dump_due(self.deck.deck.output, evolution.t_end, t_before, evolution.t):
                self._dump_light() if light else self._dump()
                written = written if light else time.monotonic()
            if self._point_wanted:
                self._point_wanted = False
                self._write_restart_point()
                self.directory.note(f"SIGUSR1: restart point at step {evolution.step}")
                written = time.monotonic()
            elif 0 < self.deck.deck.output.restart_every <= time.monotonic() - written:
                self._write_restart_point(wait=False)
                written = time.monotonic()
            try:
                reason = self.after_step(t_before) if self.after_step else None
            except Exception as error:
                self._write_restart_point()
                self.directory.note(f"stopped by a hook: {type(error).__name__}: {error}")
                raise
            if reason:
                self._dump()
                return reason

    def _measure(self) -> dict[str, Any]:
        """Columns of the deck's chosen groups and of the problem."""
        chosen = compute_chosen_columns(self.evolution, self.chosen)
        if self.world:
            self.world.gather(self.problem)
        return chosen | self.problem.measure(self.evolution)

    def _record(self, row: dict[str, Any], seconds: float) -> None:
        evolution = self.evolution
        full = {"step": evolution.step, "t": evolution.t}
        full |= {name: value for name, value in row.items() if name not in full}
        full |= self._measure()
        full["seconds_step"] = round(seconds, 7)
        self.history.append(full)
        self.gauges.record()
        self.progress.update(evolution, full)
        self.outlook.trend.follow(full)
        for name in ("t", "dt"):
            if name in full and not math.isfinite(full[name]):
                raise RunFailure(
                    f"{name} = {full[name]} at step {evolution.step}", cause="not-finite"
                )

    def _dump(self) -> None:
        """A dump at this step, unless it is there, and the sidecar that lists it."""
        step = self.evolution.step
        path = self.directory.dump_path(step)
        self.writing.finish()
        if not (path.exists() and self.last_point == step) or is_light(path):
            self._write(path, self._show_dumps)
        else:
            self._show_dumps()

    def _show_dumps(self) -> None:
        self.directory.drop_old_restarts()
        self.sidecar.write([path for _, path in self.directory.list_points("dump")])

    def _dump_light(self) -> None:
        """A dump at this step that is no restart point, and the sidecar that lists it."""
        path = self.directory.dump_path(self.evolution.step)
        self._write(path, self._show_dumps, self.deck.deck.output)

    def _write_restart_point(self, wait: bool = True) -> None:
        step = self.evolution.step
        self.writing.finish()
        if self.last_point != step:
            self._write(self.directory.restart_path(step), self.directory.drop_old_restarts)
        if wait:
            self.writing.finish()

    def _write(self, path: Path, then: Callable[[], None], output: Output | None = None) -> None:
        """A dump of this step, and `then` what follows when it is on the disk.

        output: what is in a light one; a whole one is written while the run goes on.
        """
        began = time.monotonic()
        step = self.evolution.step
        self._sync()
        besides = EMPTY if output else self.gauges.get_state()
        blocks = {block.name: dict(list_arrays(block, output)) for block in self.evolution.blocks}
        shown = self.sidecar.describe(path, float(self.evolution.t), blocks)

        def follow() -> None:
            self.sidecar.take(path, shown)
            if output is None:
                self.last_point = step
            if self.limit is not None:
                self.limit.note_write(time.monotonic() - began)
            then()

        names = Names(self.deck.problem, self.deck_text, self.problem.t_unit)
        image = make_image(self.evolution, names, besides, output)
        if output:
            write_sealed(path, image)
            follow()
        else:
            self.writing.start(lambda: (write_sealed(path, image), follow()))

    def _sync(self) -> None:
        """Force all rows to the disk: a dump must not outlive them."""
        self.history.sync()
        self.gauges.sync()

    def _explain(self, failure: RunFailure) -> RunFailure:
        """The failure with what it means and what has helped; the last state is in a dump then."""
        from shockgrid.runs.early_end.explain import explain

        with contextlib.suppress(BadInput):
            if not self.directory.dump_path(self.evolution.step).exists():
                self._dump_light()
        restart = self.problem.say_restart(self.directory.quoted)
        explain(failure, self.directory, self.deck, restart)
        return failure

    def _way_on(self) -> str:
        if self.last_point is None:
            return "there is no restart point yet"
        command = self.problem.say_restart(self.directory.quoted)
        return f"last restart point is step {self.last_point} ({command})"

    @contextlib.contextmanager
    def _signals_caught(self):
        """Signals that end a run ask for a stop after the step; a second SIGINT is not waited for.

        SIGUSR1 asks for a restart point after the step.
        """
        terminals = list_terminals()

        def ask_to_stop(number, frame):
            self._signal = number
            signal.signal(signal.SIGINT, signal.default_int_handler)
            if is_hang_up(number):
                leave_terminals(terminals)
            elif not self.quiet:
                os.write(2, b"\nstopping after this step (again Ctrl-C: at once)\n")

        def ask_for_point(number, frame):
            self._point_wanted = True

        wanted = dict.fromkeys(find_numbers(*STOPPING), ask_to_stop)
        wanted |= dict.fromkeys(find_numbers(POINT), ask_for_point)
        before = {}
        with contextlib.suppress(ValueError):  # not in the main thread: somebody else owns them
            before = {number: signal.signal(number, ask) for number, ask in wanted.items()}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)
