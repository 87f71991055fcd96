"""All kinds of trials."""

from __future__ import annotations

from pathlib import Path

from benchmarks.soak.decks import DeckRuns, Decks
from benchmarks.soak.disks import Disks
from benchmarks.soak.flips import Flips
from benchmarks.soak.kills import Kills
from benchmarks.soak.rivals import Clocks, Rivals
from benchmarks.soak.settings import Settings
from benchmarks.soak.small_runs import Undisturbed
from benchmarks.soak.trial import Kind


def make_kinds(seed: int, folder: Path) -> list[Kind]:
    """The kinds in the order of the table; what they share lies in `folder`."""
    (folder / "undisturbed").mkdir(parents=True, exist_ok=True)
    undisturbed = Undisturbed(folder / "undisturbed")
    return [
        Kills(seed, undisturbed),
        Decks(seed),
        DeckRuns(seed),
        Flips(seed, folder / "flips"),
        Disks(seed, undisturbed),
        Rivals(seed, undisturbed),
        Clocks(seed, undisturbed),
        Settings(seed),
    ]
