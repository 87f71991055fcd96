"""The ranks that `mpiexec -n N shockgrid run` has started, as the first one sees them.

The first rank runs the command as it would alone: it reads the deck, prints, and writes all
files.  The others wait for orders (`runs.ranks.world`): to build the flow, as the first one
does at the same time, to begin, to make a step, to send what they have computed, to end.  MPI is
asked for nothing unless the environment says that more than one rank was started.

Note: after `begin`, whatever ends the first rank has to go through `dismiss`, or the others
wait for ever.
"""

from __future__ import annotations

import contextlib
import json
import os
import platform
import signal
import sys
import tomllib
from collections.abc import Callable
from typing import Any, TextIO

from shockgrid.hydro.ranks.cutting import Distribution
from shockgrid.hydro.ranks.ranks import COLLECT, COUNT, END, STEP, Ranks, hear, tell
from shockgrid.hydro.simulation import Simulation
from shockgrid.hydro.workers import count_processors
from shockgrid.problems.evolution import Evolution, State
from shockgrid.problems.problem import Problem
from shockgrid.problems.problem_file import read_problem_file
from shockgrid.regrid.errors import BadInput, RunFailure
from shockgrid.runs.deck.reading import ReadDeck, resolve_deck
from shockgrid.runs.ranks.map import describe_distribution, distribute_evolution
from shockgrid.runs.ranks.started import count_started, find_rank
from shockgrid.runs.signals import POINT, STOPPING, find_numbers
from shockgrid.runs.store.dumps import EMPTY

BUILD_MESSAGE = END + 1  # told first: the deck follows
BEGIN_MESSAGE = END + 2  # told once: who has what and, of a run that goes on, the state follow


class World:
    """The ranks of an mpi4py communicator `comm`, led by this one, the first."""

    def __init__(self, comm: Any):
        self.comm = comm
        self.size = int(comm.size)
        self._flow: Simulation | None = None  # when all ranks compute it
        self._beginning = False
        self._sent: str | None = None  # the deck that all ranks build

    @property
    def ranks(self) -> Ranks | None:
        """Who computes what now; others from when a flow has other blocks."""
        return None if self._flow is None else get_ranks(self._flow)

    def build(self, deck: ReadDeck) -> None:
        """Let the other ranks build the evolution of a checked deck, while this one does so.

        What fails there is reported when they begin, if the first rank has not failed by then.
        """
        if self._sent == (text := deck.to_toml()):
            return
        self._beginning = True
        tell(self.comm, BUILD_MESSAGE)
        file = str(deck.file.path) if deck.file else None
        self.comm.bcast((text, deck.origin, file), root=0)
        self._sent = text
        self._beginning = False

    def check(self, evolution: Any) -> None:
        """Raise BadInput for an evolution that cannot be computed on ranks."""
        if not isinstance(evolution, Simulation):
            raise BadInput(
                f"{self.size} ranks of MPI were started, but this problem is not a flow on blocks: "
                "run it without mpiexec"
            )

    def begin(self, deck: ReadDeck, evolution: Any, restored: bool) -> str:
        """Let all ranks build the evolution of `deck`; restored: and take up this one's state.

        Returns words on who computes what.
        """
        self.check(evolution)
        shares = distribute_evolution(evolution, self.size, deck.deck.run.cut)
        state = evolution.get_state() if restored else {}
        self.build(deck)
        self._beginning = True
        tell(self.comm, BEGIN_MESSAGE)
        self._flow = distribute_flow(self.comm, evolution, shares, state)
        self._beginning = False
        return describe_distribution([block.name for block in evolution.blocks], shares, self.size)

    def gather(self, problem: Problem) -> None:
        """Bring the first rank, which measures, all that a problem may read of a step."""
        if self.ranks is not None and problem.measures():
            self.ranks.collect()

    def dismiss(self, code: int) -> None:
        """End the other ranks with an exit code; at once, where they wait for this one's part."""
        if self._beginning or (self.ranks is not None and self.ranks.busy):
            self.comm.Abort(code)
        tell(self.comm, END, code)


def distribute_flow(
    comm: Any, built: Any, shared: Distribution | None = None, state: State = EMPTY
) -> Simulation:
    """An evolution that each rank has built, with the first one's state, shared by the ranks.

    shared, state: what the first rank says; state: its own, empty where all have the same.  Raises
    what has failed in building it here alone.
    """
    shares = comm.bcast(shared, root=0)
    if isinstance(built, Exception):
        raise built
    if not isinstance(built, Simulation):
        raise TypeError("what was built is not a flow on blocks")
    keys = comm.bcast(list(state), root=0)
    taken = {key: comm.bcast(state.get(key), root=0) for key in keys}  # array by array
    if taken and shared is None:
        built.set_state(taken)
    ranks = Ranks(comm, built.blocks, *shares)
    machines = comm.allgather(platform.node())
    beside = machines.count(platform.node())  # ranks that share the processors of a machine
    built.use_ranks(ranks, max(1, min(count_processors(), (os.cpu_count() or 1) // beside)))
    return built


def get_ranks(flow: Simulation) -> Ranks:
    """The ranks that share a flow now; raises TypeError where none do."""
    ranks = flow.motion.blocks
    if not isinstance(ranks, Ranks):
        raise TypeError("no ranks share this flow")
    return ranks


def describe_ranks(world: World | None, note: Callable[[str], None]) -> list[str]:
    """The line of the summary, none for a run in one process; all ranks have to be alive.

    It has messages and megabytes of a step, and the part of it that the ranks wait for them.
    note: takes the line of run.log, with the counts of all kinds of messages
    (`hydro.ranks.messages.Book.gather`).
    """
    if world is None or world.ranks is None:
        return []
    books = world.ranks.count()
    note(f"ranks: {json.dumps(books)}")
    steps = books["steps"]
    counts = list[str]()
    if steps:
        calls, size = (sum(books[name].values()) / steps for name in ("calls", "bytes"))
        counts.append(f"{calls:.1f} and {size / 1e6:.2g} MB a step")
        waits = [
            100.0 * waited / seconds
            for waited, seconds in zip(books["waited"], books["seconds"], strict=True)
            if seconds > 0.0
        ]
        if waits:
            counts.append(f"{min(waits):.0f}% to {max(waits):.0f}% of a step are waits for them")
    return [f"messages of ranks: {'; '.join(counts) or 'none'}"]


# exit codes, as in `runs.cli.main`
EXIT_BAD_INPUT = 2
EXIT_INTERNAL = 70


def run_on_ranks(command: Callable[[World | None], int], say: Callable[[str], None]) -> int:
    """Run a command on the first of the ranks that were started; the others follow it.

    say: takes a sentence for the person.  Returns the exit code, the same on all ranks.
    """
    try:
        from mpi4py import MPI
    except (ImportError, RuntimeError) as error:  # RuntimeError: no MPI library
        if find_rank() == 0:
            say(
                f"{count_started()} ranks of MPI were started, which needs mpi4py and an MPI "
                f"library: pip install 'shockgrid[mpi]' ({error})"
            )
        return EXIT_BAD_INPUT
    comm = MPI.COMM_WORLD
    if comm.size == 1:
        return command(None)
    if comm.rank == 0:
        world = World(comm)
        code = EXIT_INTERNAL
        try:
            code = command(world)
        finally:
            world.dismiss(code)
        return code
    for number in find_numbers(*STOPPING, POINT):  # the first rank says when it is time to end
        signal.signal(number, signal.SIG_IGN)
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
        while word == BUILD_MESSAGE:
            built = build(comm)
            word, code = hear(comm)
        if word == END:
            return code
        evolution = distribute_flow(comm, built)
        while True:
            word, code = hear(comm)
            if word == END:
                return code
            if word == STEP:
                with contextlib.suppress(RunFailure):  # agreed on by all ranks
                    Simulation.advance(evolution)  # what a problem adds is for the first rank
            elif word == COLLECT:
                evolution.collect()
            elif word == COUNT:
                get_ranks(evolution).count()
    except BaseException as error:
        code = (
            EXIT_BAD_INPUT if isinstance(error, BadInput | MemoryError | OSError) else EXIT_INTERNAL
        )
        message = str(error) if isinstance(error, BadInput) else f"{type(error).__name__}: {error}"
        print(f"shockgrid: rank {comm.rank}: {message}; all ranks end", file=screen, flush=True)
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
