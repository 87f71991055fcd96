"""What all ranks but the first do: build the same flow, and make the steps that they are told.

They print nothing and write no file.  What goes wrong on one of them alone is told in a sentence,
and ends all ranks: nobody could go on without it.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import tomllib
from collections.abc import Callable
from typing import Any, TextIO

from hydro.ranks.ranks import COLLECT, COUNT, END, STEP, Ranks, hear
from hydro.simulation import Simulation
from problems.evolution import Evolution
from problems.problem_file import read_problem_file
from regrid.errors import BadInput, RunFailure
from runs.deck.reading import resolve_deck
from runs.ranks.files import WRITE, follow_in_writing
from runs.ranks.started import find_rank
from runs.ranks.world import BUILD, World, count_own_processors, open_world, receive_state

BAD_INPUT, INTERNAL = 2, 70  # exit codes, as in `runs.cli.main`


def run_on_ranks(command: Callable[[World | None], int], say: Callable[[str], None]) -> int:
    """Run a command on the first of the ranks that were started; the others follow it.

    say: takes a sentence for the person.  Returns the exit code, the same on all ranks.
    """
    try:
        comm = open_world()
    except BadInput as error:
        if find_rank() == 0:
            say(str(error))
        return BAD_INPUT
    if comm.size == 1:
        return command(None)
    if comm.rank > 0:
        return _follow_silently(comm)
    world, code = World(comm), INTERNAL
    try:
        code = command(world)
    finally:
        world.dismiss(code)
    return code


def _follow_silently(comm: Any) -> int:
    for name in ("SIGINT", "SIGTERM", "SIGUSR1"):  # the first rank says when it is time to end
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    screen = sys.stderr
    with (
        open(os.devnull, "w", encoding="utf-8") as nowhere,
        contextlib.redirect_stdout(nowhere),
        contextlib.redirect_stderr(nowhere),
    ):
        return follow(comm, screen)


def follow(comm: Any, screen: TextIO) -> int:
    """Do what the first rank tells until the end; returns the exit code.

    What fails here alone is said on `screen`, and ends all ranks.
    """
    try:
        built: Evolution | Exception | None = None
        word, code = hear(comm)
        while word == BUILD:
            built = build(comm)
            word, code = hear(comm)
        if word == END:
            return code
        evolution, ranks = begin(comm, built)
        while True:
            word, code = hear(comm)
            if word == END:
                return code
            if word == STEP:
                with contextlib.suppress(RunFailure):  # agreed on by all ranks
                    Simulation.advance(evolution)  # what a problem adds is for the first rank
            elif word == COLLECT:
                ranks.collect()
            elif word == WRITE:
                follow_in_writing(comm, evolution, ranks)
            elif word == COUNT:
                ranks.count()
    except BaseException as error:
        code = BAD_INPUT if isinstance(error, BadInput | MemoryError | OSError) else INTERNAL
        words = str(error) if isinstance(error, BadInput) else f"{type(error).__name__}: {error}"
        print(f"shockgrid: rank {comm.rank}: {words}; all ranks end", file=screen, flush=True)
        comm.Abort(code)
        raise


def build(comm: Any) -> Evolution | Exception:
    """The evolution of the deck that the first rank has sent, or what has failed.

    The first rank builds the same at the same time, and says what is wrong with a deck.
    """
    text, origin, path = comm.bcast(None, root=0)
    try:
        file = read_problem_file(path) if path else None
        deck = resolve_deck(tomllib.loads(text), origin, file=file)
        return deck.make_problem().build()
    except Exception as error:
        return error


def begin(comm: Any, built: Evolution | Exception | None) -> tuple[Simulation, Ranks]:
    """The evolution that was built with the state of the first rank's, and the ranks that share it.

    Raises what has failed here alone.
    """
    shares, watched = comm.bcast(None, root=0)
    if isinstance(built, Exception):
        raise built
    if not isinstance(built, Simulation):
        raise TypeError("what was built is no flow on blocks")
    evolution, state = built, receive_state(comm)
    if state:
        evolution.set_state(state)
    ranks = Ranks(comm, evolution.blocks, *shares, watched)
    evolution.spread(ranks, count_own_processors(comm))
    return evolution, ranks
