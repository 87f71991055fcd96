"""The deck of `conical-target`."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from problems.deck import MOST_CELLS, Deck, DeckTable, Regrid, RunControl

Touch = Literal["joined", "sliding"]


class EosNumbers(DeckTable, kw_only=True):
    """Numbers of the equations of state in place of the library's, such as `onset = 3e10`."""

    merges = True

    impactor: Annotated[dict[str, float], Meta(description="of the impactor's material")] = (
        msgspec.field(default_factory=dict)
    )
    shell: Annotated[dict[str, float], Meta(description="of the shell's material")] = msgspec.field(
        default_factory=dict
    )
    target: Annotated[dict[str, float], Meta(description="of the material around the cone")] = (
        msgspec.field(default_factory=dict)
    )
    filling: Annotated[dict[str, float], Meta(description="of the cone's material")] = (
        msgspec.field(default_factory=dict)
    )


class Contact(DeckTable, kw_only=True):
    """How materials touch: "joined" share the nodes of their line, "sliding" slip along it."""

    impactor: Annotated[Touch, Meta(description="the impactor and what it hits")] = "joined"
    front: Annotated[Touch, Meta(description="the shell's front and what it covers")] = "sliding"
    side: Annotated[Touch, Meta(description="the shell's side and what it surrounds")] = "sliding"
    cone: Annotated[Touch, Meta(description="the cone's side and what is around it")] = "joined"


class ConicalTargetDeck(Deck, kw_only=True):
    """Deck of `conical-target`."""

    run: RunControl = msgspec.field(default_factory=lambda: RunControl(t_end=5e-6, cfl=0.8))
    regrid: Regrid = msgspec.field(default_factory=Regrid)
    cells: Annotated[
        int, Meta(ge=16, le=MOST_CELLS, description="cells from the axis to the shell")
    ] = 48
    speed: Annotated[float, Meta(gt=0, description="of the impactor [m/s]")] = 2000.0
    impactor: Annotated[str, Meta(description="material of the impactor")] = "Al1100"
    shell: Annotated[str, Meta(description="material of the shell")] = "SS304"
    target: Annotated[str, Meta(description="material around the cone")] = "Pb"
    filling: Annotated[str, Meta(description="material of the cone")] = "graphite-diamond"
    thickness: Annotated[float, Meta(gt=0, description="of the impactor [m]")] = 8e-3
    front: Annotated[float, Meta(gt=0, description="thickness of the shell's front [m]")] = 3e-3
    side: Annotated[float, Meta(gt=0, description="thickness of the shell's side [m]")] = 4e-3
    radius: Annotated[float, Meta(gt=0, description="inside the shell [m]")] = 16e-3
    cover: Annotated[
        float,
        Meta(
            gt=0,
            description="radius of the shell's front [m]; from `radius` on: it closes the shell",
        ),
    ] = 12.5e-3
    length: Annotated[float, Meta(gt=0, description="inside the shell [m]")] = 26e-3
    base: Annotated[float, Meta(gt=0, description="radius of the cone's base [m]")] = 9e-3
    tip: Annotated[float, Meta(gt=0, description="radius of the cone's blunt tip [m]")] = 2e-3
    cone: Annotated[float, Meta(gt=0, description="length of the cone [m]")] = 14e-3
    ripple_amplitude: Annotated[
        float, Meta(ge=0, description="of a ripple on the cone's side [m]; 0: a straight side")
    ] = 0.0
    ripple_wavelength: Annotated[float, Meta(gt=0, description="along the cone's side [m]")] = 4e-3
    ripple_phase: Annotated[
        float, Meta(description="of the sine that begins at the cone's base [rad]")
    ] = 0.0
    contact: Contact = msgspec.field(default_factory=Contact)
    eos: EosNumbers = msgspec.field(default_factory=EosNumbers)
