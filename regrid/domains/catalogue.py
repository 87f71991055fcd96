"""Named domains with a moving boundary, for marching a regridder without flow.

`domains.papers` holds the papers' and the bent walls, `domains.gallery` those of the literature,
`domains.bent_sides` those that bend on all four sides;
`domains.moving` says what a domain is.
"""

from __future__ import annotations

from collections.abc import Callable

from regrid.domains.bent_sides import (
    bulged_chevron,
    crescent,
    cushion,
    nozzle,
    pinched,
    waves,
)
from regrid.domains.gallery import airfoil, annulus, chicane, horseshoe, swan
from regrid.domains.moving import MovingDomain, transpose_nodes
from regrid.domains.papers import (
    chevron,
    curled_fingers,
    dome,
    five_fingers,
    hooked_fingers,
    jet,
    overhung_fingers,
    rectangle_shift,
    single_finger,
    slender_finger,
    strip,
    three_fingers,
    valley,
)
from regrid.errors import BadInput, suggest

__all__ = ["DOMAINS", "MovingDomain", "make_domain", "three_fingers", "transpose_nodes"]

DOMAINS: dict[str, Callable[..., MovingDomain]] = {
    "three_fingers": three_fingers,
    "five_fingers": five_fingers,
    "curled_fingers": curled_fingers,
    "overhung_fingers": overhung_fingers,
    "hooked_fingers": hooked_fingers,
    "single_finger": single_finger,
    "slender_finger": slender_finger,
    "strip": strip,
    "jet": jet,
    "dome": dome,
    "valley": valley,
    "chevron": chevron,
    "rectangle_shift": rectangle_shift,
    "swan": swan,
    "horseshoe": horseshoe,
    "annulus": annulus,
    "airfoil": airfoil,
    "chicane": chicane,
    "nozzle": nozzle,
    "waves": waves,
    "cushion": cushion,
    "pinched": pinched,
    "crescent": crescent,
    "bulged_chevron": bulged_chevron,
}


def make_domain(name: str, ni: int, nj: int) -> MovingDomain:
    """The named domain at ni × nj cells; raises BadInput for an unknown name."""
    key = name.replace("-", "_")
    if key not in DOMAINS:
        raise BadInput(f"domain: no domain is called '{name}'{suggest(name, DOMAINS)}")
    if ni < 2 or nj < 2:
        raise BadInput(f"domain: '{name}' needs at least 2 x 2 cells, got {ni} x {nj}")
    return DOMAINS[key](ni, nj)
