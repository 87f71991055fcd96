"""Solids in decks: the keys `material` and `strength`, and blocks with both."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.eos.materials import Material, choose_strength, find_material, make_material
from shockgrid.hydro.strength.laws import StrengthLaw
from shockgrid.hydro.strength.laws.base import make_law
from shockgrid.hydro.strength.spall import SPALL_LAWS, SpallLaw
from shockgrid.problems.deck import key
from shockgrid.problems.references.elastic_plastic import Solid, make_solid_at_rest

Table = dict[str, bool | int | float | str]
SolidMaterial = key(str | Table, "a name, FILE.toml:NAME, or a table with eos, rho0 and so on")
Strength = key(
    bool | str | Table,
    "law of strength: true: the material's own; a name: the law of this kind that it has; a table: "
    'such as { law = "perfect", shear_modulus = 27.6e9, yield_strength = 0.3e9 }; false: none, it '
    "is a fluid",
)


Spall = key(
    Table,
    'law of spall, a table with its parameters, such as { law = "cochran-banner", stress = 1.2e9, '
    "width = 1e-4 }. If left out: voids open at the material's `strength`",
)


def find_spall(table: Mapping[str, Any]) -> SpallLaw | None:
    """The law of spall of a deck's table, None for an empty one; BadInput for what makes none."""
    if not table:
        return None
    return make_law("deck: spall", table, SPALL_LAWS, 0.0, "spall")


def find_solid(
    where: str, material: str | Mapping[str, Any], strength: Any
) -> tuple[Material, StrengthLaw | None]:
    """The material that a deck names or describes, and the law of strength that it chooses.

    where: the keys in the deck, which begin the sentence of a BadInput.
    """
    if isinstance(material, str):
        found = find_material(material)
    else:
        found = make_material(f"deck: {where}", {"source": "the deck", **material}, Path())
    return found, choose_strength(f"deck: {where}, strength", found, strength)


def idealise(material: Material, law: StrengthLaw | None) -> Solid:
    """The elastic, perfectly plastic solid of exact waves: that of the law at rest."""
    if law is None:
        return Solid(material.eos, material.rho0, 0.0, 0.0)
    return make_solid_at_rest(material, law)


def find_stress(block: Block) -> np.ndarray:
    """Compressive stress (ni, nj) [Pa] of a block's cells along x: p, less s_xx of a solid."""
    fields = block.cell_fields
    return fields["p"] - fields["s_xx"] if "s_xx" in fields else fields["p"]
