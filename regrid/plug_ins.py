"""Extensions from other packages: problems, equations of state, regridders and so on.

A distribution names its class in an entry point of one of the GROUPS, as the packaging standard
prescribes, in its pyproject.toml:

    [project.entry-points."shockgrid.regridders"]
    averaged = "averaged:AveragedRegridder"

The names of shockgrid itself have priority; those of other packages are searched only for names
that it lacks.  A module is imported when its name is used.  If the import fails, there is an error
message for this name, and all others continue to work.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from shockgrid.regrid.errors import BadInput

GROUPS = {
    "shockgrid.problems": "problem",
    "shockgrid.eos": "equation of state",
    "shockgrid.strength": "law of strength",
    "shockgrid.regridders": "regridder",
    "shockgrid.boundaries": "boundary kind",
    "shockgrid.columns": "group of history columns",
}


@dataclass(frozen=True)
class PlugIn:
    """A name of a group, where it points to ("module:attribute"), and whose it is."""

    group: str
    name: str
    value: str
    distribution: str
    version: str

    @property
    def origin(self) -> str:
        """The distribution with its version."""
        return f"{self.distribution} {self.version}".strip()

    def load(self) -> Any:
        """Import what the name stands for; BadInput, naming the distribution, where that fails."""
        from importlib.metadata import EntryPoint

        try:
            loaded = EntryPoint(self.name, self.value, self.group).load()
        except Exception as error:  # whatever somebody else's module raises
            raise BadInput(
                f"{GROUPS[self.group]} {self.name!r} of the package {self.origin} cannot be "
                f"imported from {self.value} ({type(error).__name__}: {error})"
            ) from error
        if not callable(loaded):
            raise BadInput(
                f"{GROUPS[self.group]} {self.name!r} of the package {self.origin}: {self.value} is "
                f"neither a class nor a function, but of type {type(loaded).__name__}"
            )
        return loaded


@functools.cache
def find_plug_ins(group: str) -> tuple[PlugIn, ...]:
    """All that the installed distributions have in a group, by name; none is imported.

    A distribution that is on the path twice counts once, as Python would import it.
    """
    from importlib.metadata import distributions

    entries = []
    seen = set()
    for distribution in distributions():
        name = str(distribution.metadata["Name"])
        if name in seen:
            continue
        seen.add(name)
        entries += [
            PlugIn(group, entry.name, entry.value, name, str(distribution.version))
            for entry in distribution.entry_points
            if entry.group == group
        ]
    return tuple(sorted(entries, key=lambda entry: (entry.name, entry.distribution)))


class PlugIns(Mapping[str, Any]):
    """A group as a mapping: names of the installed packages, and what they stand for.

    The second map of a registry, `ChainMap({...}, PlugIns("shockgrid.eos"))`.  Asking for a name
    raises BadInput where its module cannot be imported, or two packages have the same name.
    """

    def __init__(self, group: str):
        self.group = group

    def find(self, name: str) -> PlugIn:
        """Where a name points to; KeyError without it, BadInput where two packages have it."""
        entries = [entry for entry in find_plug_ins(self.group) if entry.name == name]
        if not entries:
            raise KeyError(name)
        if len(entries) > 1:
            origins = " and ".join(entry.origin for entry in entries)
            raise BadInput(
                f"the {GROUPS[self.group]} {name!r} is in {len(entries)} installed packages, "
                f"{origins}; uninstall all but one"
            )
        return entries[0]

    def __getitem__(self, name: str) -> Any:
        return self.find(name).load()

    def __contains__(self, name: object) -> bool:
        return any(entry.name == name for entry in find_plug_ins(self.group))

    def __iter__(self) -> Iterator[str]:
        return iter(dict.fromkeys(entry.name for entry in find_plug_ins(self.group)))

    def __len__(self) -> int:
        return len(list(iter(self)))
