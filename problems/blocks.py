"""Blocks from a deck, with your own grids, curves, materials, states, sides and links.

Each `[[block]]` has a grid from a file or is made on four curves.  `[[block.side]]` says what is at
its sides, and `[[link]]` which sides of two blocks lie on one another.  Files lie beside the deck.
The problem measures mean velocity, centre of mass and greatest pressure of each block.

Note: nothing here knows what the flow should be.  A side that is moved by the flow keeps to the
walls at its ends, and a wall that ends in a corner does not go on beyond it.
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np
from msgspec import Meta

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.carried.fields import CarriedField
from shockgrid.hydro.contacts.necks import Necks
from shockgrid.hydro.eos.materials import (
    Material,
    find_material,
    find_name,
    make_material,
)
from shockgrid.hydro.formulas.geometry import find_centres_of_volume, find_geometry
from shockgrid.hydro.links import join, slide
from shockgrid.hydro.simulation import Simulation
from shockgrid.hydro.sources import make_gravity
from shockgrid.problems.deck import (
    NONE,
    Coordinate,
    DeckTable,
    Limiter,
    Name,
    Options,
    Regrid,
    RunControl,
    VoidFill,
    key,
    place_file,
)
from shockgrid.problems.problem import Problem
from shockgrid.problems.report import Report
from shockgrid.problems.solids import BodyTable, SolidDeck, find_laws, list_fluids
from shockgrid.regrid.domains import distribute_by_arc_length
from shockgrid.regrid.equidistribution.weights import Expression
from shockgrid.regrid.errors import BadInput, Mistakes, RegridFailure, suggest
from shockgrid.regrid.given import (
    find_start,
    make_boundary,
    make_polyline,
    orient_sides,
    read_source,
)
from shockgrid.regrid.measure.corners import compute_centres
from shockgrid.regrid.measure.quality import find_bad_cells
from shockgrid.regrid.protocol import call_regridder
from shockgrid.regrid.sides import SIDE_NAMES, compute_area
from shockgrid.regrid.text_files import read_columns

FORMULA_CURVE_POINTS = 1025  # points on a curve given by formulas
# of the regridder; the last moves no node by more cells than that
MOST_SETTLING_PASSES = 20
SETTLED_NODE_MOVE = 1e-3
# Text such as "1e5*(1 + 0.1*sin(pi*x))": of x and y [m] in a state, of the time t [s] at a side, of
# the part s of the way from 0 to 1 along a curve; parsed (`Expression`), never run.
Formula = float | str
Pair = tuple[Formula, Formula]
SideName = Literal["i_min", "i_max", "j_min", "j_max"]
LINKED = {"interface": "interface", "seam": "seam", "periodic": "periodic", "slide": "sliding"}
State = tuple[Formula, Formula, Formula, Formula]
Points = Annotated[tuple[tuple[Coordinate, Coordinate], ...], Meta(min_length=2)]
Vector = tuple[Coordinate, Coordinate]
Numbers = dict[str, int | float | str]
First = Annotated[int, Meta(ge=0, le=10**9)]
Count = Annotated[int, Meta(ge=1, le=4000)]
Cells = Annotated[int, Meta(ge=2, le=4000)]


class CurveTable(DeckTable, kw_only=True):
    """A curve by two formulas of s, from 0 to 1, or by points with the cells between them."""

    x: key(Formula | None, "x [m], a number or a formula of s") = None
    y: key(Formula | None, "y [m], a number or a formula of s") = None
    points: key(Points | None, "[[x, y], ...] [m], joined by straight lines") = None
    cells: key(tuple[Count, ...] | None, "cells on each line; points are nodes then") = None


Curve = key(
    str | Points | CurveTable,
    "a file with columns x and y [m], points [[x, y], ...] joined by straight lines, {x = ..., y = "
    "...}, formulas of s from 0 to 1, or {points = ..., cells = ...}",
)


class Curves(DeckTable, kw_only=True):
    """The four sides of a block; each may run either way, neighbours share their ends."""

    i_min: Curve
    i_max: Curve
    j_min: Curve
    j_max: Curve


class CarriedTable(DeckTable, kw_only=True):
    """A field that the cells of a block carry with their mass, such as a dye."""

    name: key(Name, "letters, digits and _, as in dumps and pictures")
    first: key(Formula, "its value at the start, a number or a formula of x and y") = 0.0
    unit: key(str, "its unit") = "1"
    least: key(float | None, "its least value. If left out: none") = None
    most: key(float | None, "its greatest value. If left out: none") = None


class BlockSide(DeckTable, kw_only=True):
    """What is at a side of a block, or at some of its faces."""

    side: key(SideName, "which side")
    kind: key(str, "wall, axis, piston, free-surface, inflow, outflow or an installed one")
    faces: key(tuple[First, First] | None, "from this face up to that. If left out: all") = None
    velocity: key(Pair | None, "of a piston or an open side: u, v [m/s] of t") = None
    pressure: key(Formula | None, "on a free surface [Pa], a number or a formula of t") = None
    state: key(State | None, "beyond an inflow: rho, u, v, p, numbers or formulas of t") = None
    carried: key(dict[str, float], "of carried fields, what comes in at an inflow, by name") = NONE
    options: key(Options, "further options of the kind, passed on") = NONE


class BlockTable(BodyTable, kw_only=True):
    """One block: its grid, its material, its state and its sides."""

    name: key(Name, "name, for links and files")
    grid: key(str, "file of its grid, or of its four curves: .npz, .h5, .vts, .vtk") = ""
    grid_block: key(str, "which of several blocks in that file") = ""
    curves: key(Curves | None, "its four sides, where there is no file of a grid") = None
    cells: key(tuple[Cells, Cells] | None, "along i and j. If left out: those of its sides") = None
    material: key(str | Numbers, "a name, FILE.toml:NAME, or a table with eos and so on") = "air"
    rho: key(Formula | None, "density [kg/m3], of x, y. If left out: the material's at rest") = None
    u: key(Formula, "velocity along x [m/s], of x and y") = 0.0
    v: key(Formula, "velocity along y [m/s], of x and y") = 0.0
    p: key(Formula, "pressure [Pa], of x and y") = 1e5
    carried: key(tuple[CarriedTable, ...], "fields that its cells carry with their mass") = ()
    side: key(tuple[BlockSide, ...], "what is at its sides that are not linked") = ()


class LinkTable(DeckTable, kw_only=True):
    """Two runs of faces that lie on one another."""

    kind: key(
        Literal["interface", "seam", "periodic", "slide"],
        "interface: contact of two materials, nodes match; seam: cut inside one "
        "material; periodic: a period apart; slide: nodes need not match, the first side leads",
    )
    sides: key(tuple[str, str], 'two, such as "left.i_max" or "left.i_max[0:8]", faces 0 to 7')
    tension: key(float, "surface tension of an interface [N/m]", ge=0, le=1e20) = 0.0
    bonded: key(bool, "solids on both sides of an interface stick together") = False


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


class BlocksDeck(SolidDeck, kw_only=True):
    run: RunControl = RunControl(t_end=1e-3)
    regrid: Regrid = Regrid()
    title: key(str, "a line for the summary") = ""
    geometry: key(Literal["plane", "axisymmetric"], "axisymmetric: y is the radius") = "plane"
    mesh: key(Literal["regrid", "fixed"], "grids follow moving sides, or rest") = "regrid"
    gravity: key(Vector, "acceleration of all blocks along x and y [m/s2]") = (0.0, 0.0)
    limiter: Limiter = "van-leer"
    void_fill: VoidFill = VoidFill()
    block: key(tuple[BlockTable, ...], "the blocks, [[block]] each", min_length=1) = (CHANNEL,)
    link: key(tuple[LinkTable, ...], "the links, [[link]] each") = ()

    def place_own_files(self, folder: Path, names: list[str]) -> BlocksDeck:
        blocks = []
        for block in self.block:
            changed: dict[str, Any] = {}
            if block.grid:
                changed["grid"] = place_file(block.grid, folder)
                names.append(changed["grid"])
            if block.curves is not None:
                sides = {side: getattr(block.curves, side) for side in SIDE_NAMES}
                files = {s: place_file(c, folder) for s, c in sides.items() if isinstance(c, str)}
                changed["curves"] = msgspec.structs.replace(block.curves, **files)
                names += files.values()
            blocks.append(msgspec.structs.replace(block, **changed))
        return msgspec.structs.replace(self, block=tuple(blocks))


def make_grid(deck: BlocksDeck, block: BlockTable) -> np.ndarray:
    """Nodes (2, ni+1, nj+1) [m] of a block; BadInput, naming it, where there is no valid grid."""
    where = f"block {block.name!r}"
    if bool(block.grid) == (block.curves is not None):
        raise BadInput(f"deck: {where}: give either a grid, the name of a file, or a table curves")
    if block.curves is not None:
        lines = {side: read_curve(block, side) for side in SIDE_NAMES}
        sides = orient_sides(lines, f"deck: {where}", {side: side for side in SIDE_NAMES})
        return make_on_sides(sides, deck, block, f"deck: {where}")
    found = read_source(block.grid, block.grid_block or None)
    where = f"{where}, {block.grid}"
    make = make_on_sides if isinstance(found, dict) else check_grid
    return make(found, deck, block, where)


def check_grid(nodes: np.ndarray, deck: BlocksDeck, block: BlockTable, where: str) -> np.ndarray:
    """A grid of a file as it is; BadInput where it is no plane one of convex cells."""
    if nodes.shape[0] != 2:
        raise BadInput(f"{where}: a 3D grid; blocks are 2D")
    cells = nodes.shape[1] - 1, nodes.shape[2] - 1
    if block.cells is not None and tuple(block.cells) != cells:
        raise BadInput(
            f"{where}: the file has {cells[0]} x {cells[1]} cells; "
            f"leave out cells = {list(block.cells)}, which is for blocks made on curves"
        )
    bad = find_bad_cells(nodes)
    if not len(bad):
        return nodes
    if compute_area(nodes) < 0.0:
        raise BadInput(f"{where}: i and j turn clockwise; mirror one of them: sides change names")
    i, j = (int(index) for index in bad[0])
    raise BadInput(
        f"{where}: {len(bad)} of {cells[0] * cells[1]} cells are not convex, the first is cell "
        f"({i}, {j}); shockgrid grid regrid makes a valid grid on the same sides"
    )


def read_curve(block: BlockTable, side: str) -> np.ndarray:
    """Polyline (2, n) [m] of a side, from a file, points or formulas of s."""
    curve = getattr(block.curves, side)
    where = f"deck: block {block.name!r}"
    if isinstance(curve, str):
        return make_polyline(read_columns(curve), side, curve)
    if not isinstance(curve, CurveTable):
        return make_polyline(np.array(curve).T, side, where)
    where = f"{where}, curve {side}"
    if (curve.x is None) != (curve.y is None) or (curve.x is None) == (curve.points is None):
        raise BadInput(f"{where}: give x and y, formulas of s, or points, and not both")
    pieces = len(curve.points or (0,)) - 1
    if curve.cells is not None and len(curve.cells) != pieces:
        raise BadInput(
            f"{where}: cells has "
            f"{len(curve.cells)} numbers for {pieces} straight lines between points"
        )
    if curve.points is None:
        s = {"s": np.linspace(0.0, 1.0, FORMULA_CURVE_POINTS if block.cells else 2)}
        values = [evaluate(getattr(curve, axis), s, f"{where}, {axis}") for axis in "xy"]
        return make_polyline(np.array(values), side, where)
    points = np.array(curve.points).T
    if curve.cells is None:
        return points
    at = np.concatenate([[0], np.cumsum(curve.cells)])
    return np.array([np.interp(np.arange(at[-1] + 1), at, row) for row in points])


def evaluate(formula: float | str, values: dict[str, np.ndarray], where: str) -> np.ndarray:
    """A number or a formula at the arrays of one shape in `values`; finite, else BadInput."""
    like = next(iter(values.values()))
    if isinstance(formula, str):
        expression = Expression(formula, where)
        expression.check_names(tuple(values))
        found = np.broadcast_to(expression.evaluate(values), np.shape(like)).astype(float)
    else:
        found = np.full(np.shape(like), float(formula))
    if not np.isfinite(found).all():
        at = tuple(np.argwhere(~np.isfinite(found))[0])
        place = ", ".join(f"{name} = {value[at]:.6g}" for name, value in values.items())
        raise BadInput(f"{where} '{formula}': it is not a finite number at {place}")
    return found


def make_on_sides(
    sides: dict[str, np.ndarray], deck: BlocksDeck, block: BlockTable, where: str
) -> np.ndarray:
    """The grid on four polylines; BadInput says why there is none."""
    for side, line in sides.items() if block.cells else ():
        count = block.cells[1 if side[0] == "i" else 0]
        curve = getattr(block.curves, side, None)
        given = getattr(curve, "cells", None)
        if given is None:
            sides[side] = distribute_by_arc_length(line, count + 1)
        elif sum(given) != count:
            raise BadInput(
                f"{where}: "
                f"curve {side} has {sum(given)} cells in all; the block has {count} along it"
            )
    boundary = make_boundary(sides, None, where)
    if compute_area(np.nan_to_num(boundary)) <= 0.0:
        raise BadInput(
            f"{where}: i and j turn clockwise; exchange i_min and i_max, or j_min and j_max"
        )
    try:
        nodes, _ = find_start(boundary)
        return settle(nodes, boundary, deck) if deck.mesh == "regrid" else nodes
    except RegridFailure as failure:
        raise BadInput(f"{where}: there is no valid grid on its curves: {failure}") from None


def settle(nodes: np.ndarray, boundary: np.ndarray, deck: BlocksDeck) -> np.ndarray:
    """The grid after passes of the deck's regridder; one that knows fields has none yet."""
    if deck.regrid.weight:
        return nodes
    regridder = deck.regrid.make(threads=1)
    if getattr(regridder, "owns_sides", False):
        return nodes
    count = (nodes.shape[1] - 1) * (nodes.shape[2] - 1)
    cell = np.sqrt(abs(compute_area(nodes)) / count)
    for _ in range(MOST_SETTLING_PASSES):
        new = call_regridder(regridder, nodes, boundary).nodes
        moved = np.abs(new - nodes).max()
        nodes = new
        if moved < SETTLED_NODE_MOVE * cell:
            break
    return nodes


def count_cells(block: BlockTable) -> int:
    """Cells that a block's table asks for in numbers; 0 where its grid or points lie in files."""
    if block.cells is not None:
        return math.prod(block.cells)
    if block.curves is None:
        return 0
    sides = (getattr(block.curves, side) for side in ("j_min", "i_min"))
    return math.prod(sum(getattr(curve, "cells", None) or ()) for curve in sides)


RUN_OF_FACES = re.compile(r"(?P<block>[^.\[\]]+)\.(?P<side>\w+)(\[(?P<start>\d+):(?P<stop>\d+)\])?")
# of every block, see `measure_means`
MEASURED = {
    "u_mean": "m/s",
    "v_mean": "m/s",
    "x_mass": "m",
    "p_max": "Pa",
    "p_max_x": "m",
    "p_max_y": "m",
}


class Blocks(Problem):
    """The blocks of the deck; `grids` are made when first asked for."""

    Deck = BlocksDeck
    deck: BlocksDeck

    def __init__(self, deck: BlocksDeck):
        super().__init__(deck)
        names = [block.name for block in deck.block]
        mistakes = Mistakes()
        mistakes.sentences += [
            f"deck: {names.count(name)} blocks are called {name!r}"
            for name in dict.fromkeys(names)
            if names.count(name) > 1
        ]
        self.materials = {}
        for block in deck.block:
            with mistakes.gather():
                self.materials[block.name] = find_block_material(block)
        mistakes.check()
        tables = {block.name: block for block in deck.block}
        self.laws = find_laws(deck, self.materials, tables)
        deck.regrid.check_weight()
        across = deck.geometry == "axisymmetric" and deck.gravity[1]
        with mistakes.gather():
            if across:
                raise deck.error("gravity", "in axisymmetric flow y is the radius; it is along x")
        for link in deck.link:
            where = f"deck: link: {link.sides}"
            if link.tension and link.kind == "slide":
                mistakes.sentences.append(f"{where}: a sliding contact has no tension")
            if link.bonded and link.kind != "interface":
                mistakes.sentences.append(
                    f"{where}: bonded is for interfaces; a {link.kind} is none"
                )
        mistakes.check()
        self.units = {f"{what}_{name}": unit for name in names for what, unit in MEASURED.items()}

    @functools.cached_property
    def grids(self) -> dict[str, np.ndarray]:
        """Nodes (2, ni+1, nj+1) of every block; BadInput where there is no valid grid."""
        grids = {}
        mistakes = Mistakes()
        for block in self.deck.block:
            with mistakes.gather():
                grids[block.name] = make_grid(self.deck, block)
        mistakes.check()
        return grids

    def estimate_cells(self) -> int:
        """Cells of the blocks on curves; grids in files are there already."""
        return sum(map(count_cells, self.deck.block))

    def make_grids(self, t=0.0):
        return self.grids

    def cautions(self, run) -> list[str]:
        """On contacts; before a run the grids are made, so that a check tells of faults."""
        if not run.begun:
            self.build()
        sides = [side for table in self.deck.block for side in table.side]
        surfaces = [side for side in sides if side.kind == "free-surface"]
        told = []
        if surfaces and any(link.kind == "periodic" for link in self.deck.link):
            told.append(
                "contacts of free surfaces do not go on across periodic sides: what meets only "
                "beyond one passes through; make the period longer"
            )
        holds = any("friction" in side.options or "weld" in side.options for side in surfaces)
        if holds and any(laws.strength is None for laws in self.laws.values()):
            told.append(
                "friction and welds hold the first row of cells along a contact alone, where "
                "materials have no strength: the momentum that passes falls with the size of cells"
            )
        return told + list_fluids(self.laws)

    def build(self) -> Simulation:
        deck = self.deck
        blocks = {}
        links = []
        mistakes = Mistakes()
        for table in deck.block:
            with mistakes.gather():
                blocks[table.name] = self.make_block(table)
        mistakes.check()
        for link in deck.link:
            with mistakes.gather():
                links.append(self.make_link(link, blocks))
        mistakes.check()
        flow = self.simulate(
            blocks.values(),
            links,
            mesh=deck.mesh,
            geometry=deck.geometry,
            source=make_gravity(*deck.gravity) if any(deck.gravity) else None,
            find_end=lambda flow: necks and necks.find_cut(),
            find_thin_place=lambda block: necks and necks.find_thin_place(block),
        )
        necks = Necks(flow.meetings.bodies) if flow.meetings.pairs else None
        return flow

    def make_link(self, link: LinkTable, blocks: dict[str, Block]) -> Any:
        """A link between sides of the blocks."""
        pair = []
        for text in link.sides:
            where = f"deck: link: {text!r}"
            found = RUN_OF_FACES.fullmatch(text.strip())
            if not found:
                raise BadInput(f'{where} is not a side; write "block.i_max" or "block.i_max[0:8]"')
            if (name := found["block"]) not in blocks:
                raise BadInput(f"{where}: there is no block {name!r}{suggest(name, blocks)}")
            faces = (int(found["start"]), int(found["stop"])) if found["start"] else ()
            pair.append((blocks[name], found["side"], *faces))
        if link.kind == "slide":
            return slide(*pair)
        options: dict[str, Any] = {"tension": link.tension} if link.tension else {}
        if link.bonded:
            options["bonded"] = True
        return join(link.kind, *pair, **options)

    def make_block(self, table: BlockTable) -> Block:
        """A block with its state and the segments of its sides that are not linked."""
        nodes = self.grids[table.name]
        material = self.materials[table.name]
        where = f"deck: block {table.name!r}"
        centres = find_centres_of_volume(find_geometry(self.deck.geometry), nodes)
        places = dict(zip("xy", centres, strict=True))
        rho = material.rho0 if table.rho is None else table.rho
        given = {"rho": rho, "u": table.u, "v": table.v, "p": table.p}.items()
        state = [evaluate(text, places, f"{where}, {name}") for name, text in given]
        label = find_name(table.material) if isinstance(table.material, str) else table.name
        carried = [
            CarriedField(
                field.name,
                field.unit,
                first=evaluate(field.first, places, f"{where}, carried {field.name!r}"),
                least=-math.inf if field.least is None else field.least,
                most=math.inf if field.most is None else field.most,
            )
            for field in table.carried
        ]
        options = {"material": label, "limiter": self.deck.limiter, "carried": carried}
        options |= self.laws[table.name].options
        block = Block(table.name, material.eos, nodes, *state, **options)
        for side in table.side:
            if side.kind in LINKED.values():
                raise BadInput(
                    f"{where}, side {side.side}: a side of kind {side.kind!r} is made by [[link]]"
                )
            options = collect_options(side, f"{where}, side {side.side}")
            put(block, side.side, side.kind, *side.faces or (), **options)
        return block

    def measure(self, evolution: Simulation) -> dict[str, float]:
        """Mean velocity and centre of mass by mass, greatest pressure and its cell, by block."""
        return {
            f"{name}_{table.name}": number
            for table, block in zip(self.deck.block, evolution.blocks, strict=True)
            for name, number in zip(MEASURED, measure_means(block), strict=True)
        }

    def report(self, run) -> Report:
        notes = []
        for name in (block.name for block in self.deck.block if run.begun):
            u, v, x, p, x_most, y_most = (run.history[f"{what}_{name}"] for what in MEASURED)
            row = int(np.argmax(p))
            notes.append(
                f"{name}: mean velocity {u[-1]:.5g} m/s along x, {v[-1]:.3g} along y; its centre "
                f"of mass went {x[-1] - x[0]:.4g} m along x; pressure up to {p[row]:.4g} Pa, in "
                f"the cell at ({x_most[row]:.4g}, {y_most[row]:.4g}) m at t = "
                f"{run.history['t'][row]:.4g} s"
            )
        return Report(self.deck.title or "blocks of a deck:", notes=notes)


def measure_means(block: Block) -> list[float]:
    """What MEASURED names, of a block."""
    rho, u, v, p = block.state[:, 1:-1, 1:-1]
    mass = rho * block.volume
    x, y = compute_centres(block.nodes)
    means = [float((mass * field).sum() / mass.sum()) for field in (u, v, x)]
    most = np.unravel_index(p.argmax(), p.shape)
    return [*means, float(p[most]), float(x[most]), float(y[most])]


def find_block_material(block: BlockTable) -> Material:
    """The material that a block names or describes; BadInput with the block's name."""
    where = f"deck: block {block.name!r}"
    if isinstance(block.material, dict):
        table = {"source": "the deck", "rho0": 1.0, **block.material}
        if "rho0" not in block.material and block.rho is None:
            raise BadInput(f"{where}: rho is missing, and its material says no rho0")
        return make_material(f"{where}, material", table, Path())
    try:
        return find_material(block.material)
    except BadInput as error:
        raise BadInput(f"{where}: {error}") from None


def collect_options(side: BlockSide, where: str) -> dict[str, Any]:
    """The options of a side's segment; formulas of t are functions of time."""
    options = dict(side.options)
    where = f"{where}, {side.kind}"
    if side.velocity is not None:  # that of an open side is constant
        fixed = side.kind == "inflow"
        options["velocity"] = side.velocity if fixed else follow_time(side.velocity, where)
    if side.state is not None:
        options["state"] = follow_time(side.state, where)
    if side.carried:
        options["carried"] = dict(side.carried)
    if side.pressure is not None:
        first = follow_time((side.pressure,), where)
        options["pressure"] = lambda t: first(t)[0]
    return options


def follow_time(formulas: tuple, where: str) -> Callable[[float], tuple[float, ...]]:
    """A function of time [s] that gives the values; BadInput for a formula that is none."""
    parsed = [Expression(str(one), where) for one in formulas]
    for one in parsed:
        one.check_names(("t",))

    def at(t: float) -> tuple[float, ...]:
        return tuple(float(one.evaluate({"t": np.float64(t)})) for one in parsed)

    if not np.isfinite(at(0.0)).all():
        raise BadInput(f"{where}: {list(formulas)} is not a finite number at t = 0")
    return at
