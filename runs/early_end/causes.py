"""Why runs end early or slow down, what each means and which settings have helped: the one source.

Errors name a cause by its id (`cause` of `regrid.errors.RunFailure`); the run that ends prints what
is here, and so does docs/limits.md.  A setting stands here only where it has helped in a run of a
packaged problem; docs/notes/decisions.md has the runs, and those that did not help.
"""

from __future__ import annotations

import errno
from dataclasses import dataclass
from typing import Any

from regrid.errors import RunFailure


@dataclass(frozen=True)
class Setting:
    """A key of the deck and how to change it; `words`: what that does.

    `value`: as after `--set key=`; or `factor` on what the deck has, up to `most`.
    """

    key: str
    words: str
    value: str = ""
    factor: float = 1.0
    most: float = float("inf")

    def choose(self, present: Any) -> str | None:
        """What to write after `key=` where the deck has `present`; None where nothing is left."""
        if self.value:
            return None if str(present).lower() == self.value.lower() else self.value
        if isinstance(present, bool) or not isinstance(present, int | float):
            return None
        wished = min(present * self.factor, self.most)
        wished = round(wished) if isinstance(present, int) else wished
        if wished == present or (wished > present) != (self.factor > 1.0):
            return None
        return f"{wished:.3g}" if isinstance(wished, float) else str(wished)

    @property
    def described(self) -> str:
        """The change in words: `run.cfl` halved."""
        if self.value:
            return f"`{self.key}={self.value}`"
        sizes = {0.5: "halved", 2.0: "doubled", 10.0: "times 10"}
        return f"`{self.key}` {sizes.get(self.factor, f'times {self.factor:g}')}"


@dataclass(frozen=True)
class Cause:
    """`says`: what is seen; `means`: why; `settings`: what has helped, the best first; `advice`:
    what else can be done; `name`: in a word or two, for the verdict.

    All may have Markdown's marks of code; no links, since screens show them, too.
    """

    says: str
    means: str
    settings: tuple[Setting, ...] = ()
    advice: str = ""
    name: str = ""


SMALLER_CFL = Setting("run.cfl", "shorter steps", factor=0.5)
MORE_BARRIER = Setting(
    "regrid.epsilon", "a stronger barrier keeps cells thicker", factor=10.0, most=0.1
)
MORE_SHARING = Setting("run.small_cells", "redistributes the states of more cells", value="0.1")
GRID_AT_REST = Setting("mesh", "the grid is fixed, the gas flows through it", value="fixed")
LESS_SHARING = Setting("run.small_cells", "redistributes the states of fewer cells", factor=0.5)
THICKER = Setting("thickness", "damps the shortest waves of interfaces", factor=2.0)
BARRIER = Setting("regrid.name", "the regridder that finds a grid most often", value="barrier")
FEWER_CELLS = Setting("cells", "larger cells do not follow the finest folds", factor=0.5)
END = "end the run there (`run.t_end`)"

ENDS: dict[str, Cause] = {  # by the id that errors carry
    "no-state": Cause(
        "density or sound speed is no longer positive",
        "a failed cell is nearly empty, a shock meets vacuum, or a material with a phase "
        "transition is far below its Hugoniot, where no shock and no isentrope leads",
        (LESS_SHARING,),
        "a material with a strength; end before the material fails (`run.t_end`)",
        "state not positive"),
    "left-table": Cause(
        "the state is outside the table", "a `tabular` material leaves the limits of its table", (),
        "a larger table: where waves meet, the pressure can be twice that of the impact",
        "state outside its table"),
    "no-grid": Cause(
        "no valid grid was found, a cell folds",
        "the sides of a block moved so that its inside has no convex grid, or turn too sharply: a "
        "hook's tip, a vanishing corner", (BARRIER,),
        f"other cells; {END}: corners are prevented from opening too far, not from closing",
        "no grid"),
    "flat-cell": Cause(
        "no grid was found: a cell is too flat for its equations to be solved",
        "a corner of a block, or a thin layer between two interfaces, is so thin that the area of "
        "its cell is lost to round-off", (FEWER_CELLS,),
        f"{END}; what lies between them is thinner than can be computed", "no grid"),
    "lines-cross": Cause(
        "a side crosses itself or another side",
        "an interface curls back on itself, or closes on another: a material is cut in two",
        (THICKER, FEWER_CELLS, SMALLER_CFL), f"interfaces that reconnect cannot be followed: {END}",
        "lines cross"),
    "collapse": Cause(
        "the time step has collapsed",
        "cells become ever thinner: in a neck, a thin layer or the tip of a hook",
        (THICKER, FEWER_CELLS), END, "time step collapsed"),
    "line-torn": Cause(
        "neighbouring nodes of an interface or surface would separate too far in one step",
        "two nodes separate faster than the time step can resolve", (),
        f"see where it was cut (`shockgrid plot DIR --what interface`); {END}", "line cut"),
    "contact-lost": Cause(
        "a sliding contact has shrunk to nothing, or takes all of a cell, or bodies that meet "
        "penetrate far in one step",
        "the contact point has reached the end of its side, or the other block presses through "
        "the cells beside it", (),
        "`contact.impactor=joined` where the problem has it; other cells", "contact lost"),
    "blocks-overlap": Cause(
        "two blocks overlap",
        "a body has run into another with sides that cannot meet: contacts close between free "
        "surfaces, and free surfaces and walls, of bodies without links between them", (),
        f"{END}, or make the sides that meet free surfaces; finer cells where one has bent "
        "through the other", "blocks overlap"),
    "mesh-law": Cause(
        "mesh motion: cells are not convex, or blocks are apart",
        "a prescribed motion that ignores cells (`mesh=follow`: with the gas) makes nodes cross",
        (GRID_AT_REST,), "", "no grid"),
    "pistons-part": Cause(
        "`node`: two adjacent sides have incompatible velocities",
        "two sides with given velocities meet at a node and are parallel there", (),
        "give both the same velocity, or put a wall between them", "pistons part"),
    "no-surface": Cause(
        "a free surface under a pressure where the material has no sound speed",
        "a gas has no surface to vacuum", (),
        "a higher pressure on the surface, or an outflow side", "no free surface"),
    "not-steady": Cause(
        "not steady; no steady state was found; the iteration diverges",
        "Newton's iteration did not settle: the steady state is not resolved, or none exists", (),
        "a smaller Rayleigh number (`rayleigh`), `method=time`", "not steady"),
    "implicit-step": Cause(
        "the implicit step did not settle",
        "the front moves over too many cells in a step for Newton's iteration", (SMALLER_CFL,), "",
        "implicit step not settled"),
    "singular": Cause(
        "a matrix is singular",
        "the grid has cells without area, or numbers of the deck are out of scale", (),
        "see the grid (`shockgrid plot DIR --what mesh`)", "singular matrix"),
    "no-growth-rate": Cause(
        "no growth rate was found",
        "the iteration for the eigenvalue did not settle near the number that it started from", (),
        "more cells; a Rayleigh number farther from the critical one", "no growth rate"),
    "not-finite": Cause(
        "a number is not finite", "a formula was used beyond the range in which it holds", (),
        "report it with the deck: an earlier message should have caught it", "number not finite"),
    "remap": Cause(
        "remap: density or sound speed of a cell of the new grid is not positive",
        "the state cannot be remapped to these cells (`restart --cells`)", (),
        "other cells, or an earlier restart point (`--at`)", "state not on new cells"),
}  # fmt: skip

_BESIDE = (MORE_SHARING, FEWER_CELLS)  # for cells that a line itself made flat
_INSIDE = (MORE_SHARING, MORE_BARRIER, FEWER_CELLS)  # those that the inside of a grid made flat
SHORT_STEPS: dict[str, tuple[str, tuple[Setting, ...]]] = {  # by what limits dt: words, what helps
    "hot": ("fast waves: the material is hot or moves fast, the cell is no thinner than others",
            (FEWER_CELLS,)),
    "crushed": ("crushed: all cells of the block have become thin", (FEWER_CELLS,)),
    "stretching": ("stretching: neighbouring nodes of an interface or surface separate fast",
                   (SMALLER_CFL, FEWER_CELLS)),
    "touch": ("touch: bodies come to touch, node by node", (FEWER_CELLS,)),
    "tension": ("tension: the shortest capillary waves of an interface or surface are fast",
                (FEWER_CELLS,)),
    "corner": ("corner: at a key node, where interfaces meet", _BESIDE),
    "sliding": ("sliding contact: in the first cells beside it", _BESIDE),
    "line": ("line: the first cells beside an interface or a surface are squeezed", _INSIDE),
    "axis": ("axis: in the first cells beside the axis", _BESIDE),
    "wall": ("wall: in the first cells beside a wall", _BESIDE),
    "inside": ("inside: cells away from all sides are squeezed", _INSIDE),
}  # fmt: skip


def describe_settings(limit: str) -> str:
    """What can be changed where dt is short by one of SHORT_STEPS, in a line."""
    _, settings = SHORT_STEPS.get(limit, ("", (FEWER_CELLS,)))
    words = [f"{setting.described.replace('`', '')}: {setting.words}" for setting in settings]
    return "; ".join([*words, "run.t_end ends the run before"])


def name_failure(error: Exception) -> str:
    """Why a run has ended early in a word or two; "" for what has no name.

    Failures have the id of their cause; what the disk refused has the system's error behind it.
    """
    if isinstance(error, RunFailure):
        return ENDS[error.cause].name if error.cause in ENDS else ""
    system = error.__cause__
    if not isinstance(system, OSError):
        return ""
    full = system.errno in (errno.ENOSPC, errno.EDQUOT)
    return "disk full" if full else "disk not writable"
