"""Files that decks name: where they are looked for, and whether they are still as they were."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from pathlib import Path

from regrid.errors import BadInput


def place_file(name: str, folder: Path) -> str:
    """The full path of file `name`, from `folder` where it is relative; ~ is the home folder."""
    return str((folder / Path(name).expanduser()).resolve())


def compute_digests(names: Iterable[str], known: Mapping[str, str]) -> dict[str, str]:
    """The digests (sha256) of those of the files that can be read; known ones are kept."""
    digests = {}
    for name in dict.fromkeys(names):
        if name in known:
            digests[name] = known[name]
        elif Path(name).is_file():
            digests[name] = hashlib.sha256(Path(name).read_bytes()).hexdigest()
    return digests


def check_digests(digests: Mapping[str, str]) -> None:
    """Raise BadInput for a file that is gone or is no longer the one of its digest."""
    for name, digest in digests.items():
        if not Path(name).is_file():
            raise BadInput(f"{name}, which the deck names, is gone")
        if compute_digests([name], {})[name] != digest:
            raise BadInput(
                f"{name} has changed since this deck was kept (key digests): bring the file back, "
                "or begin a new run"
            )
