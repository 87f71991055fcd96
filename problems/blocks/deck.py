"""The deck of `blocks`: how it describes a block, a side of it and a link.

A number may be a formula, text such as "1e5*(1 + 0.1*sin(pi*x))": of x and y [m] in a state, of the
time t [s] at a side, of the part s of the way from 0 to 1 along a curve.  Formulas are those of
weights (`regrid.equidistribution.weights`); they are parsed, never run.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from problems.deck import (
    Deck,
    DeckTable,
    Limiter,
    Regrid,
    RunControl,
    VoidFill,
    compute_digests,
    key,
    place_file,
)

Formula = float | str
Pair = tuple[Formula, Formula]
SideName = Literal["i_min", "i_max", "j_min", "j_max"]
LINKED = {"interface": "interface", "seam": "seam", "periodic": "periodic", "slide": "sliding"}
Points = Annotated[tuple[tuple[float, float], ...], Meta(min_length=2)]


class CurveTable(DeckTable, kw_only=True):
    """A curve by two formulas of s, from 0 to 1, or by points with the cells between them."""

    x: key(Formula | None, "x [m], a number or a formula of s") = None
    y: key(Formula | None, "y [m], a number or a formula of s") = None
    points: key(Points | None, "[[x, y], ...] [m], joined by straight lines") = None
    cells: key(
        tuple[Annotated[int, Meta(ge=1, le=4000)], ...] | None,
        "cells on each of the straight lines; every point is then a node",
    ) = None


Curve = Annotated[
    str | Points | CurveTable,
    Meta(
        description="a file with columns x and y [m], points [[x, y], ...] joined by straight "
        "lines, {x = ..., y = ...}, formulas of s from 0 to 1, or {points = ..., cells = ...}"
    ),
]


class Curves(DeckTable, kw_only=True):
    """The four sides of a block; each may run either way, neighbours share their ends."""

    i_min: Curve
    i_max: Curve
    j_min: Curve
    j_max: Curve


class BlockSide(DeckTable, kw_only=True):
    """What is at a side of a block, or at some of its faces."""

    side: key(SideName, "which side")
    kind: key(str, "wall, axis, piston, free-surface, inflow, outflow or an installed one")
    faces: key(
        tuple[Annotated[int, Meta(ge=0, le=10**9)], Annotated[int, Meta(ge=1, le=10**9)]] | None,
        "from this face up to that, counted from 0; left out: the whole side",
    ) = None
    velocity: key(Pair | None, "of a piston or an open side: u, v [m/s] of t") = None
    pressure: key(Formula | None, "on a free surface [Pa], a number or a formula of t") = None
    state: key(
        tuple[Formula, Formula, Formula, Formula] | None,
        "beyond an inflow: rho [kg/m3], u, v [m/s], p [Pa], formulas of t",
    ) = None
    options: key(
        dict[str, bool | int | float | str], "further options of the kind, passed on unchanged"
    ) = msgspec.field(default_factory=dict)


class BlockTable(DeckTable, kw_only=True):
    """One block: its grid, its material, its state and its sides."""

    name: key(str, "name, for links and files", pattern="^[A-Za-z][A-Za-z0-9_-]*$")
    grid: key(str, "file of its grid, or of its four curves: .npz, .h5, .vts, .vtk") = ""
    grid_block: key(str, "which of several blocks in that file") = ""
    curves: key(Curves | None, "its four sides, where there is no file of a grid") = None
    cells: key(
        tuple[Annotated[int, Meta(ge=2, le=4000)], Annotated[int, Meta(ge=2, le=4000)]] | None,
        "cells along i and j; left out: the nodes of the file, or the points",
    ) = None
    material: key(
        str | dict[str, int | float | str],
        "name of a material, FILE.toml:NAME, or a table with eos and its parameters",
    ) = "air"
    rho: key(
        Formula | None, "density [kg/m3], of x and y; left out: that of the material at rest"
    ) = None
    u: key(Formula, "velocity along x [m/s], of x and y") = 0.0
    v: key(Formula, "velocity along y [m/s], of x and y") = 0.0
    p: key(Formula, "pressure [Pa], of x and y") = 1e5
    side: key(tuple[BlockSide, ...], "what is at its sides that are not linked") = ()


class LinkTable(DeckTable, kw_only=True):
    """Two runs of faces that lie on one another."""

    kind: key(
        Literal["interface", "seam", "periodic", "slide"],
        "interface: contact of two materials, nodes match; seam: cut inside one "
        "material; periodic: a period apart; slide: nodes need not match, the first side leads",
    )
    sides: key(
        tuple[str, str], 'two sides, such as "left.i_max" or "left.i_max[0:8]", faces 0 to 7'
    )
    tension: key(float, "surface tension of an interface [N/m]", ge=0, le=1e20) = 0.0


CHANNEL = BlockTable(  # air that a piston drives into a channel with a bump
    name="air",
    cells=(56, 16),
    curves=Curves(
        i_min=((-0.3, 0.0), (-0.3, 0.2)),
        i_max=((0.4, 0.0), (0.4, 0.2)),
        j_min=((-0.3, 0.0), (0.4, 0.0)),
        j_max=CurveTable(x="0.7*s - 0.3", y="0.2 - 0.08*exp(-40*(s - 0.6)**2)*(4*s*(1 - s))"),
    ),
    side=(
        BlockSide(side="i_min", kind="piston", velocity=(100.0, 0.0)),
        *(BlockSide(side=side, kind="wall") for side in ("i_max", "j_min", "j_max")),
    ),
)


class BlocksDeck(Deck, kw_only=True):
    """Deck of `blocks`."""

    run: RunControl = RunControl(t_end=1e-3)
    regrid: Regrid = Regrid()
    title: key(str, "a line for the summary") = ""
    geometry: key(Literal["plane", "axisymmetric"], "axisymmetric: y is the radius") = "plane"
    mesh: key(
        Literal["regrid", "fixed"], "regrid: grids follow moving sides; fixed: no node moves"
    ) = "regrid"
    gravity: key(tuple[float, float], "acceleration of all blocks along x and y [m/s2]") = (
        0.0,
        0.0,
    )
    limiter: Limiter = "van-leer"
    void_fill: VoidFill = VoidFill()
    block: key(tuple[BlockTable, ...], "the blocks, [[block]] each", min_length=1) = (CHANNEL,)
    link: key(tuple[LinkTable, ...], "the links, [[link]] each") = ()

    digests: key(
        dict[str, str], "sha256 of the files, as a run stores them; not needed in your own deck"
    ) = msgspec.field(default_factory=dict)

    def find_files(self, folder: Path) -> BlocksDeck:
        """The same deck, the files that it names taken from `folder` where they are relative."""
        blocks = tuple(_place_block(block, folder) for block in self.block)
        names = [name for block in blocks for name in _list_files(block)]
        digests = compute_digests(names, self.digests)
        return msgspec.structs.replace(self, block=blocks, digests=digests)


def _list_files(block: BlockTable) -> list[str]:
    """The files that a block names."""
    curves = block.curves
    sides = (curves.i_min, curves.i_max, curves.j_min, curves.j_max) if curves else ()
    material = block.material if isinstance(block.material, str) else ""
    files = [block.grid, material.rpartition(":")[0], *sides]
    return [name for name in files if isinstance(name, str) and name]


def _place_block(block: BlockTable, folder: Path) -> BlockTable:
    changed: dict[str, Any] = {}
    if block.grid:
        changed["grid"] = place_file(block.grid, folder)
    if block.curves is not None:
        files = {
            side: place_file(curve, folder)
            for side in ("i_min", "i_max", "j_min", "j_max")
            if isinstance(curve := getattr(block.curves, side), str)
        }
        changed["curves"] = msgspec.structs.replace(block.curves, **files)
    if isinstance(block.material, str) and ".toml:" in block.material:
        file, _, name = block.material.rpartition(":")
        changed["material"] = f"{place_file(file, folder)}:{name}"
    return msgspec.structs.replace(block, **changed)
