"""Solids in decks: the keys `strength` and `spall` of all bodies, and blocks with both.

A problem with bodies derives its deck from `SolidDeck` and gives each block the options of its
body, which `find_laws` chooses from the deck and the bodies' materials.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.eos.materials import (
    Material,
    check_solid,
    choose_strength,
    find_material,
    make_material,
)
from shockgrid.hydro.strength.laws import StrengthLaw
from shockgrid.hydro.strength.laws.base import make_law
from shockgrid.hydro.strength.spall import SPALL_LAWS, ConstantSpall, SpallLaw
from shockgrid.problems.deck import Deck, DeckTable, key
from shockgrid.problems.references.elastic_plastic import Solid, make_solid_at_rest
from shockgrid.regrid.errors import BadInput

LARGEST_CFL_OF_SPALL = 0.4  # up to here plates with spall kept their speeds in all impacts tried

Table = dict[str, bool | int | float | str]
SolidMaterial = key(str | Table, "a name, FILE.toml:NAME, or a table with eos, rho0 and so on")
# of one body; of all bodies, or a table of what holds for each of them
BodyChoice = bool | str | Table
Choice = bool | str | dict[str, bool | int | float | str | Table]
Strength = key(
    Choice,
    "law of strength of all bodies: true: that of the material, where it has one; a name: the law "
    'of this kind that it has; a table: such as { law = "perfect", shear_modulus = 27.6e9, '
    "yield_strength = 0.3e9 }; false: none, bodies are fluids; or one of these for each body by "
    "its name",
)
Spall = key(
    Choice,
    "law of spall of all bodies with strength: true: the material's spall_law, or its tension as a "
    'constant; a table, such as { law = "cochran-banner", stress = 1.2e9, width = 1e-4 }; false: '
    "voids open at the material's tension, and close again; or one of these for each body by its "
    "name",
)


class SolidDeck(Deck, kw_only=True):
    """A deck with bodies that may bear shear and spall."""

    strength: Strength = False
    spall: Spall = False

    def find_cautions(self) -> list[str]:
        """Whether broken cells may gain kinetic energy at the cost of their internal energy."""
        cfl = self.run.cfl
        if not self.spall or cfl <= LARGEST_CFL_OF_SPALL:
            return []
        return [
            f"with spall and run.cfl = {cfl:g} broken cells may gain more kinetic energy than the "
            "bodies have, and bodies their speed; the total energy does not show it: compare with "
            f"run.cfl={LARGEST_CFL_OF_SPALL:g}"
        ]


class BodyTable(DeckTable, kw_only=True):
    """The table of one body in a deck with a list of them."""

    strength: key(BodyChoice | None, "as the deck's, of this body. If left out: the deck's") = None
    spall: key(BodyChoice | None, "as the deck's, of this body. If left out: the deck's") = None


@dataclass(frozen=True)
class SolidLaws:
    """What a body is made of beside its equation of state; None: it bears no shear, no spall."""

    strength: StrengthLaw | None = None
    spall: SpallLaw | None = None

    @property
    def options(self) -> dict[str, Any]:
        """Options of a `Block`."""
        return {"strength": self.strength, "spall": self.spall}


def find_laws(
    deck: SolidDeck,
    materials: Mapping[str, Material],
    tables: Mapping[str, BodyTable] | None = None,
) -> dict[str, SolidLaws]:
    """The laws of all bodies by name, from a deck and the bodies' materials.

    tables: of bodies, by name, whose keys count before the deck's.  Raises BadInput for a law that
    a material cannot have, a body that is not there, and a spall of what has no strength.
    """
    tables = tables or {}
    own_strengths = {name: table.strength for name, table in tables.items()}
    strengths = _choose_for_bodies(
        "strength", deck.strength, own_strengths, materials, choose_strength
    )
    solids = {name: materials[name] for name in materials if strengths[name] is not None}
    own_spalls = {name: table.spall for name, table in tables.items()}
    for_all = not isinstance(deck.spall, Mapping) or "law" in deck.spall
    if deck.spall and for_all and not solids:
        raise deck.error(
            "spall", "a law of spall wants a law of strength besides; give `strength`, too"
        )
    # what is said of all bodies is of the solids among them
    spalling = {
        name: material
        for name, material in materials.items()
        if name in solids or not for_all or own_spalls.get(name) is not None
    }
    spalls = _choose_for_bodies("spall", deck.spall, own_spalls, spalling, choose_spall)
    laws = {name: SolidLaws(strengths[name], spalls.get(name)) for name in materials}
    for name, body in laws.items():
        if body.spall is not None and body.strength is None:
            raise BadInput(
                f"deck: spall of {name}: a law of spall wants a law of strength besides, and "
                f"{name} has none"
            )
    return laws


def _choose_for_bodies(
    key_name: str,
    choice: Any,
    own_choices: Mapping[str, Any],
    materials: Mapping[str, Material],
    choose: Any,
) -> dict[str, Any]:
    """The law of each body by name; None where it has none.

    choice: the deck's; own_choices: those of bodies, None where they have none.
    choose: (where, material, choice) -> the law of a material, see `choose_strength`.
    """
    laws = {
        name: choose(f"deck: {key_name} of {name}", materials[name], own)
        for name, own in own_choices.items()
        if own is not None and name in materials
    }
    others = {name: material for name, material in materials.items() if name not in laws}
    chosen = _choose_by_deck(key_name, choice, others, choose, list(materials))
    return {name: laws.get(name, chosen.get(name)) for name in materials}


def _choose_by_deck(
    key_name: str, choice: Any, materials: Mapping[str, Material], choose: Any, bodies: list[str]
) -> dict[str, Any]:
    """The laws of materials by the name of their body, as a deck's key chooses for all `bodies`."""
    by_body = isinstance(choice, Mapping) and "law" not in choice
    if by_body:
        for name in choice:
            if name not in bodies:
                raise BadInput(
                    f"deck: {key_name}.{name}: there is no body {name!r}; the bodies are "
                    f"{', '.join(bodies)}, and a law has a key `law`"
                )
        return {
            name: choose(f"deck: {key_name}.{name}", material, choice.get(name, False))
            for name, material in materials.items()
        }
    if choice is not True:
        return {
            name: choose(_name_place(key_name, name, bodies), material, choice)
            for name, material in materials.items()
        }
    # true: where the material has a law
    laws = {}
    refusals = []
    for name, material in materials.items():
        try:
            laws[name] = choose(_name_place(key_name, name, bodies), material, True)
        except BadInput as error:
            laws[name] = None
            refusals.append(error)
    if refusals and len(refusals) == len(materials):
        raise refusals[0]
    return laws


def _name_place(key_name: str, name: str, bodies: list[str]) -> str:
    """The beginning of a sentence on the law of a body, which is named where there are several."""
    return f"deck: {key_name}" + (f" of {name}" if len(bodies) > 1 else "")


def choose_spall(where: str, material: Material, choice: Any) -> SpallLaw | None:
    """The law of spall of a deck's value: True, that of the material, or a table of a law and its
    parameters; None for False and an empty table.

    A material without a `spall_law` breaks for good at its tension, the `strength` of its equation
    of state.  Raises BadInput, which begins with `where`.
    """
    if choice is False or choice == {}:
        return None
    check_solid(where, material.eos)
    if isinstance(choice, Mapping):
        return make_law(where, choice, SPALL_LAWS, material.rho0, "spall")
    if choice is not True:
        raise BadInput(
            f"{where}: it is {choice!r}; true, false or a table is wanted, such as "
            '{ law = "constant", stress = 1.2e9 }'
        )
    if material.spall is not None:
        return make_law(f"{where}, spall_law", material.spall, SPALL_LAWS, material.rho0, "spall")
    tension = getattr(material.eos, "strength", 0.0)
    if not tension > 0.0:
        raise BadInput(
            f"{where}: the material has no spall_law and no tension; give a table, such as "
            '{ law = "constant", stress = 1.2e9 }'
        )
    return ConstantSpall(tension)


def list_fluids(laws: Mapping[str, SolidLaws]) -> list[str]:
    """A sentence if some bodies bear shear, and others do not."""
    fluids = [name for name, body in laws.items() if body.strength is None]
    if not fluids or len(fluids) == len(laws):
        return []
    return [f"{', '.join(fluids)}: without a law of strength, a fluid among solids"]


def find_solid_material(where: str, material: str | Mapping[str, Any]) -> Material:
    """The material that a deck names or describes.

    where: the key in the deck, which begins the sentence of a BadInput.
    """
    if isinstance(material, str):
        return find_material(material)
    return make_material(f"deck: {where}", {"source": "the deck", **material}, Path())


def idealise(material: Material, law: StrengthLaw | None) -> Solid:
    """The elastic, perfectly plastic solid of exact waves: that of the law at rest."""
    if law is None:
        return Solid(material.eos, material.rho0, 0.0, 0.0)
    return make_solid_at_rest(material, law)


def find_stress(block: Block) -> np.ndarray:
    """Compressive stress (ni, nj) [Pa] of a block's cells along x: p, less s_xx of a solid."""
    fields = block.cell_fields
    return fields["p"] - fields["s_xx"] if "s_xx" in fields else fields["p"]
