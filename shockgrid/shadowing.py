"""Checks, before any import, that the packages Python would import are shockgrid's own.

The import names are short, and a distribution on the package index, a dependency of `inquirer`,
also installs a package `runs`.  If both are in one environment, Python may find the other one
first.  A folder or a file of such a name in the current directory can hide ours too.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path

PACKAGES = ("regrid", "hydro", "problems", "runs")
HOME = Path(__file__).resolve().parents[1]  # the folder in which all five packages lie
WAY_OUT = "install shockgrid in a separate environment (python3 -m venv) and run it there"


def find_shadow() -> str:
    """A sentence about the first package that would not be shockgrid's own; "" if all are."""
    for package in PACKAGES:
        if sentence := _describe_shadow(package):
            return sentence
    return ""


def _describe_shadow(package: str) -> str:
    spec = importlib.util.find_spec(package)
    if spec is None:
        return f"the package {package!r} is missing beside {HOME / 'shockgrid'}; {WAY_OUT}"
    if spec.origin is None:  # a folder without __init__.py
        found = Path(next(iter(spec.submodule_search_locations or [package])))
    else:
        found = Path(spec.origin)
        if found.resolve() == HOME / package / "__init__.py":
            return ""
    return (
        f"{_find_owner(found)}{found} hides shockgrid's own package {package!r}, which has the "
        f"same import name; {WAY_OUT}"
    )


def _find_owner(found: Path) -> str:
    """A description of the distribution that installed a file; "" if none lists it."""
    from importlib import metadata  # slow to load

    tail = "/".join(found.parts[-2:])
    for distribution in metadata.distributions():
        for file in distribution.files or ():
            if str(file) == tail and Path(str(distribution.locate_file(file))) == found:
                name = distribution.metadata["Name"]
                return f"the distribution {name} {distribution.version} with its "
    return ""
