"""Files that decks name: a relative path is looked for beside the deck."""

from __future__ import annotations

from pathlib import Path


def place_file(name: str, folder: Path) -> str:
    """The full path of file `name`, from `folder` where it is relative; ~ is the home folder."""
    return str((folder / Path(name).expanduser()).resolve())
