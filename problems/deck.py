"""The tables that decks share; each problem's Deck is a struct that adds its own fields.

A deck is a TOML file: `problem = "name"` and the fields of that problem's Deck.  Every field has
a default, a description and, where it can be said of one field alone, its bounds: the JSON schema
for editors is made from them.  The trap: msgspec checks bounds and types when a deck is *read*
(`runs.deck.reading`), not when a struct is made in Python.

A problem's own deck reads:

    class MyDeck(Deck, kw_only=True):
        run: RunControl = msgspec.field(default_factory=lambda: RunControl(t_end=1e-3))
        mach: Annotated[float, Meta(gt=1, description="Mach number of the shock")] = 1.2
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import msgspec
from msgspec import Meta

from regrid.equidistribution.weights import FIELDS, GEOMETRY, Expression
from regrid.errors import BadInput

if TYPE_CHECKING:
    from pathlib import Path

    from regrid.protocol import Regridder

MOST_CELLS = 100_000  # along a side: arrays of one line stay small, whatever a deck says

Limiter = Annotated[  # the names of hydro.formulas.reconstruction.LIMITERS
    Literal["low-mach", "smooth-shear", "monotonised-central", "van-leer", "minmod"],
    Meta(
        description="limiter of slopes, from sharp to smooth; smooth-shear: van-leer but for the "
        "velocity where the flow turns or shears without jumps; low-mach: monotonised-central "
        "but there, with jumps of velocity between cells lessened where the flow is slow"
    ),
]


class DeckTable(msgspec.Struct, kw_only=True, frozen=True, forbid_unknown_fields=True):
    """A table of a deck: frozen (`msgspec.structs.replace` changes a copy), no unknown keys.

    Where a deck gives some keys of a table, the keys left out come from the problem's default table
    if the class says `merges = True` (as for `run`), else from the class: a material given anew
    must not inherit the density of the default one.  `keeps_defaults` may say so table by table.

    `runtime` names the keys that a restart may change, for they say how to march and not from
    what; another value of any other key is another run.

    `overruled` names keys that have no effect where another dotted key of the deck is set.

    `absent`, of a whole deck, says what the decks of runs meant that were begun before a key was.
    """

    merges: ClassVar[bool] = False
    overruled: ClassVar[dict[str, str]] = {}
    absent: ClassVar[dict[str, str]] = {}
    runtime: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def keeps_defaults(cls, table: Mapping[str, Any]) -> bool:
        """Do the keys that this table of a deck leaves out come from the problem's default?"""
        return cls.merges


class RunControl(DeckTable, kw_only=True):
    """How long and how to march."""

    merges = True
    runtime = ("t_end", "max_steps", "cfl", "small_cells", "threads", "cut")

    t_end: (
        Annotated[float, Meta(gt=0, description="end time [s]; left out: the problem's choice")]
        | None
    ) = None
    t_set_up: (
        Annotated[
            float,
            Meta(
                gt=0,
                description="end time [s] that lengths and given motions are made for; left out: "
                "that of the run; a restart with another end writes it down",
            ),
        ]
        | None
    ) = None
    max_steps: (
        Annotated[
            int,
            Meta(ge=0, le=2**63 - 1, description="stop after so many steps; left out: no limit"),
        ]
        | None
    ) = None
    cfl: Annotated[float, Meta(ge=1e-3, le=1, description="fraction of the stable time step")] = 0.5
    small_cells: (
        Annotated[
            float,
            Meta(
                ge=0,
                le=0.1,
                description="part of a block's cells that may be too small for a step and then "
                "share their states with neighbours; 0: the fastest cell sets the step; left out: "
                "0.05 where the grid is rebuilt in every step, else 0",
            ),
        ]
        | None
    ) = None
    threads: (
        Annotated[
            int,
            Meta(
                ge=1,
                le=1024,
                description="threads; any number gives the same bits; left out: one a large block, "
                "as far as there are processors",
            ),
        ]
        | None
    ) = None
    cut: Annotated[
        dict[str, Annotated[int, Meta(ge=1, le=1024)]],
        Meta(
            description="by a block's name, among how many ranks of MPI its update is cut at most; "
            "1: it stays whole; not named: cut where it is more than 1.2 of a rank's share"
        ),
    ] = msgspec.field(default_factory=dict)


class Output(DeckTable, kw_only=True):
    """What a run leaves behind."""

    merges = True
    runtime = (
        "dumps", "every", "times", "fields", "precision", "compression", "restart_every", "columns",
    )  # fmt: skip

    dumps: Annotated[
        int,
        Meta(
            ge=0,
            le=1_000_000,
            description="dumps evenly over the run besides the first; 0: first and last",
        ),
    ] = 20
    every: (
        Annotated[
            float,
            Meta(gt=0, description="time [s] from dump to dump; given: `dumps` does not count"),
        ]
        | None
    ) = None
    times: Annotated[
        list[Annotated[float, Meta(gt=0)]],
        Meta(description="times [s] of further dumps; with dumps = 0 of these and the last alone"),
    ] = msgspec.field(default_factory=list)
    fields: Annotated[
        list[str],
        Meta(description="fields in light dumps, such as rho and p; none: all there are"),
    ] = msgspec.field(default_factory=list)
    precision: Annotated[
        Literal["double", "single"],
        Meta(description="of the fields in light dumps; their nodes are always double"),
    ] = "double"
    compression: Annotated[
        int, Meta(ge=0, le=9, description="level of gzip for light dumps; 0: none")
    ] = 0
    restart_every: Annotated[
        float, Meta(ge=0, description="wall seconds between restart points; 0: none but dumps")
    ] = 300.0
    columns: Annotated[
        tuple[str, ...],
        Meta(description="groups of history columns of other installed packages, by name"),
    ] = ()

    @property
    def light(self) -> bool:
        """Are dumps pictures alone (light), all but the last, and not restart points too?"""
        return bool(self.fields) or self.precision != "double" or self.compression > 0


Field = Literal["rho", "u", "v", "p", "e", "c"]


class Gauge(DeckTable, kw_only=True):
    """A point, or a line of points, at which the flow is written down after every step."""

    name: Annotated[
        str,
        Meta(
            pattern="^[A-Za-z][A-Za-z0-9_-]*$",
            max_length=40,
            description="head of its columns in gauges.csv; points of a line add _1, _2, ...",
        ),
    ]
    at: Annotated[tuple[float, float], Meta(description="place [x, y] [m], a line's first one")]
    to: (
        Annotated[tuple[float, float], Meta(description="a line's last place [x, y] [m]")] | None
    ) = None
    count: Annotated[
        int, Meta(ge=1, le=10000, description="points of a line, evenly from `at` to `to`")
    ] = 1
    moves: Annotated[
        bool, Meta(description="true: goes with the material; false: stays in space")
    ] = False
    fields: Annotated[
        list[Field],
        Meta(min_length=1, description="what is written down; c is the sound speed"),
    ] = msgspec.field(default_factory=lambda: ["rho", "u", "v", "p"])


class Regrid(DeckTable, kw_only=True):
    """Which regridder rebuilds the blocks, and with what options."""

    merges = True
    runtime = ("name", "epsilon", "method", "edge_lengths", "weight", "options")

    name: Annotated[str, Meta(description="name in the registry of regridders")] = "barrier"
    epsilon: Annotated[
        float, Meta(gt=0, lt=1, description="weight of the orthogonality term of the barrier")
    ] = 1e-3
    method: Annotated[
        Literal["newton", "sweeps"],
        Meta(description="newton: one Newton step a step; sweeps: the paper's iteration"),
    ] = "newton"
    edge_lengths: Annotated[
        Literal["conditional", "unit"],
        Meta(description="lengths that the weights of a grid line's cells are made from"),
    ] = "conditional"
    weight: Annotated[
        str,
        Meta(description="where cells are to be small: a formula such as 1 + 5*|grad(rho)|/max"),
    ] = ""
    options: Annotated[
        dict[str, bool | int | float | str],
        Meta(description="further options of the regridder, passed on as they are"),
    ] = msgspec.field(default_factory=dict)

    def check_weight(self, fields: tuple[str, ...] = FIELDS) -> None:
        """Raise BadInput for a weight that is no formula or has names other than `fields`'."""
        if self.weight:
            Expression(self.weight).check_names((*GEOMETRY, *fields))

    def make(self, **fixed: Any) -> Regridder:
        """A regridder for one block; `fixed` are options the problem sets (threads, family).

        Raises BadInput for names and options that do not exist.
        """
        from regrid.registry import make_regridder  # numba is slow to load; a deck is not

        if "name" in self.options:
            raise BadInput('regrid.options has "name"; the regridder is named by regrid.name')
        fixed = {name: value for name, value in fixed.items() if value is not None}
        chosen = {**fixed, **self.options}
        if self.weight:
            chosen["weight"] = self.weight
        if self.name.startswith("barrier"):
            chosen = {
                "epsilon": self.epsilon,
                "method": self.method,
                "edge_lengths": self.edge_lengths,
                **chosen,
            }
        return make_regridder(self.name, **chosen)


class Deck(DeckTable, kw_only=True):
    """What every problem's deck has."""

    run: RunControl = msgspec.field(default_factory=RunControl)
    output: Output = msgspec.field(default_factory=Output)
    gauge: Annotated[
        list[Gauge], Meta(description="points at which a flow is written down after every step")
    ] = msgspec.field(default_factory=list)

    def find_files(self, folder: Path) -> Deck:
        """The same deck with the files that it names taken from `folder`, that of the deck."""
        return self
