"""Materials by name: equation of state and density at rest, with the source of the numbers.

The library is `materials.toml` beside this file.  A user's own file has the same form; a material
of it is called "FILE.toml:NAME", the file looked for from the current directory.  The trap: a run
that is to go on elsewhere needs that file there too.
"""

from __future__ import annotations

import difflib
import functools
import tomllib
from dataclasses import dataclass, fields
from pathlib import Path

from hydro.eos import EQUATIONS_OF_STATE, EquationOfState
from regrid.errors import BadInput

LIBRARY = Path(__file__).with_name("materials.toml")


@dataclass(frozen=True)
class Material:
    """A material's equation of state, its density at rest in kg/m³, and where they come from."""

    eos: EquationOfState
    rho0: float
    source: str


def _hint(name: str, known) -> str:
    close = difflib.get_close_matches(name, list(known), n=1, cutoff=0.3)
    return f"; did you mean {close[0]!r}?" if close else ""


def make_material(where: str, table: dict, folder: Path) -> Material:
    """Material of a TOML table; `where` begins the sentence about a mistake (BadInput).

    Paths in it (of a table of pressures) are looked for beside the file, in `folder`.
    """
    if not isinstance(table, dict):
        raise BadInput(f"{where}: it must be a table with `eos`, `source` and parameters")
    numbers = dict(table)
    kind, source = numbers.pop("eos", None), numbers.pop("source", None)
    if kind not in EQUATIONS_OF_STATE:
        raise BadInput(
            f"{where}: eos is {kind!r}{_hint(str(kind), EQUATIONS_OF_STATE)} (known: "
            f"{', '.join(EQUATIONS_OF_STATE)})"
        )
    if not isinstance(source, str) or not source.strip():
        raise BadInput(f"{where}: `source` is missing; say where its numbers come from")
    eos_class = EQUATIONS_OF_STATE[kind]
    wanted = {field.name: field.type for field in fields(eos_class) if field.init}
    rho0 = numbers.get("rho0")
    if "rho0" not in wanted:
        numbers.pop("rho0", None)
    for key, value in numbers.items():
        if key not in wanted:
            raise BadInput(
                f"{where}: {kind} has no parameter {key!r}{_hint(key, wanted)} (it has: "
                f"{', '.join(wanted)})"
            )
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if wanted[key] == "float" and not is_number:
            raise BadInput(f"{where}: {key} is {value!r}; it must be a number in SI units")
    missing = [key for key in wanted if key not in numbers and key not in eos_class.optional]
    if missing or rho0 is None:
        raise BadInput(f"{where}: {', '.join(missing or ['rho0'])} is missing")
    if "path" in numbers:
        numbers["path"] = str(folder / str(numbers["path"]))
    try:
        eos = eos_class(**numbers)
    except BadInput as error:
        raise BadInput(f"{where}: {error}") from None
    if not rho0 > 0.0:
        raise BadInput(f"{where}: rho0 is {rho0:g}; it must be positive")
    return Material(eos, float(rho0), source)


@functools.cache
def _read_tables(path: Path) -> dict[str, dict]:
    """The tables of a TOML file as they stand there; BadInput where it cannot be read."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise BadInput(f"materials: there is no file {str(path)!r}") from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise BadInput(f"materials: {path} cannot be read: {error}") from None


@functools.cache
def _read_material(path: Path, name: str) -> Material:
    where = f"material {name!r} in {path.name}"
    return make_material(where, _read_tables(path)[name], path.parent)


def read_materials(path: Path) -> dict[str, Material]:
    """All materials of a TOML file; BadInput names file, material and mistake."""
    return {name: _read_material(path, name) for name in _read_tables(path)}


MATERIALS: dict[str, Material] = read_materials(LIBRARY)


def find_material(name: str) -> Material:
    """Material `name` of the library, or "FILE.toml:NAME"; BadInput with the nearest name.

    Of a user's file only the material asked for is looked at: a mistake elsewhere is no matter.
    """
    path, colon, own = name.rpartition(":")
    path, own = (Path(path), own) if colon and path.endswith(".toml") else (LIBRARY, name)
    tables = _read_tables(path)
    if own not in tables:
        raise BadInput(
            f"there is no material {name!r}{_hint(own, tables)} (known: "
            f"{', '.join(tables)}; or FILE.toml:NAME for one of your own)"
        )
    return _read_material(path, own)
