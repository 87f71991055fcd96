"""Making the runner of a new or a continued run.

Of the deck of a run that goes on, what shapes the state stays as it was.  An end that moves moves
nothing else: lengths and motions that a problem makes for its end time are made for the old one,
which `run.t_set_up` keeps.
"""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Callable
from operator import attrgetter

import msgspec

from shockgrid.hydro.history import compute_chosen_columns
from shockgrid.hydro.simulation import Simulation
from shockgrid.problems.column_groups import find_columns
from shockgrid.problems.deck import Deck, Output, Regrid
from shockgrid.problems.evolution import Evolution, get_node_fields
from shockgrid.problems.problem import Problem
from shockgrid.regrid.compilation.first_calls import interpreted
from shockgrid.regrid.errors import BadInput, suggest
from shockgrid.runs.deck.checking import find_differences, is_runtime_key, list_runtime_keys, show
from shockgrid.runs.deck.reading import ReadDeck, resolve_deck
from shockgrid.runs.forecast import foretell
from shockgrid.runs.gauges import Gauges, make_gauges
from shockgrid.runs.inspection.account import describe_cautions
from shockgrid.runs.march.compiling import compiling
from shockgrid.runs.march.runner import Runner
from shockgrid.runs.ranks.map import check_cut
from shockgrid.runs.ranks.world import World
from shockgrid.runs.store.directory import (
    RunDirectory,
    create_directory,
    read_run_deck,
    read_stored_deck,
)
from shockgrid.runs.store.files import write_atomically
from shockgrid.runs.store.history import find_restart_point, restore, truncate_history

CELLS = "cells"
SET_UP = "run.t_set_up"
MOST_PREVIEWED_CELLS = 1_000_000  # that are built to look


def check_deck_fully(read: ReadDeck, problem: Problem) -> None:
    """Raise BadInput for what a run of this deck would be refused for before its first step.

    Kernels are compiled for a deck with gauges, fields or columns alone: these need blocks that can
    march.  Not checked is whether this machine has the memory.  A deck of more than MOST_CELLS
    cells is not built: its gauges, fields and columns are left to the run.
    """
    output = read.deck.output
    with read.numbers_in_reach(), compiling(quiet=False):
        check_regridder(problem)
        find_columns(output.columns)
        with interpreted():
            plan = problem.plan()
        if plan is not None:
            check_times(output, plan[0])
            check_cut(read.deck.run.cut, [block.name for block in plan[1]])
        if not (read.deck.gauge or output.fields or output.columns or (output.times and not plan)):
            return
        if problem.estimate_cells() > MOST_PREVIEWED_CELLS:
            return
        check_requests(read, problem.build())


def check_regridder(problem: Problem) -> None:
    """Make the deck's regridder once; BadInput for a name, an option or a weight that is none."""
    regrid = getattr(problem.deck, "regrid", None)
    if isinstance(regrid, Regrid):
        try:
            regrid.make(threads=problem.deck.run.threads)
        except BadInput as error:
            raise BadInput(f"deck: {error}") from error


def check_requests(read: ReadDeck, evolution: Evolution) -> Gauges:
    """The gauges of a deck in a freshly built evolution; BadInput for what it cannot give: gauges,
    cut blocks, dumps after its end, fields, columns."""
    output: Output = read.deck.output
    gauges = make_gauges(read.deck, evolution)
    check_cut(read.deck.run.cut, [block.name for block in evolution.blocks])
    check_times(output, evolution.t_end)
    there = {name for b in evolution.blocks for name in (*b.cell_fields, *get_node_fields(b))}
    for name in output.fields:
        if name not in there:
            hint = suggest(name, sorted(there), cutoff=0.6)
            raise BadInput(f"deck: output.fields has {name!r}; no block has such a field{hint}")
    compute_chosen_columns(evolution, find_columns(output.columns))
    return gauges


def check_times(output: Output, t_end: float) -> None:
    """Raise BadInput for a time of a dump past the end of the run."""
    late = [time for time in output.times if time > t_end]
    if late:
        raise BadInput(
            f"deck: output.times has {late[0]:g}, which is after the end of the run, t = {t_end:g}"
        )


def start_runner(
    deck: ReadDeck,
    output: str | None,
    force: bool,
    quiet: bool,
    say: Callable[[str], None],
    world: World | None = None,
    built: tuple[Problem, Evolution] | None = None,
) -> Runner:
    """A runner at the first step; its directory is made once all else has been found good.

    world: the ranks of MPI that are to share it; built: problem and evolution, where they are.
    """
    problem = built[0] if built else deck.make_problem()
    with compiling(quiet), deck.numbers_in_reach():
        problem.check_memory()
        cautions = describe_cautions(problem)
        check_regridder(problem)
        if world is not None:
            world.build(deck)
        evolution = built[1] if built else problem.build()
        gauges = check_requests(deck, evolution)  # refused before there is a directory
        if world is not None:
            world.check(evolution)
        lines, of_disk = foretell(deck, problem, evolution, output)
    directory = create_directory(output, deck.label, force)
    if not quiet:
        head = f"{deck.problem} ({deck.described}) in {directory}"
        say("\n".join([head, *lines, *cautions, *of_disk]))
    return Runner(deck, directory, problem, evolution, gauges, quiet)


def continue_runner(
    directory: RunDirectory,
    settings: tuple[str, ...],
    quiet: bool,
    at: int | None = None,
    say: Callable[[str], None] = lambda text: None,
    world: World | None = None,
) -> Runner:
    """A runner for the deck in `directory` with `settings`; its `resume` continues.

    at: step of the restart point that `resume` will be asked for.  say: is told the cautions of a
    run that goes on beyond the end that it was set up for.  world: the ranks of MPI that are to
    share it.  Raises BadInput for a deck that would make it another flow.
    """
    deck = read_restart_deck(directory, settings, at, say)
    problem = deck.make_problem()
    with compiling(quiet), deck.numbers_in_reach():
        if world is not None:
            world.build(deck)
        evolution = problem.build()
        gauges = check_requests(deck, evolution)
        if deck.deck.run.t_set_up is not None and not quiet:
            for line in describe_cautions(problem):
                say(line)
    return Runner(deck, directory, problem, evolution, gauges, quiet)


def read_restart_deck(
    directory: RunDirectory,
    settings: tuple[str, ...],
    at: int | None = None,
    say: Callable[[str], None] = lambda text: None,
) -> ReadDeck:
    """The deck that a restart marches with: that of `directory` with `settings`, checked against
    the one in the restart point of step `at`, None the last (`settle_deck`)."""
    deck = read_run_deck(directory, settings, strict=True, say=say)
    check_changeable(settings, type(deck.deck))
    check_effect(settings, deck.deck)
    return settle_deck(directory, deck, at)


def settle_deck(
    directory: RunDirectory, deck: ReadDeck, at: int | None = None, cells: bool = False
) -> ReadDeck:
    """The deck that a restart from `directory` marches with: `deck`, with run.t_set_up if it needs.

    at: step of the restart point, None the last; cells: may the key `cells` differ?  Raises
    BadInput where `deck` is one of another state than the dump's.
    """
    kept = read_stored_deck(directory, at)
    if kept is None:
        return deck
    try:
        before = resolve_deck(tomllib.loads(kept.text), str(kept.path), file=deck.file)
    except (BadInput, tomllib.TOMLDecodeError):  # another version's, with keys that are none now
        return deck
    if before.problem != deck.problem and not deck.file:
        raise BadInput(
            f"{directory.deck}: problem = {show(deck.problem)}, and {kept.path.name} holds a run "
            f"of {before.problem}; another problem is another run (shockgrid run)"
        )
    run = deck.deck.run
    made_for = before.deck.run.t_set_up or kept.t_end
    found = find_differences(before.deck, deck.deck)
    refused = [one for one in found if not is_runtime_key(one.key, type(deck.deck))]
    may_differ = {CELLS} if cells else set()
    if run.t_set_up in (None, made_for):
        may_differ.add(SET_UP)
    refused = [one for one in refused if one.key not in may_differ]
    if refused:
        raise BadInput(
            "\n".join(
                f"{directory.deck}: {one.key} is {show(one.now)}, and {show(one.before)} in "
                f"{kept.path}: it affects the state, so a restart cannot change it; start a new "
                "run with it (shockgrid run)"
                for one in refused
            )
        )
    moves = [one for one in found if one.key == "run.t_end" or "." not in one.key]
    if run.t_set_up is not None or not (moves or before.deck.run.t_set_up):
        return deck
    run = msgspec.structs.replace(run, t_set_up=made_for)
    return dataclasses.replace(deck, deck=msgspec.structs.replace(deck.deck, run=run))


def _list_keys(settings: tuple[str, ...]) -> list[str]:
    return [setting.partition("=")[0].strip() for setting in settings]


def check_effect(settings: tuple[str, ...], deck: Deck) -> None:
    """Raise BadInput for a setting of a key that another key of the deck overrules."""
    for key in _list_keys(settings):
        other = deck.overruled.get(key)
        if other is not None and attrgetter(other)(deck) is not None:
            raise BadInput(
                f"--set {key} has no effect, since {other} = {show(attrgetter(other)(deck))} is "
                f"set; --set {other}=..."
            )


def check_changeable(settings: tuple[str, ...], kind: type[Deck]) -> None:
    """Raise BadInput for a setting of a deck `kind` that a restart cannot change."""
    for key in _list_keys(settings):
        if not is_runtime_key(key, kind):
            keys = ", ".join(list_runtime_keys(kind))
            way = (
                "--cells continues on other cells"
                if key == CELLS
                else f"another {key} is another run"
            )
            raise BadInput(
                f"--set {key}: it shapes the state, and a restart can change only {keys}; {way}"
            )


def remap_runner(
    old: RunDirectory,
    cells: str,
    settings: tuple[str, ...],
    at: int | None,
    output: str | None,
    force: bool,
    quiet: bool,
    say: Callable[[str], None],
) -> Runner:
    """A runner in a new directory, whose evolution has the state of `old` on other cells.

    cells: the deck's key `cells`, "64" or "64,32"; settings: others, of run, output and regrid; at:
    the step of the restart point, None the last; output, force: as for a new run.  Its `start`
    continues it.  Raises BadInput, before anything is written, for what cannot be gone on with.
    """
    from shockgrid.hydro.remap.flow import take_over  # with scipy: slow to load

    before = read_run_deck(old, strict=True, say=say)
    settle_deck(old, before, at)
    check_changeable(settings, type(before.deck))
    if getattr(before.deck, CELLS, None) is None:
        raise BadInput(
            f"--cells: the deck of {before.problem} has no key `cells`, so its grid cannot be "
            "changed in a restart; begin a new run"
        )
    wanted = f"{CELLS}=[{cells}]" if "," in cells else f"{CELLS}={cells}"
    deck = read_run_deck(old, (*settings, wanted), strict=True)
    check_effect(settings, deck.deck)
    deck = settle_deck(old, deck, at, cells=True)
    if output:
        new = RunDirectory(output).path.resolve()
        kept = old.path.resolve()
        if new == kept or kept in new.parents:
            raise BadInput(
                f"-o {output} is the run that is gone on with, which stays as it is; name another "
                "directory"
            )
    source = _build(before, quiet)
    target = _build(deck, quiet)
    if type(source) is not Simulation or type(target) is not Simulation:  # it holds more
        raise BadInput(
            f"--cells: {deck.problem} is not only a flow on blocks, and what else it holds cannot "
            "be laid on other cells; begin a new run with the cells wanted"
        )
    gauges = check_requests(deck, target)  # points of the material are those of the first state
    state, step, (rows,) = find_restart_point(old, at, say, [old.history])
    restore(source, state, old, step)
    with compiling(quiet):
        blocks = take_over(source, target)
    gauges.set_state(state, other_cells=True)
    directory = create_directory(output, deck.label, force)
    write_atomically(directory.deck, deck.to_toml())  # by which the directory is known
    columns = truncate_history(directory.history, step, rows)
    sizes = "; ".join("{} {} x {} -> {} x {}".format(b.name, *b.before, *b.now) for b in blocks)
    slivers = sum(block.slivers.count for block in blocks)
    note = f"continues from step {step} of {old} on other cells: {sizes}"
    if slivers:
        note += f"; cells with slivers between the outlines: {slivers}"
    directory.note(note)
    if not quiet:
        say(f"{deck.problem} in {directory} {note}")
    if target.finished:
        say(
            f"this run has finished ({target.finished}): its end is remapped to the other cells; "
            f"continue with --set run.t_end=T, T > {target.t:.6g}"
        )
    runner = Runner(deck, directory, deck.make_problem(), target, gauges, quiet)
    runner.columns = columns
    runner.restored = True
    runner.remapped = f"the history up to step {step} is that of {old}, on its cells"
    return runner


def _build(deck: ReadDeck, quiet: bool) -> Evolution:
    """The first state of a deck's problem."""
    problem = deck.make_problem()
    with compiling(quiet), deck.numbers_in_reach():
        problem.check_memory()
        return problem.build()
