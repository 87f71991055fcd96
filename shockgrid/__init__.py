"""The public face: what a person types in a notebook, loaded when it is first asked for.

May import: `regrid`, `hydro`, `problems`, `runs`, and only inside functions, so that `import
shockgrid` loads nothing heavy and another package called `runs` is found out before it is run.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from regrid.barrier.regridder import BarrierRegridder
    from regrid.errors import BadInput, RegridFailure

    __version__: str

MODULES = {
    "BadInput": "regrid.errors",
    "BarrierRegridder": "regrid.barrier.regridder",
    "RegridFailure": "regrid.errors",
}

__all__ = ["BadInput", "BarrierRegridder", "RegridFailure", "__version__"]


def __getattr__(name: str) -> object:
    """A public name, imported now; ImportError where another package hides ours."""
    if name == "__version__":
        value: object = _find_version()
    elif name in MODULES:
        from shockgrid.shadowing import find_shadow

        if shadow := find_shadow():
            raise ImportError(shadow)
        value = getattr(importlib.import_module(MODULES[name]), name)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def _find_version() -> str:
    """The version of the installed distribution; in a bare checkout that of pyproject.toml."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("shockgrid")
    except PackageNotFoundError:
        import tomllib
        from pathlib import Path

        try:
            text = Path(__file__).parents[1].joinpath("pyproject.toml").read_text(encoding="utf-8")
            return tomllib.loads(text)["project"]["version"]
        except (OSError, KeyError, tomllib.TOMLDecodeError):
            return "unknown"
