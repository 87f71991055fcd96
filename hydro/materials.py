"""Materials by name: equation of state and reference density, with the source of the numbers.

Mie–Grüneisen rows are second-hand from public shock-Hugoniot libraries, which scatter by 1–2 %
in c0; PMMA is from memory of the literature and should be checked before use.
"""

from __future__ import annotations

import difflib
from dataclasses import dataclass

from hydro.eos import EquationOfState, IdealGas, MieGruneisen, StiffenedGas
from regrid.errors import BadInput


@dataclass(frozen=True)
class Material:
    """A material's equation of state, its density at rest in kg/m³, and where they come from."""

    eos: EquationOfState
    rho0: float
    source: str


def _solid(rho0, c0, s, gruneisen, strength, source="public shock-Hugoniot libraries, second-hand"):
    """Strengths against spall: rounded values from memory of the literature, unverified."""
    return Material(MieGruneisen(rho0, c0, s, gruneisen, strength), rho0, source)


MATERIALS: dict[str, Material] = {
    "Al1100": _solid(2707.0, 5386.0, 1.339, 1.97, 1.0e9),
    "Al6061": _solid(2703.0, 5240.0, 1.40, 1.97, 1.2e9),
    "Cu": _solid(8930.0, 3940.0, 1.489, 1.99, 1.5e9),
    "SS304": _solid(7896.0, 4569.0, 1.490, 2.17, 3.0e9),
    "Fe": _solid(7850.0, 3574.0, 1.92, 1.8, 2.5e9),
    "Pb": _solid(11350.0, 2051.0, 1.46, 2.77, 0.5e9),
    "W": _solid(19224.0, 4029.0, 1.237, 1.54, 2.0e9),
    "PMMA": _solid(1186.0, 2598.0, 1.516, 0.97, 0.2e9, "from memory of the literature, unverified"),
    "water": Material(StiffenedGas(4.4, 6.0e8), 1000.0, "the usual choice of flow solvers"),
    "air": Material(IdealGas(1.4), 1.2, "diatomic ideal gas"),
    "SF6": Material(IdealGas(1.093), 6.12, "ideal gas with the gamma usual in shock tubes"),
}


def find_material(name: str) -> Material:
    """Material called `name`; raises BadInput naming the nearest one otherwise."""
    try:
        return MATERIALS[name]
    except KeyError:
        nearest = difflib.get_close_matches(name, MATERIALS, n=1, cutoff=0.3)
        hint = f"; did you mean {nearest[0]!r}?" if nearest else ""
        raise BadInput(
            f"there is no material {name!r}{hint} (known: {', '.join(MATERIALS)})"
        ) from None
