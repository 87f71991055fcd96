"""A flow on several ranks: every rank has all perimeters, the inside of a block its owner alone.

All ranks run the same step.  What is computed of perimeters, lines, key nodes and sliding contacts
is computed by everybody, from the same numbers to the same bits; a block's regridding and update,
by its owner.  At two places of a step the owners tell what the others read of their blocks: the
new nodes along the sides, and the new states there.  Numbers that blocks are added up or compared
by travel as rows, one a block, and every rank goes through them in the order of the blocks, so
that any number of ranks gives the same bits.  A block may be cut: several ranks update it then
(`hydro.ranks.cutting`), and its owner is the one that regrids it.

A failure goes with these messages, too, so that a step that needs nothing else takes three: go,
the nodes, the states.

Notes: whatever a rank does between two steps, or where only one of them fails, must not
communicate, or all wait for ever; and a block's inside is old on all ranks but its owner's until
`collect`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from itertools import pairwise
from operator import attrgetter
from typing import Any

import numpy as np

from shockgrid.hydro import phases
from shockgrid.hydro.block import Block
from shockgrid.hydro.ranks import messages
from shockgrid.hydro.ranks.blocks import NODE_REPORT_WIDTH, STATE_REPORT_WIDTH, Blocks, Row, Table
from shockgrid.hydro.ranks.cutting import (
    GHOST_ROWS,
    CutBlock,
    Piece,
    Rows,
    count_tile_rows,
    distribute_blocks,
    divide_evenly,
    find_bounds,
)
from shockgrid.regrid.errors import RunFailure

STEP, COLLECT, COUNT, END = range(4)  # what the first rank tells the others to do
# seconds that a rank waits wide awake, and that it sleeps then
AWAKE_SECONDS = 5e-3
NAP_SECONDS = 2e-4
MOST_KEPT_ARRAYS = 8  # of a block, for the tags of messages


class Ranks(Blocks):
    """The ranks of `comm`, an mpi4py communicator or what has its `rank`, `size`, `Allgatherv`,
    `Ibcast`, `bcast`, `Send` and `Recv`, and, where blocks are cut, `Split`, `allgather`,
    `Isend` and `Irecv`.

    places: the ranks of each block, its owner first (`hydro.ranks.cutting`); bounds: of their
    bands, as rows of cells; left out: nearly as many rows for each; book: goes on to count the
    messages, None: from nothing.
    """

    def __init__(
        self,
        comm: Any,
        blocks: Sequence[Block],
        places: Sequence[tuple[int, ...]],
        bounds: Sequence[Sequence[int]] | None = None,
        book: messages.Book | None = None,
    ):
        super().__init__(blocks)
        self.book = book or messages.Book(comm)
        self.comm = self.book.count("rows")
        self.places = list(places)
        self.rank = int(comm.rank)
        self.size = int(comm.size)
        self.owners = [there[0] for there in places]
        self.own = [n for n, r in enumerate(self.owners) if r == self.rank]
        by_rank = [[n for n, r in enumerate(self.owners) if r == k] for k in range(self.size)]
        self._order = [n for numbers in by_rank for n in numbers]
        self._own_counts = [len(numbers) for numbers in by_rank]
        self.bounds = _find_all_bounds(blocks, places, bounds)
        self.cuts: dict[int, CutBlock] = {}
        self._find_pieces(comm)
        self._make_messages()
        self._start_copies: messages.Message | None = None  # where a body source acts
        self._accelerations: list[np.ndarray] = []
        self.busy = False  # with what all ranks do together
        self.whole = True  # is the inside of all blocks that of this step here?
        for number, block in enumerate(blocks):
            block.is_here = self.owners[number] == self.rank
            if self.rank > 0:
                self._leave_inside(number)

    def _find_pieces(self, comm: Any) -> None:
        """Whose rows are whose; the communicators of blocks that are cut."""
        all_pieces = [
            (rank, Piece(number, *rows))
            for number, there in enumerate(self.places)
            for rank, rows in zip(there, pairwise(self.bounds[number]), strict=True)
        ]
        self.pieces = [piece for rank, piece in all_pieces if rank == self.rank]
        self._find_solids()
        by_rank = [[piece for r, piece in all_pieces if r == rank] for rank in range(self.size)]
        self._numbers_of_pieces = [piece.number for pieces in by_rank for piece in pieces]
        self._piece_counts = [len(pieces) for pieces in by_rank]
        for number, there in enumerate(self.places):
            if len(there) > 1:
                inside = self.rank in there
                key = there.index(self.rank) if inside else 0
                group = comm.Split(0 if inside else 1, key)
                if inside:
                    group = self.book.count_group(group)
                    self.cuts[number] = CutBlock(group, self[number], self.bounds[number])
        for number, first, last in self.pieces:
            self[number].set_own_rows(first, last)

    def _make_messages(self) -> None:
        blocks = self
        new = []
        now = []
        # new nodes along all sides
        rings = [
            [(attrgetter("nodes_new"), messages.find_ring_of_nodes(block))] for block in blocks
        ]
        self._nodes = self._make("nodes", rings, NODE_REPORT_WIDTH)
        # what cells along the sides hold, by bands of cut blocks; sums of the owners
        for number, block in enumerate(blocks):
            there = self.places[number]
            bounds = self.bounds[number]
            for rank, rows in zip(there, pairwise(bounds), strict=True):
                messages_of = (("_new", new), ("", now))
                for suffix, items in messages_of:
                    parts = [
                        (
                            attrgetter(name + suffix),
                            messages.find_ring_of_array(block, name, rows),
                        )
                        for name in blocks[number].held_arrays
                    ]
                    items.append(messages.Item(number, rank, parts))
            sums = [(_get_sums, np.arange(blocks[number].totals.array.size))]
            new.append(messages.Item(number, there[0], sums, STATE_REPORT_WIDTH))
            now.append(messages.Item(number, there[0], sums))
        comm = self.book.count("states")
        self._new_states = messages.Message(comm, blocks, new)
        self._states = messages.Message(comm, blocks, now)
        # polygon cells, among the ranks of a cut block
        self._polygons = {
            number: self._make_polygons(number, cut)
            for number, cut in self.cuts.items()
            if cut.block.is_follower
        }

    def _make_polygons(self, number: int, cut: CutBlock) -> messages.Message:
        """A message among the ranks of a cut block alone."""
        parts_of_ranks = [_find_polygon_parts(cut.block, rows) for rows in cut.bands]
        items = [
            messages.Item(number, rank, parts_of_rank)
            for rank, parts_of_rank in enumerate(parts_of_ranks)
        ]
        return messages.Message(cut.group, self, items)

    def _make(self, kind: str, parts: list, width: int = 0) -> messages.Message:
        """A message in which homes tell of whole blocks."""
        items = [messages.Item(n, rank, parts[n], width) for n, rank in enumerate(self.owners)]
        return messages.Message(self.book.count(kind), self, items)

    # --- in a step ---------------------------------------------------------------------------

    def _exchange(
        self, message: messages.Message, rows: Sequence, number: int, failure: RunFailure | None
    ) -> RunFailure | None:
        """Send a message; the failure of the least number on all ranks, where there is one."""
        code = messages.NO_FAILURE if failure is None else float(number + 1)
        first = message.exchange(rows, code)
        if first is None:
            return None
        return self.comm.bcast(failure if first == self.rank else None, root=first)

    def exchange_nodes(self, rows: Sequence[Row], number: int, failure: RunFailure | None) -> Table:
        first_failure = self._exchange(self._nodes, rows, number, failure)
        if first_failure is not None:
            raise first_failure
        for cut in self.cuts.values():
            cut.send_nodes()
        return self._nodes.get_rows()

    def exchange_new_states(
        self, rows: Sequence[Row], number: int, failure: RunFailure | None
    ) -> Table:
        first_failure = self._exchange(self._new_states, rows, number, failure)
        if first_failure is not None:
            raise first_failure
        self._take_sums()
        for cut in self.cuts.values():
            cut.exchange_ghost_rows()
        return self._new_states.get_rows()

    def exchange_states(self) -> None:
        self._states.exchange()
        self._take_sums()

    def _take_sums(self) -> None:
        for number, owner in enumerate(self.owners):
            if owner != self.rank:
                self[number].totals.read_array()

    def exchange_starts(self, accelerations: Sequence[np.ndarray]) -> list[np.ndarray]:
        if self._start_copies is None:
            self._accelerations = [np.zeros((2, block.rim.faces)) for block in self]
            pushed = [
                (lambda _, push=push: push, np.arange(push.size)) for push in self._accelerations
            ]
            parts = [[*_find_starts(block), push] for block, push in zip(self, pushed, strict=True)]
            self._start_copies = self._make("sources", parts)
        for number, push in zip(self.own, accelerations, strict=True):
            self._accelerations[number][...] = push
        self._start_copies.exchange()
        return self._accelerations

    def exchange_rows(self, rows: Sequence[Row], width: int) -> Table:
        table = self._gather_table(rows, width, self._own_counts)
        rows_of_blocks: list[list[float]] = [[]] * len(self)
        for number, row in zip(self._order, table, strict=True):
            rows_of_blocks[number] = row
        return rows_of_blocks

    def exchange_pieces(self, rows: Sequence[Row]) -> Sequence[tuple[int, Row]]:
        table = self._gather_table(rows, 1, self._piece_counts)
        return list(zip(self._numbers_of_pieces, table, strict=True))

    def _gather_table(self, rows: Sequence, width: int, counts: Sequence[int]) -> list[list[float]]:
        """Rows of `width` numbers of all ranks, `counts` of each, the first rank's first."""
        mine = np.array(rows, dtype=np.float64).reshape(counts[self.rank], width)
        sizes = [width * count for count in counts]
        starts = [sum(sizes[:k]) for k in range(self.size)]
        table = np.zeros((sum(counts), width))
        self.comm.Allgatherv(mine, [table, (sizes, starts)])
        return table.tolist()

    def bring_starts(self, sounds: Sequence[bool], fields: Sequence[bool]) -> None:
        for number, cut in self.cuts.items():
            if sounds[number]:
                cut.bring_sound_speeds()
            if fields[number]:
                cut.bring_fields()

    def update(self, dt: float) -> None:
        super().update(dt)
        for number, cut in self.cuts.items():
            if number in self._polygons:  # done by all ranks of the block
                self._polygons[number].exchange()
                phases.fill_polygons(cut.block)
            cut.bring_totals()

    def check_new_states(self, scan: Callable[[int], Row]) -> Table:
        for cut in self.cuts.values():
            cut.bring_failed()
        scanned = {number: scan(number) for number in self.cuts}  # by all ranks of the block
        return super().check_new_states(lambda n: scanned[n] if n in scanned else scan(n))

    # --- between steps -----------------------------------------------------------------------

    def begin_step(self) -> None:
        """As `Blocks.begin_step`; the others hear of it from the first rank."""
        self.busy = True
        if self.rank == 0:
            tell(self.comm, STEP)
        self.whole = False
        self.book.begin_step()

    def end_step(self) -> None:
        self.busy = False
        self.book.end_step()

    def collect(self) -> None:
        """As `Blocks.collect`; within a step nothing is done."""
        if self.busy or (self.rank == 0 and self.whole):
            return
        self.busy = True
        comm = self.book.count("whole blocks")
        if self.rank == 0:
            tell(self.comm, COLLECT)
        for number in range(len(self)):
            for rank, tag, name, rows in self._list_kept(number):
                array = getattr(self[number], name)
                for plane in array.reshape(-1, *array.shape[-2:])[:, slice(*rows)]:
                    if rank == 0:
                        continue
                    if self.rank == 0:
                        comm.Recv(plane, source=rank, tag=tag)
                    elif self.rank == rank:
                        comm.Send(plane, dest=0, tag=tag)
        self.busy = False
        self.whole = True

    def share(self) -> None:
        comm = self.book.count("whole blocks")
        for number in range(len(self)):
            for rank, _, name, rows in self._list_kept(number):
                array = getattr(self[number], name)
                band = array.reshape(-1, *array.shape[-2:])[:, slice(*rows)]
                band[...] = comm.bcast(band.copy() if rank == self.rank else None, root=rank)

    def make_for(self, blocks: Sequence[Block]) -> Ranks:
        shares = distribute_blocks([(block.ni, block.nj) for block in blocks], self.size)
        ranks = Ranks(self.book.comm, blocks, *shares, book=self.book)
        ranks.busy = True
        ranks.whole = False
        return ranks

    def count(self) -> dict[str, Any]:
        """What all ranks have said and heard; see `hydro.ranks.messages.Book.gather`."""
        self.busy = True
        if self.rank == 0:
            tell(self.comm, COUNT)
        counts = self.book.gather()
        self.busy = False
        return counts

    def _list_kept(self, number: int) -> list[tuple[int, int, str, tuple[int, int]]]:
        """Who has what of a block: rank, tag of the message, name of an array, and its rows.

        Nodes are the owner's alone; of other arrays each rank has the rows of its band.
        """
        block = self[number]
        kept = []
        for tag, name in enumerate(block.step_arrays, MOST_KEPT_ARRAYS * number):
            if name == "nodes":
                kept.append((self.owners[number], tag, name, (0, block.ni + 1)))
                continue
            shift = block.count_ghosts(getattr(block, name))
            for rank, rows in zip(self.places[number], pairwise(self.bounds[number]), strict=True):
                kept.append((rank, tag, name, (rows[0] + shift, rows[1] + shift)))
        return kept

    def _leave_inside(self, number: int) -> None:
        """Give back the memory of cells and nodes that other ranks have; rings stay."""
        block = self[number]
        first, last = next((p[1:] for p in self.pieces if p.number == number), (0, 0))
        if first == 0 and last == block.ni:
            return
        if last > 0:
            first = max(first - GHOST_ROWS, 0)
            last = min(last + GHOST_ROWS, block.ni)
        parted = block.start is not block.state
        rings = {name: messages.find_ring_of_array(block, name) for name in block.held_arrays}
        rings["nodes"] = messages.find_ring_of_nodes(block)
        for name in (
            *block.step_arrays,
            *(f"{name}_new" for name in block.step_arrays),
            "crowding",
        ):
            array = getattr(block, name)
            if name.startswith("nodes") and block.is_here:
                continue
            empty = np.zeros(array.shape)  # pages that nobody writes to take no memory
            if (ring := rings.get(name)) is not None:
                empty.reshape(-1)[ring] = array.reshape(-1)[ring]
            ghosts = array.shape[-2] - block.ni if last > 0 else 0
            empty[..., first : last + ghosts, :] = array[..., first : last + ghosts, :]
            setattr(block, name, empty)
        block.use_start_copies(parted)


def tell(comm: Any, word: int, code: int = 0) -> None:
    """Tell the other ranks what to do, with an exit code where it is the END."""
    comm.Ibcast(np.array([word, code], dtype=np.int64), root=0).Wait()


def hear(comm: Any) -> tuple[int, int]:
    """What the first rank tells: a word, and an exit code; who waits long lets others compute."""
    word = np.zeros(2, dtype=np.int64)
    request = comm.Ibcast(word, root=0)
    began = time.monotonic()
    while not request.Test():
        time.sleep(NAP_SECONDS if time.monotonic() - began > AWAKE_SECONDS else 0.0)
    return int(word[0]), int(word[1])


def _get_sums(block: Block) -> np.ndarray:
    """The array of a block's sums, summed where the block is; the others receive it."""
    if block.is_here:
        _ = block.totals.sums
    return block.totals.array


def _find_starts(block: Block) -> list[messages.Part]:
    """Of what a step starts from, the cells along the sides."""
    return [
        (
            lambda of_block, name=name: of_block.get_start(name),
            messages.find_ring_of_array(block, name),
        )
        for name in block.held_arrays
    ]


def _find_polygon_parts(block: Block, rows: Rows) -> list[messages.Part]:
    """What polygon cells read and change of an update."""
    names = (*(f"{name}_new" for name in block.held_arrays), "rates_new", "crowding")
    return [(attrgetter(name), messages.find_ring_of_array(block, name, rows, 1)) for name in names]


def _find_all_bounds(
    blocks: Sequence[Block],
    places: Sequence[tuple[int, ...]],
    bounds: Sequence[Sequence[int]] | None,
) -> list[tuple[int, ...]]:
    if bounds is not None:
        return [tuple(found) for found in bounds]
    return [
        find_bounds(block.ni, divide_evenly(count_tile_rows(block.ni), len(there)))
        for block, there in zip(blocks, places, strict=True)
    ]
