"""Why runs end early or slow down, what each means and which settings have helped: the one source.

Errors name a cause by its id (`cause` of `regrid.errors.RunFailure`); the run that ends prints what
is here, and so does docs/limits.md.  A setting stands here only where it has helped in a run of a
packaged problem; docs/notes/decisions.md has the runs, and those that did not help.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from regrid.errors import RunFailure


@dataclass(frozen=True)
class Setting:
    """A key of the deck and how to change it: its new value as text, or a factor; and `words`."""

    key: str
    change: str | float
    words: str

    def choose(self, present: Any) -> str | None:
        """What to write after `key=` where the deck has `present`; None where nothing is left."""
        if isinstance(self.change, str):
            return None if str(present).lower() == self.change else self.change
        if isinstance(present, bool) or not isinstance(present, int | float):
            return None
        wished = present * self.change
        wished = round(wished) if isinstance(present, int) else float(f"{wished:.3g}")
        return str(wished) if wished != present else None

    @property
    def described(self) -> str:
        """The change in words, `run.cfl` halved, and what it does."""
        sizes = {0.5: "halved", 2.0: "doubled", 10.0: "times 10"}
        if isinstance(self.change, str):
            return f"`{self.key}={self.change}`: {self.words}"
        return f"`{self.key}` {sizes[self.change]}: {self.words}"


@dataclass(frozen=True)
class Cause:
    """`name`: what is seen, in a word or two; `means`: why; `settings`: what has helped, the best
    first; `advice`: what else can be done.  All may have Markdown's marks of code, but no links."""

    name: str
    means: str
    settings: tuple[Setting, ...] = ()
    advice: str = ""


SMALLER_CFL = Setting("run.cfl", 0.5, "shorter steps")
MORE_BARRIER = Setting("regrid.epsilon", 10.0, "a stronger barrier keeps cells thicker")
MORE_SHARING = Setting("run.small_cells", "0.1", "redistributes the states of more cells")
LESS_SHARING = Setting("run.small_cells", 0.5, "redistributes the states of fewer cells")
GRID_AT_REST = Setting("mesh", "fixed", "the grid is fixed, the gas flows through it")
THICKER = Setting("thickness", 2.0, "damps the shortest waves of interfaces")
BARRIER = Setting("regrid.name", "barrier", "the regridder that finds a grid most often")
FEWER_CELLS = Setting("cells", 0.5, "larger cells do not follow the finest folds")
END = "end the run there (`run.t_end`)"

ENDS: dict[str, Cause] = {  # by the id that errors carry
    "no-state": Cause(
        "state not positive",
        "density or sound speed is no longer positive: a failed cell is nearly empty, a shock "
        "meets vacuum, or a material with a phase transition is far below its Hugoniot, where no "
        "shock and no isentrope leads", (LESS_SHARING,),
        "a material with a strength; end before the material fails (`run.t_end`)"),
    "left-table": Cause(
        "state outside its table", "a `tabular` material leaves the limits of its table", (),
        "a larger table: where waves meet, the pressure can be twice that of the impact"),
    "no-grid": Cause(
        "no grid",
        "no valid grid was found: the sides of a block moved so that its inside has no convex "
        "grid, or turn too sharply: a hook's tip, a vanishing corner", (BARRIER,),
        f"other cells; {END}: corners are prevented from opening too far, not from closing"),
    "flat-cell": Cause(
        "no grid, a cell too flat",
        "a corner of a block, or a thin layer between two interfaces, is so thin that the area of "
        "its cell is lost to round-off", (FEWER_CELLS,),
        f"{END}; what lies between them is thinner than can be computed"),
    "lines-cross": Cause(
        "lines cross",
        "an interface curls back on itself, or closes on another: a material is cut in two",
        (THICKER, FEWER_CELLS, SMALLER_CFL),
        f"interfaces that reconnect cannot be followed: {END}"),
    "collapse": Cause(
        "time step collapsed",
        "cells become ever thinner: in a neck, a thin layer or the tip of a hook",
        (THICKER, FEWER_CELLS), END),
    "line-torn": Cause(
        "line cut",
        "two neighbouring nodes of an interface or surface separate faster than the time step can "
        "resolve", (), f"see where it was cut (`shockgrid plot DIR --what interface`); {END}"),
    "contact-lost": Cause(
        "contact lost",
        "the point of a sliding contact has reached the end of its side, the other block presses "
        "through the cells beside it, or bodies that meet penetrate far in one step", (),
        "`contact.impactor=joined` where the problem has it; other cells"),
    "blocks-overlap": Cause(
        "blocks overlap",
        "a body has run into another with sides that cannot meet: contacts close between free "
        "surfaces, and free surfaces and walls, of bodies without links between them", (),
        f"{END}, or make the sides that meet free surfaces; finer cells where one has bent "
        "through the other"),
    "mesh-law": Cause(
        "cells not convex in a prescribed mesh motion",
        "a prescribed motion that ignores cells (`mesh=follow`: with the gas) makes nodes cross",
        (GRID_AT_REST,)),
    "pistons-part": Cause(
        "pistons part",
        "two sides with given velocities meet at a node and are parallel there", (),
        "give both the same velocity, or put a wall between them"),
    "no-surface": Cause(
        "no free surface",
        "a gas has no surface to vacuum: at the pressure on it there is no sound speed", (),
        "a higher pressure on the surface, or an outflow side"),
    "not-steady": Cause(
        "not steady",
        "Newton's iteration did not settle: the steady state is not resolved, or none exists", (),
        "a smaller Rayleigh number (`rayleigh`), `method=time`"),
    "implicit-step": Cause(
        "implicit step not settled",
        "the front moves over too many cells in a step for Newton's iteration", (SMALLER_CFL,)),
    "singular": Cause(
        "singular matrix",
        "the grid has cells without area, or numbers of the deck are out of scale", (),
        "see the grid (`shockgrid plot DIR --what mesh`)"),
    "no-growth-rate": Cause(
        "no growth rate",
        "the iteration for the eigenvalue did not settle near the number that it started from", (),
        "more cells; a Rayleigh number farther from the critical one"),
    "not-finite": Cause(
        "number not finite", "a formula was used beyond the range in which it holds", (),
        "report it with the deck: an earlier message should have caught it"),
    "remap": Cause(
        "state not on new cells",
        "the state cannot be remapped to these cells (`restart --cells`): density or sound speed "
        "of one is not positive", (), "other cells, or an earlier restart point (`--at`)"),
}  # fmt: skip

SHORT_STEPS = {  # by what limits dt, where that is no cell: what has helped
    "stretching": (SMALLER_CFL, FEWER_CELLS), "touch": (FEWER_CELLS,), "tension": (FEWER_CELLS,),
}  # fmt: skip
SMALL_CELLS = (MORE_SHARING, MORE_BARRIER, FEWER_CELLS)


def describe_settings(limit: str) -> str:
    """What can be changed where dt is short by a key of SHORT_STEPS, or by a cell, in a line."""
    settings = SHORT_STEPS.get(limit, SMALL_CELLS)
    words = [setting.described.replace("`", "") for setting in settings]
    return "; ".join([*words, "run.t_end ends the run before"])


def name_failure(error: Exception) -> str:
    """Why a run has ended early in a word or two: the name of its cause, or what the system says of
    the disk; "" for what has no name."""
    if isinstance(error, RunFailure):
        return ENDS[error.cause].name if error.cause in ENDS else ""
    system = error.__cause__
    return str(system.strerror).lower() if isinstance(system, OSError) else ""
