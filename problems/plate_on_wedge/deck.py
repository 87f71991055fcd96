"""The deck of `plate-on-wedge`."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from problems.deck import MOST_CELLS, Deck, DeckTable, Regrid, RunControl


class Drive(DeckTable, kw_only=True):
    """What sets the plate in motion."""

    kind: Annotated[
        Literal["piston", "pressure", "flyer", "moving"],
        Meta(
            description="piston: its back is pushed at `speed`; pressure: `pressure` acts on its "
            "back; flyer: another plate hits its back at `speed`; moving: the whole plate comes "
            "in at `speed`, the test of shock polars"
        ),
    ] = "piston"
    speed: Annotated[float, Meta(gt=0, description="speed of piston, flyer or plate [m/s]")] = (
        2500.0
    )
    pressure: Annotated[float, Meta(gt=0, description="driving pressure [Pa]")] = 50e9
    history: Annotated[
        tuple[tuple[float, float], ...],
        Meta(
            description="pairs of time [s] and part (0..1) of speed or pressure; straight between"
        ),
    ] = ()
    material: Annotated[str, Meta(description="of the flyer")] = "SS304"
    thickness: Annotated[float, Meta(gt=0, description="of the flyer [m]")] = 5e-3


class PlateOnWedgeDeck(Deck, kw_only=True):
    """Deck of `plate-on-wedge`; the default is the paper's scenario, its sizes are ours."""

    run: RunControl = msgspec.field(default_factory=lambda: RunControl(cfl=0.8))
    # a stronger barrier than elsewhere: the plate's grid bends by 300 degrees around B
    regrid: Regrid = msgspec.field(default_factory=lambda: Regrid(epsilon=3e-2))
    plate: Annotated[str, Meta(description="material of the plate")] = "Al1100"
    thickness: Annotated[float, Meta(gt=0, description="of the plate [m]")] = 10e-3
    wedge: Annotated[str, Meta(description="material of the wedge body")] = "SS304"
    angle: Annotated[float, Meta(description="between plate and wedge face [degrees]")] = 20.0
    gap: Annotated[
        float,
        Meta(
            ge=0,
            le=1e3,
            description="of the plate over the wedge's edge at the start [m]; above 0 they are two "
            "bodies, which meet and part by themselves, and no node follows A",
        ),
    ] = 0.0
    face: Annotated[float, Meta(gt=0, description="length of the wedge's face [m]")] = 30e-3
    edge: Annotated[
        float, Meta(gt=0, description="length of the flat edge on which the plate lies [m]")
    ] = 10e-3
    overhang: Annotated[
        float, Meta(gt=0, description="of the plate beyond the end of the face [m]")
    ] = 10e-3
    depth: Annotated[
        float, Meta(gt=0, description="height of the face's end over the base [m]")
    ] = 12e-3
    end_angle: Annotated[
        float, Meta(gt=30, lt=150, description="of the wedge's end face; 90: upright [degrees]")
    ] = 90.0
    right: Annotated[
        Literal["symmetry", "free"],
        Meta(description="the plate's far end: a plane of symmetry, or a free end face"),
    ] = "symmetry"
    drive: Drive = msgspec.field(default_factory=Drive)
    cells: Annotated[
        tuple[Annotated[int, Meta(ge=1, le=MOST_CELLS)], Annotated[int, Meta(ge=1, le=MOST_CELLS)]],
        Meta(description="cells of the plate along and across it"),
    ] = (80, 24)
    contact_cells: Annotated[
        float, Meta(gt=0.1, lt=0.9, description="part of the plate's cells that lie on the wedge")
    ] = 0.6
    refinement: (
        Annotated[
            float,
            Meta(
                ge=1,
                le=8,
                description="how many times finer the cells are at the contact point A; left out: "
                "for a moving plate by the distance from the critical angle, 1 (far) to 3 (near)",
            ),
        ]
        | None
    ) = None
    wedge_spacing: Annotated[
        float, Meta(gt=0.2, lt=5, description="spacing of the wedge's nodes over the plate's")
    ] = 1.0
    until: Annotated[
        Literal["auto", "arrival", "end"],
        Meta(
            description="end of the run: A's arrival at the end B of the face, or what comes "
            "later; auto: arrival where cells at A are refined"
        ),
    ] = "auto"
    turn: Annotated[float, Meta(description="turn of the whole set-up [degrees]")] = 0.0
    mirror: Annotated[bool, Meta(description="run the mirror image of the set-up")] = False
