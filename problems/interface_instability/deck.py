"""The deck of interface-instability: materials, shocks, the line, what bounds it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import msgspec
from msgspec import Meta

from hydro.eos import EquationOfState, IdealGas, StiffenedGas
from hydro.eos.materials import find_material
from problems.deck import MOST_CELLS, Deck, DeckTable, Limiter, Regrid, RunControl
from problems.file_names import compute_digests, place_file
from problems.interface_instability.first_shape import Spectrum
from problems.interface_instability.modes import Mode
from regrid.errors import BadInput


class Fluid(DeckTable, kw_only=True):
    """One material: by name from the library, or as an ideal (stiffened) gas."""

    material: (
        Annotated[str, Meta(description="name in the material library; left out: a gas")] | None
    ) = None
    gamma: Annotated[
        float, Meta(ge=1.001, le=1000, description="ratio of specific heats of the gas")
    ] = 1.4
    p_inf: Annotated[
        float, Meta(ge=0, le=1e20, description="stiffness of the gas [Pa]; 0: ideal")
    ] = 0.0
    rho: (
        Annotated[
            float, Meta(ge=1e-20, le=1e20, description="density [kg/m3]; left out: the library's")
        ]
        | None
    ) = None

    @classmethod
    def keeps_defaults(cls, table: Mapping[str, Any]) -> bool:
        """A gas does; a material brings its own density."""
        return "material" not in table

    def make(self) -> tuple[EquationOfState, float]:
        """Equation of state and density at the start."""
        if self.material is not None:
            found = find_material(self.material)
            return found.eos, self.rho or found.rho0
        eos = StiffenedGas(self.gamma, self.p_inf) if self.p_inf else IdealGas(self.gamma)
        if self.rho is None:
            raise BadInput("deck: a gas without `material` needs its density `rho`")
        return eos, self.rho


class SecondShock(DeckTable, kw_only=True):
    """A stronger shock that follows the first."""

    pressure: Annotated[float, Meta(gt=0, le=1e20, description="pressure behind it [Pa]")]
    kct: Annotated[
        float, Meta(gt=0, description="when the piston sends it: k c t after the first arrived")
    ] = 6.0


class LineMotion(DeckTable, kw_only=True):
    """How the interface's nodes are re-spaced along it."""

    shape: Annotated[
        Literal["spline", "chord"], Meta(description="curve between nodes when re-spaced")
    ] = "spline"
    relax: Annotated[
        float, Meta(ge=0, le=1, description="part of the way to the spacing law in a step")
    ] = 0.02
    thickness: (
        Annotated[
            float,
            Meta(
                ge=0,
                le=1e12,
                description="waves of the interface much shorter decay [m]; left "
                "out: 0.75 of a first cell",
            ),
        ]
        | None
    ) = None
    tension: Annotated[
        float, Meta(ge=0, le=1e20, description="surface tension of the interface [N/m]")
    ] = 0.0


class InterfaceDeck(Deck, kw_only=True):
    """Deck of `interface-instability`; the defaults are the 1:3 gas at Mach 1.5."""

    runtime = ("kct_end",)
    absent: ClassVar[dict[str, str]] = {"start": "incident"}
    overruled: ClassVar[dict[str, str]] = {"kct_end": "run.t_end"}

    run: RunControl = msgspec.field(default_factory=lambda: RunControl(cfl=0.8))
    first: Fluid = msgspec.field(default_factory=lambda: Fluid(rho=1.0))
    second: Fluid = msgspec.field(default_factory=lambda: Fluid(rho=3.0))
    pressure: Annotated[float, Meta(le=1e20, description="pressure ahead of the shock [Pa]")] = 1.0
    mach: (
        Annotated[
            float,
            Meta(
                ge=1.001,
                le=1000,
                description="Mach number of the shock; left out: `shock_pressure`, or 1.5",
            ),
        ]
        | None
    ) = None
    shock_pressure: (
        Annotated[
            float,
            Meta(gt=0, le=1e20, description="pressure behind the shock [Pa]; left out: by `mach`"),
        ]
        | None
    ) = None
    second_shock: SecondShock | None = None
    wavelength: Annotated[float, Meta(ge=1e-12, le=1e12, description="2 pi / k [m]")] = 1.0
    modes: Annotated[
        list[Mode], Meta(description="harmonics; [] for a spectrum or a line_file alone")
    ] = msgspec.field(default_factory=lambda: [Mode()])
    spectrum: Spectrum | None = None
    line_file: (
        Annotated[
            str,
            Meta(
                min_length=1,
                description="text file of a line that is added to the modes: x and y, or x [m]",
            ),
        ]
        | None
    ) = None
    width: Annotated[float, Meta(gt=0, description="width of the domain in wavelengths")] = 0.5
    sides: Annotated[
        Literal["wall", "periodic"], Meta(description="what bounds the domain along the interface")
    ] = "wall"
    cells: Annotated[int, Meta(ge=4, le=MOST_CELLS, description="cells a wavelength")] = 64
    refine: Annotated[
        bool, Meta(description="add grid lines on the way where the interface grows long or bends")
    ] = False
    uniform: Annotated[
        float, Meta(ge=0, description="evenly spaced zone on each side, in wavelengths")
    ] = 1.0
    stretch: Annotated[
        float, Meta(ge=1, le=1.5, description="growth of cells from one to the next beyond it")
    ] = 1.01
    reach: Annotated[
        float,
        Meta(gt=0, description="distance from the interface, in waves, where lines begin to bend"),
    ] = 0.25
    lengths: (
        Annotated[
            tuple[float, float],
            Meta(description="lengths of the two materials [m]; left out: no echo returns"),
        ]
        | None
    ) = None
    start: Annotated[
        Literal["auto", "crossed", "incident"],
        Meta(
            description="incident: the shock is on its way to the interface; crossed: it has just "
            "crossed it; auto: crossed where linear theory gives that state"
        ),
    ] = "auto"
    layer: (
        Annotated[
            float,
            Meta(
                ge=3,
                le=1000,
                description="start crossed: first distance of the nearer wave from the interface, "
                "in cells; left out: an eighth of the shortest wave, 3 to 8 cells",
            ),
        ]
        | None
    ) = None
    gap: Annotated[
        float,
        Meta(
            ge=0.01, le=20, description="first distance of the shock from the interface, in waves"
        ),
    ] = 0.3
    kct_end: Annotated[
        float,
        Meta(
            gt=0, le=10000, description="end: k c t after arrival, c of the shocked second material"
        ),
    ] = 30.0
    limiter: Limiter = "smooth-shear"
    line: LineMotion = msgspec.field(default_factory=LineMotion)
    regrid: Regrid = msgspec.field(default_factory=Regrid)
    digests: Annotated[
        dict[str, str],
        Meta(
            description="sha256 of line_file, as a run keeps it; no matter in a deck of one's own"
        ),
    ] = msgspec.field(default_factory=dict)

    def find_files(self, folder: Path) -> InterfaceDeck:
        """The same deck, its line_file taken from `folder` where it is relative."""
        if self.line_file is None:
            return self
        path = place_file(self.line_file, folder)
        digests = compute_digests([path], self.digests)
        return msgspec.structs.replace(self, line_file=path, digests=digests)
