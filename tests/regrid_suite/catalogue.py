"""All marches of the suite by name.

Formulas of `shapes` and `solids`, the named domains of `regrid.domains`, and the sides of a
computed instability in data/mushroom_roll.npz.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path

import numpy as np

from regrid_suite import shapes, solids
from regrid_suite.marches import PLANE_SIDES, March, get_side, make_march
from shockgrid.regrid.algebraic import transfinite_grid
from shockgrid.regrid.domains import DOMAINS, make_domain
from shockgrid.regrid.errors import BadInput, suggest

DATA = Path(__file__).with_name("data")
ROLL_PARTS = 4  # steps from one dump of the roll to the next
LOW = ("j_min",)
BOTH = ("j_min", "j_max")
ALL = PLANE_SIDES

# name: the formula, cells, cells per step, the sides that deform
FORMULAS = {
    "comb": (shapes.comb, (40, 24), 0.5, BOTH),
    "opposed-tongues": (shapes.opposed_tongues, (32, 24), 0.5, BOTH),
    "wedge": (shapes.wedge, (36, 24), 0.5, LOW),
    "plate-on-wedge": (shapes.plate_on_wedge, (60, 10), 0.5, BOTH),
    "bubble": (shapes.bubble, (40, 20), 0.5, LOW),
    "flattened-bubble": (shapes.flattened_bubble, (40, 20), 0.5, LOW),
    "pillow": (shapes.pillow, (24, 24), 0.5, ALL),
    "nozzle-throat": (shapes.nozzle_throat, (48, 16), 0.5, BOTH),
    "piston": (shapes.piston, (32, 24), 0.5, ("i_min",)),
    "bumpy-piston": (shapes.bumpy_piston, (32, 24), 0.5, ("i_min",)),
    "four-waves": (shapes.four_waves, (32, 32), 0.25, ALL),
    "swinging-waves": (shapes.swinging_waves, (32, 32), 0.5, ALL),
    "pulse": (shapes.pulse, (32, 24), 0.5, LOW),
    "rough-tongue": (shapes.rough_tongue, (32, 24), 0.5, LOW),
    "shear": (shapes.shear, (24, 24), 0.5, ALL),
    "turn": (shapes.turn, (24, 16), 0.5, ALL),
    "step": (shapes.step, (40, 24), 0.5, LOW),
    "cusps": (shapes.cusps, (40, 24), 0.25, LOW),
    "squeezed-film": (shapes.squeezed_film, (32, 12), 0.5, ("j_max",)),
    "omega": (shapes.omega, (48, 24), 0.5, LOW),
    "vortex-roll": (shapes.vortex_roll, (40, 24), 0.5, ("j_max",)),
    "spiral-duct": (shapes.spiral_duct, (60, 8), 0.5, BOTH),
    "z-duct": (shapes.z_duct, (60, 8), 0.5, BOTH),
    "snake": (shapes.snake, (60, 8), 0.5, BOTH),
    "bumpy-piston-3d": (solids.bumpy_piston_3d, (12, 10, 10), 0.5, ("i_min",)),
    "twisted-duct-3d": (solids.twisted_duct_3d, (16, 8, 8), 0.5, BOTH),
    "bent-duct-3d": (solids.bent_duct_3d, (20, 8, 8), 0.5, BOTH),
    "tongue-3d": (solids.tongue_3d, (12, 12, 10), 0.5, ("k_min",)),
    "wavy-block-3d": (solids.wavy_block_3d, (12, 12, 12), 0.25, ALL),
}
# domains of `regrid.domains`: cells, where not (24, 32)
DOMAIN_CELLS = {"strip": (60, 24), "jet": (16, 48), "chicane": (60, 8), "annulus": (12, 48)}
LONG = {"five-cells-a-step": "curled_fingers", "five-cells-a-step-thin": "slender_finger"}
LONG_STEP = 5.0
ROLLS = {"mushroom-roll": "first", "mushroom-roll-heavy": "second"}
ROLL_WORDS = "The roll-up of a shocked interface, from the dumps of a computed flow."

NAMES: tuple[str, ...] = (
    *(name.replace("_", "-") for name in DOMAINS),
    *LONG,
    *ROLLS,
    *FORMULAS,
)


def load_march(name: str) -> March:
    """The march called `name`; raises BadInput, with the nearest name, where there is none."""
    if name not in NAMES:
        raise BadInput(f"march: none is called '{name}'{suggest(name, NAMES)}")
    if name in FORMULAS:
        return make_march(name, *FORMULAS[name])
    if name in ROLLS:
        return load_roll(name)
    domain = LONG.get(name, name.replace("-", "_"))
    return march_domain(name, domain, LONG_STEP if name in LONG else 0.5)


def tell(name: str) -> str:
    """What the march called `name` is, in one line; nothing is made."""
    if name in ROLLS:
        return ROLL_WORDS
    if name in FORMULAS:
        return read_words(FORMULAS[name][0])[0]
    return read_words(DOMAINS[LONG.get(name, name.replace("-", "_"))])[0]


def march_domain(name: str, domain: str, cells_a_step: float) -> March:
    """A domain of `regrid.domains`, its sides after equal parts of the fastest node's way."""
    moving = make_domain(domain, *DOMAIN_CELLS.get(domain, (24, 32)))
    steps = moving.steps_for(cells_a_step)
    parameter = np.linspace(0.0, 1.0, steps + 1)
    grids = [moving.boundary(s) for s in parameter]
    about, formula = read_words(DOMAINS[domain])
    return March(
        name=name,
        about=about,
        formula=formula,
        start=moving.start,
        sides={side: np.array([get_side(g, side) for g in grids]) for side in PLANE_SIDES},
        parameter=parameter,
        deforming=moving.deforming_sides,
    )


def read_words(make: Callable) -> tuple[str, str]:
    """First line and the rest of a docstring."""
    about, _, rest = (inspect.getdoc(make) or "").partition("\n")
    where = f"regrid.domains, {make.__name__}"
    return about, f"{where}; {' '.join(rest.split())}".removesuffix("; ")


def load_roll(name: str) -> March:
    """One gas of a Richtmyer-Meshkov mushroom: the sides and sound speeds of a computed flow.

    Between two dumps the sides go in straight lines, in `ROLL_PARTS` steps; sound speeds are those
    of the later dump.
    """
    gas = ROLLS[name]
    with np.load(DATA / "mushroom_roll.npz") as kept:
        times = kept["t"]
        dumped = kept[f"{gas}_sides"].astype(float)
        sound = kept[f"{gas}_sound"].astype(float)
        ni, nj = kept[f"{gas}_cells"]
    part = np.linspace(0.0, len(times) - 1.0, (len(times) - 1) * ROLL_PARTS + 1)
    before = np.minimum(part.astype(int), len(times) - 2)
    way = (part - before)[:, None, None]
    lines = (1.0 - way) * dumped[before] + way * dumped[before + 1]
    ends = np.cumsum([nj + 1, nj + 1, ni + 1])
    sides = dict(zip(PLANE_SIDES, np.split(lines, ends, axis=2), strict=True))
    start = np.full((2, ni + 1, nj + 1), np.nan)
    for side, line in sides.items():
        get_side(start, side)[...] = line[0]
    return March(
        name=name,
        about=ROLL_WORDS,
        formula="data/mushroom_roll.npz: sides at the times t, straight lines between them",
        start=transfinite_grid(start),
        sides=sides,
        parameter=np.interp(part, np.arange(len(times)), times),
        deforming=("i_max",) if gas == "first" else ("i_min",),
        sound=sound[np.ceil(part).astype(int)],
    )
