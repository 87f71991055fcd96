"""All kinds of trials."""

from __future__ import annotations

from pathlib import Path

from soak.decks import DeckRuns, Decks
from soak.disks import Disks
from soak.flips import Flips
from soak.kills import Kills
from soak.rivals import Clocks, Rivals
from soak.settings import Settings
from soak.small_runs import Undisturbed
from soak.trial import Kind


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
