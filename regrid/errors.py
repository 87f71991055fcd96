"""The three ways in which work ends early, how the command line reports each, and similar names."""

from __future__ import annotations

import contextlib
import difflib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np

MISSPELT_LIKENESS = 0.8  # likeness of names that differ by a slip
OFFERED_LIKENESS = 0.6  # likeness of names from which one is offered for the other: less misleads


class BadInput(Exception):
    """A deck, file, grid or flag that cannot be used.

    The message says what, where and what would be right.  The command line prints it and exits
    with code 2.
    """


class Mistakes:
    """BadInput of several parts of an input, gathered so that one check tells of all of them."""

    def __init__(self) -> None:
        self.sentences: list[str] = []

    @contextlib.contextmanager
    def gather(self) -> Iterator[None]:
        """Keep what BadInput says that comes from the block, and go on behind it."""
        try:
            yield
        except BadInput as error:
            self.sentences += str(error).splitlines()

    def check(self) -> None:
        """Raise BadInput with all sentences, a line each, if there are any."""
        if self.sentences:
            raise BadInput("\n".join(dict.fromkeys(self.sentences)))


@dataclass(frozen=True)
class Place:
    """Where in a flow: a block; of it a cell (i, j), or nodes of a side, as far as known."""

    block: str
    cell: tuple[int, int] | None = None
    side: str | None = None
    nodes: tuple[int, ...] = ()


class RunFailure(Exception):
    """The physics of a run failed; the message names block, cell and time.

    The command line prints the message with the last restart point and exits with code 3.  `cause`
    is an id of `runs.early_end.causes`, "" where nobody knows; `place`, where it happened;
    `early_end`, a `runs.early_end.explain.EarlyEnd`: what the run left in its directory.
    """

    early_end: Any = None

    def __init__(self, what: str = "", *, cause: str = "", place: Place | None = None):
        super().__init__(what)
        self.cause = cause
        self._place = place

    @property
    def place(self) -> Place | None:
        """Where it happened; None where it has no place."""
        return self._place

    def tell(self, message: str, kind: type[RunFailure] | None = None) -> RunFailure:
        """A failure with other words, of the same cause, at the same place; of `kind`, if given."""
        repeated = (kind or type(self))(message)
        repeated.cause = self.cause
        repeated._place = self.place
        return repeated


class RegridFailure(RunFailure):
    """No valid grid exists or was found for a boundary.

    `str()` is one sentence: "regrid: block 'plate', side j_min, nodes 17 and 23: polyline crosses
    itself", made of `block`, `side` and `nodes` as far as they are known, and of `what`, what is
    wrong.  A regridder knows no block: whoever does sets `block`, and with it comes "regrid:".
    `grid` (2, ni+1, nj+1), where a grid was made, is that one with its bad cells: for pictures;
    `cell` (i, j), where one is known, the worst of them.
    """

    def __init__(
        self,
        what: str,
        *,
        block: str | None = None,
        side: str | None = None,
        nodes: tuple[int, ...] = (),
        grid: np.ndarray | None = None,
        cell: tuple[int, int] | None = None,
        cause: str = "no-grid",
        place: Place | None = None,
    ):
        super().__init__(what, cause=cause, place=place)
        self.cell = cell
        self.block = block
        self.side = side
        self.nodes = tuple(nodes)
        self.grid = grid

    @property
    def place(self) -> Place | None:
        """Block with cell, side and nodes, where the block is known."""
        if self.block:
            return Place(self.block, self.cell, self.side, self.nodes)
        return self._place

    @property
    def what(self) -> str:
        """What is wrong, without block, side and nodes."""
        return str(self.args[0]) if self.args else ""

    @property
    def without_block(self) -> str:
        """Side, nodes and what is wrong, for a sentence that names the place itself."""
        parts = [f"side {self.side}"] if self.side else []
        if len(self.nodes) == 1:
            parts.append(f"node {self.nodes[0]}")
        elif self.nodes:
            *first, last = (str(node) for node in self.nodes)
            parts.append(f"nodes {', '.join(first)} and {last}")
        return f"{', '.join(parts)}: {self.what}" if parts else self.what

    def __str__(self) -> str:
        sentence = self.without_block
        if not self.block:
            return sentence
        mark = ", " if self.side else ": "
        return f"regrid: block {self.block!r}{mark}{sentence}"


def find_nearest(name: str, known: Iterable[str], cutoff: float = OFFERED_LIKENESS) -> str | None:
    """The name in `known` that is most like `name`, or with which it begins, or None.

    `cutoff` 0 to 1 is the least likeness; at 0 there is one as soon as there are names.  Capitals,
    "_" and "-" make no difference.
    """

    def plain(word: str) -> str:
        return word.lower().replace("_", "-")

    originals: dict[str, str] = {}
    for word in known:
        originals.setdefault(plain(word), word)
    wrong = plain(str(name))
    for least in (max(cutoff, MISSPELT_LIKENESS), cutoff):
        if close := difflib.get_close_matches(wrong, originals, n=1, cutoff=least):
            return originals[close[0]]
        if begun := [word for word in originals if wrong.startswith(f"{word}-")]:
            return originals[max(begun, key=len)]
    return None


def suggest(name: str, known: Iterable[str], cutoff: float = OFFERED_LIKENESS) -> str:
    """The end of a sentence about a wrong name: "; did you mean 'x'?", else what names there are.

    Empty where there are none.
    """
    names = list(known)
    nearest = find_nearest(name, names, cutoff)
    if nearest is not None:
        return f"; did you mean {nearest!r}?"
    return f"; known are: {', '.join(names)}" if names else ""
