"""The ranks that `mpiexec -n N shockgrid run` has started, as the first one sees them.

The first rank runs the command as it would alone: it reads the deck, prints, and writes all
files.  The others wait to be told (`runs.ranks.following`): to build the flow, as the first one
does at the same time, to begin, to make a step, to send what they have computed, to end.  MPI is
asked for nothing unless the environment says that more than one rank was started.

The trap: after `begin`, whatever ends the first rank has to go through `dismiss`, or the others
wait for ever.
"""

from __future__ import annotations

import contextlib
import os
import platform
from typing import Any

import numpy as np

from hydro.ranks.ranks import END, Ranks, tell
from hydro.simulation import Simulation
from hydro.workers import count_processors
from problems.problem import Problem, Watched
from regrid.errors import BadInput
from runs.deck.reading import ReadDeck
from runs.ranks.map import describe_shares
from runs.ranks.sharing import share_evolution
from runs.ranks.started import count_started

BUILD = END + 1  # told first: the deck follows
BEGIN = END + 2  # told once: who has what and, of a run that goes on, the state follow


class World:
    """The ranks of an mpi4py communicator `comm`, led by this one, the first."""

    def __init__(self, comm: Any):
        self.comm, self.size = comm, int(comm.size)
        self.ranks: Ranks | None = None
        self._watched: Watched | None = None
        self._beginning = False
        self._sent: str | None = None  # the deck that all ranks build

    def build(self, deck: ReadDeck) -> None:
        """Let the other ranks build the evolution of a checked deck, while this one does so.

        What fails there is told when they begin, if the first rank has not failed by then.
        """
        if self._sent == (text := deck.to_toml()):
            return
        self._beginning = True
        tell(self.comm, BUILD)
        file = str(deck.file.path) if deck.file else None
        self.comm.bcast((text, deck.origin, file), root=0)
        self._sent, self._beginning = text, False

    def check(self, evolution: Any) -> None:
        """Raise BadInput for an evolution that cannot be computed on ranks."""
        if not isinstance(evolution, Simulation):
            raise BadInput(
                f"{self.size} ranks of MPI were started, but this problem is no flow on blocks: "
                "run it without mpiexec"
            )

    def begin(self, deck: ReadDeck, problem: Problem, evolution: Any, restored: bool) -> str:
        """Let all ranks build the evolution of `deck`; restored: and take up this one's state.

        Returns words on who computes what.
        """
        self.check(evolution)
        shares = share_evolution(evolution, self.size, deck.deck.run.cut)
        state = evolution.get_state() if restored else {}
        self.build(deck)
        self._watched = problem.watch(evolution)
        watched = self._watched or {}
        self._beginning = True
        tell(self.comm, BEGIN)
        self.comm.bcast((shares, watched), root=0)
        send_state(self.comm, state)
        self.ranks = Ranks(self.comm, evolution.blocks, *shares, watched)
        evolution.spread(self.ranks, count_own_processors(self.comm))
        self._beginning = False
        return describe_shares([block.name for block in evolution.blocks], shares, self.size)

    def measuring(self) -> contextlib.AbstractContextManager[None]:
        """For the block in which a problem measures: no more is collected than it watches."""
        if self.ranks is None or self._watched is None:
            return contextlib.nullcontext()
        return self.ranks.glance()

    def dismiss(self, code: int) -> None:
        """End the other ranks with an exit code; at once, where they wait for this one's part."""
        if self._beginning or (self.ranks is not None and self.ranks.busy):
            self.comm.Abort(code)
        tell(self.comm, END, code)


def send_state(comm: Any, state: dict[str, Any]) -> None:
    """Send a state of the first rank to all, array by array; nothing for an empty one."""
    arrays = {k: np.ascontiguousarray(v) for k, v in state.items() if isinstance(v, np.ndarray)}
    forms = {key: (array.shape, array.dtype.str) for key, array in arrays.items()}
    comm.bcast((forms, {k: v for k, v in state.items() if k not in arrays}), root=0)
    for array in arrays.values():
        comm.Bcast(array, root=0)


def receive_state(comm: Any) -> dict[str, Any]:
    """What `send_state` of the first rank sends."""
    forms, state = comm.bcast(None, root=0)
    for key, (shape, kind) in forms.items():
        state[key] = np.empty(shape, dtype=kind)
        comm.Bcast(state[key], root=0)
    return state


def open_world() -> Any:
    """mpi4py's communicator of all ranks that were started.

    Raises BadInput where mpi4py or an MPI library is missing.
    """
    try:
        from mpi4py import MPI
    except (ImportError, RuntimeError) as error:  # RuntimeError: no MPI library
        raise BadInput(
            f"{count_started()} ranks of MPI were started, which needs mpi4py and an MPI library: "
            f"pip install 'shockgrid[mpi]' ({error})"
        ) from error
    return MPI.COMM_WORLD


def count_own_processors(comm: Any) -> int:
    """Processors for this rank, where those of one machine share them; all ranks ask at once."""
    machines = comm.allgather(platform.node())
    beside = machines.count(platform.node())
    return max(1, min(count_processors(), (os.cpu_count() or 1) // beside))
