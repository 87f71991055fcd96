"""Materials by name: equation of state and density at rest, with the source of the numbers.

The library is `materials.toml` beside this file.  A user's own file has the same form; a material
of it is called "FILE.toml:NAME".  A deck looks for the file in its own folder, then in the current
directory, and a run keeps its full path and digest.  A file is read whenever one of its materials
is asked for, so an edited one counts from then on.
"""

from __future__ import annotations

import functools
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from pathlib import Path

from shockgrid.hydro.eos import EQUATIONS_OF_STATE, EquationOfState
from shockgrid.hydro.strength.laws import STRENGTH_LAWS, StrengthLaw
from shockgrid.hydro.strength.laws.base import make_law
from shockgrid.regrid.errors import BadInput, find_nearest
from shockgrid.regrid.text_files import load_toml, read_text

KEPT_TEXTS = 32  # of files of materials that are parsed once, as long as they stay as they are
LIBRARY = Path(__file__).with_name("materials.toml")


@dataclass(frozen=True)
class Material:
    """A material's equation of state, its density at rest in kg/m³, and where they come from.

    names: other names by which it is found; strength: of a solid, None for fluids and for solids
    whose strength is not known.  strengths: all laws that are known for it, the first being
    `strength`, and strength_sources: where the numbers of each come from.  spall: the table of the
    law by which it opens under tension, if one is known, and spall_source.
    """

    eos: EquationOfState
    rho0: float
    source: str
    names: tuple[str, ...] = ()
    strength: StrengthLaw | None = None
    strengths: tuple[StrengthLaw, ...] = ()
    strength_sources: tuple[str, ...] = ()
    spall: Mapping[str, object] | None = None
    spall_source: str = ""


def _hint(name: str, known) -> str:
    nearest = find_nearest(name, known)
    return f"; did you mean {nearest!r}?" if nearest is not None else ""


def make_material(where: str, table: dict, folder: Path) -> Material:
    """Material of a TOML table; `where` begins the line about each mistake in it (BadInput).

    Paths in it (of a table of pressures) are looked for beside the file, in `folder`.
    """
    if not isinstance(table, dict):
        raise BadInput(f"{where}: it must be a table with `eos`, `source` and parameters")
    mistakes = list(_find_mistakes(table))
    if mistakes:
        raise BadInput("\n".join(f"{where}: {mistake}" for mistake in mistakes))
    numbers = dict(table)
    eos_class = EQUATIONS_OF_STATE[numbers.pop("eos")]
    source = numbers.pop("source")
    names = tuple(numbers.pop("names", ()))
    heat_capacity = numbers.pop("heat_capacity", None)
    strength_tables = numbers.pop("strength_law", [])
    spall = numbers.pop("spall_law", None)
    rho0 = numbers["rho0"]
    if "rho0" not in _list_parameters(eos_class):
        del numbers["rho0"]
    if "path" in numbers:
        numbers["path"] = str(folder / str(numbers["path"]))
    try:
        eos = eos_class(**numbers)
        if heat_capacity is not None:
            eos = eos.with_heat_capacity(heat_capacity)
    except BadInput as error:
        raise BadInput(f"{where}: {error}") from None
    laws = []
    sources = []
    for one in strength_tables if isinstance(strength_tables, list) else [strength_tables]:
        law_table = dict(one) if isinstance(one, Mapping) else one
        if isinstance(law_table, dict):
            sources.append(str(law_table.pop("source", source)))
        laws.append(make_strength(f"{where}, strength_law", law_table, eos, float(rho0)))
    first = laws[0] if laws else None
    spall_source = ""
    if spall is not None:
        spall = dict(spall)
        spall_source = str(spall.pop("source", source))
    return Material(
        eos,
        float(rho0),
        source,
        names,
        first,
        tuple(laws),
        tuple(sources),
        spall,
        spall_source,
    )


def choose_strength(where: str, material: Material, choice: object) -> StrengthLaw | None:
    """The law of strength of a deck's value: True, the kind of a law that the material has, or a
    table of a law and its parameters; None for False or None.

    Raises BadInput, which begins with `where`, for a material without such a law.
    """
    if choice is None or choice is False:
        return None
    check_solid(where, material.eos)
    if isinstance(choice, Mapping):
        return make_strength(where, choice, material.eos, material.rho0)
    kinds = [law.kind for law in material.strengths]
    if choice is True and kinds:
        return material.strength
    if choice in kinds:
        return material.strengths[kinds.index(str(choice))]
    known = f"it has {', '.join(kinds)}" if kinds else "it has none"
    missing = "law of strength" if choice is True else f"such law of strength, {choice!r}"
    raise BadInput(
        f"{where}: the material has no {missing} ({known}); give a table, "
        'such as { law = "perfect", shear_modulus = 27.6e9, yield_strength = 0.3e9 }'
    )


def make_strength(where: str, table: object, eos: EquationOfState, rho0: float) -> StrengthLaw:
    """The law of strength of a table of its kind `law` and parameters, for a material.

    Raises BadInput, which begins with `where`, for a table that makes no law, and for a gas.
    """
    if not isinstance(table, Mapping):
        raise BadInput(f"{where}: it is {table!r}; a table with law and parameters is wanted")
    check_solid(where, eos)
    return make_law(where, table, STRENGTH_LAWS, rho0)


def check_solid(where: str, eos: EquationOfState) -> None:
    """Raise BadInput where an equation of state is that of a gas, which bears no shear."""
    if not eos.opens_voids:
        raise BadInput(f"{where}: strength is for solids, and {eos.kind!r} is a gas")


def _list_parameters(eos_class: type[EquationOfState]) -> dict[str, str]:
    """The parameters of a kind with the names of their types."""
    return {
        field.name: field.type if isinstance(field.type, str) else field.type.__name__
        for field in fields(eos_class)
        if field.init
    }


def _find_mistakes(table: dict) -> Iterator[str]:
    """What is wrong with a material's table, as far as each number tells by itself."""
    # where it comes from, and which equation of state
    kind = table.get("eos")
    source = table.get("source")
    if not isinstance(source, str) or not source.strip():
        yield "`source` is missing; say where its numbers come from"
    if not isinstance(kind, str) or kind not in EQUATIONS_OF_STATE:
        hint = _hint(str(kind), EQUATIONS_OF_STATE)
        yield f"eos is {kind!r}{hint} (known: {', '.join(EQUATIONS_OF_STATE)})"
        return
    # each parameter by itself
    eos_class = EQUATIONS_OF_STATE[kind]
    wanted = _list_parameters(eos_class)
    for key, value in table.items():
        if key in ("eos", "source", "heat_capacity", "strength_law"):
            continue
        if key == "spall_law":
            if not isinstance(value, dict):
                yield f"spall_law is {value!r}; a table with law and parameters is wanted"
            continue
        if key == "names":
            if not isinstance(value, list) or not all(isinstance(one, str) for one in value):
                yield f"names is {value!r}; it must be a list of names"
            continue
        if key not in wanted and key != "rho0":
            hint = _hint(key, wanted)
            yield f"{kind} has no parameter {key!r}{hint} (it has: {', '.join(wanted)})"
        elif key == "rho0" or wanted[key] == "float":
            if not isinstance(value, int | float) or isinstance(value, bool):
                yield f"{key} is {value!r}; it must be a number in SI units"
            elif (key == "rho0" or key in eos_class.positive) and not value > 0.0:
                yield f"{key} is {value:g}; it must be positive"
    # those that are missing
    needed = [key for key in wanted if key not in eos_class.optional]
    missing = [key for key in dict.fromkeys([*needed, "rho0"]) if key not in table]
    if missing:
        yield f"{', '.join(missing)} {'is' if len(missing) == 1 else 'are'} missing"


def _read_tables(path: Path) -> dict[str, dict]:
    """The tables of a TOML file as they stand there now; BadInput where it cannot be read."""
    try:
        return _parse_tables(read_text(path))
    except FileNotFoundError:
        raise BadInput(f"materials: there is no file {str(path)!r}") from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise BadInput(f"materials: {path} cannot be read: {error}") from None


@functools.lru_cache(maxsize=KEPT_TEXTS)
def _parse_tables(text: str) -> dict[str, dict]:
    return load_toml(text)


def _make_own(path: Path, name: str, tables: dict[str, dict]) -> Material:
    return make_material(f"material {name!r} in {path.name}", tables[name], path.parent)


def read_materials(path: Path) -> dict[str, Material]:
    """All materials of a TOML file; BadInput names file, material and mistake."""
    tables = _read_tables(path)
    return {name: _make_own(path, name, tables) for name in tables}


def _list_names(tables: dict[str, dict]) -> dict[str, str]:
    """All names in small letters, and the material of each; a name of two materials is left out."""
    materials_by_name: dict[str, set[str]] = {}
    for name, table in tables.items():
        other_names = table.get("names", ()) if isinstance(table, dict) else ()
        for one in (name, *filter(lambda other: isinstance(other, str), other_names)):
            materials_by_name.setdefault(one.lower(), set()).add(name)
    return {
        one: materials.pop() for one, materials in materials_by_name.items() if len(materials) == 1
    }


def _find_table(name: str) -> tuple[Path, str]:
    """File of material `name` and its name there; BadInput with the nearest name."""
    file, colon, own = name.rpartition(":")
    path, own = (Path(file), own) if colon and file.endswith(".toml") else (LIBRARY, name)
    tables = _read_tables(path)
    if own in tables:
        return path, own
    names = _list_names(tables)
    if own.lower() in names:
        return path, names[own.lower()]
    raise BadInput(
        f"there is no material {name!r}{_hint(own, [*tables, *names])} (known: "
        f"{', '.join(tables)}; or FILE.toml:NAME for one of your own)"
    )


def find_name(name: str) -> str:
    """The name under which the library, or FILE.toml, lists a material: "Cu" of "copper"."""
    return _find_table(name)[1]


def find_material(name: str) -> Material:
    """Material `name` of the library, or "FILE.toml:NAME"; BadInput with the nearest name.

    A name may be one of the material's others, such as "copper" of Cu, in large or small letters.
    In a user's file only the material asked for is looked at: a mistake elsewhere is no matter.
    """
    path, material_name = _find_table(name)
    return _make_own(path, material_name, _read_tables(path))
