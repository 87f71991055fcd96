"""Blocks from a deck: own grids and curves, materials, states, sides and links by name.

Each `[[block]]` has a grid from a file or is made on four curves; `[[block.side]]` says what is at
its sides, `[[link]]` which sides of two blocks lie on one another.  Files are looked for beside the
deck.  Measured are the mean velocity, the centre of mass and the greatest pressure of every block.

Note: nothing here knows what the flow should be.  A side that is moved by the flow keeps to the
walls at its ends, and a wall that ends in a corner does not go on beyond it.
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from hydro.block import Block
from hydro.boundary import SEGMENTS, Linked, put
from hydro.eos.materials import Material, find_material, make_material
from hydro.links import join, slide
from hydro.simulation import Simulation
from hydro.sources import make_gravity
from problems.blocks.deck import LINKED, BlocksDeck, BlockSide, BlockTable, CurveTable
from problems.deck import check_digests
from problems.pictures import draw_field
from problems.problem import BlockPlan, Problem, Report, check_memory
from regrid.domains import distribute_by_arc_length
from regrid.equidistribution.weights import Expression
from regrid.errors import BadInput, RegridFailure, suggest
from regrid.given import find_start, make_boundary, make_polyline, orient_sides, read_source
from regrid.measure.corners import compute_centres
from regrid.measure.quality import find_bad_cells
from regrid.protocol import call_regridder
from regrid.sides import SIDE_NAMES, compute_area, get_sides
from regrid.text_files import read_columns

SAMPLES = 1025  # points on a curve given by formulas
PASSES, SETTLED = 20, 1e-3  # of the regridder; the last moves no node by more cells than that


def make_grid(deck: BlocksDeck, block: BlockTable) -> np.ndarray:
    """Nodes (2, ni+1, nj+1) [m] of a block; BadInput, naming it, where there is no valid grid."""
    where = f"block {block.name!r}"
    if bool(block.grid) == (block.curves is not None):
        raise BadInput(
            f"deck: {where}: give a grid, the name of a file, or a table curves, and not both"
        )
    if block.grid:
        found = read_source(block.grid, block.grid_block or None)
        where = f"{where}, {block.grid}"
        if not isinstance(found, dict):
            return _take(found, block, where)
        return make_on_sides(found, deck, block, where)
    lines = {side: read_curve(block, side) for side in SIDE_NAMES}
    sides = orient_sides(lines, f"deck: {where}", {side: side for side in SIDE_NAMES})
    return make_on_sides(sides, deck, block, f"deck: {where}")


def _take(nodes: np.ndarray, block: BlockTable, where: str) -> np.ndarray:
    """A plane grid as it is, i and j turned so that they go counter-clockwise."""
    if nodes.shape[0] != 2:
        raise BadInput(f"{where}: a 3D grid; blocks are 2D")
    cells = nodes.shape[1] - 1, nodes.shape[2] - 1
    if block.cells is not None and tuple(block.cells) != cells:
        raise BadInput(
            f"{where}: the file has a grid of {cells[0]} x {cells[1]} cells; cells = "
            f"{list(block.cells)} is for blocks made on curves: leave it out"
        )
    bad = find_bad_cells(nodes)
    if len(bad) and compute_area(nodes) < 0.0:
        raise BadInput(
            f"{where}: i and j turn clockwise; mirror one of them (the sides change their names)"
        )
    if len(bad):
        i, j = (int(index) for index in bad[0])
        raise BadInput(
            f"{where}: {len(bad)} of {cells[0] * cells[1]} cells are not convex, the first is cell "
            f"({i}, {j}); shockgrid grid regrid makes a valid grid on the same sides"
        )
    return nodes


def read_curve(block: BlockTable, side: str) -> np.ndarray:
    """Polyline (2, n) [m] of a side, from a file, points or formulas of s."""
    curve = getattr(block.curves, side)
    where = f"deck: block {block.name!r}"
    if isinstance(curve, CurveTable):
        check_table(curve, f"{where}, curve {side}")
        if curve.points is not None:
            points = np.array(curve.points).T
            return join_pieces(points, curve.cells) if curve.cells else points
        s = np.linspace(0.0, 1.0, SAMPLES if block.cells else 2)
        values = [
            evaluate(getattr(curve, axis), {"s": s}, f"{where}, curve {side}, {axis}")
            for axis in "xy"
        ]
        return make_polyline(np.array(values), side, where)
    if isinstance(curve, str):
        return make_polyline(read_columns(curve), side, curve)
    return make_polyline(np.array(curve).T, side, where)


def check_table(curve: CurveTable, where: str) -> None:
    """Raise BadInput for a table that is neither formulas nor points with as many cells."""
    formulas = curve.x is not None and curve.y is not None
    if formulas == (curve.points is not None) or (curve.x is None) != (curve.y is None):
        raise BadInput(f"{where}: give x and y, formulas of s, or points, and not both")
    if curve.cells is not None and (formulas or len(curve.cells) != len(curve.points or ()) - 1):
        pieces = 0 if formulas else len(curve.points or ()) - 1
        raise BadInput(
            f"{where}: cells has {len(curve.cells)} numbers for {pieces} straight lines between "
            "points"
        )


def join_pieces(points: np.ndarray, cells: tuple[int, ...]) -> np.ndarray:
    """Nodes (2, n + 1) on the straight lines between points (2, m), so many cells on each."""
    at = np.concatenate([[0], np.cumsum(cells)])
    return np.array([np.interp(np.arange(at[-1] + 1), at, row) for row in points])


def place_nodes(
    sides: dict[str, np.ndarray], block: BlockTable, where: str
) -> dict[str, np.ndarray]:
    """The curves with the nodes on them: given ones, else equal lengths of arc."""
    if block.cells is None:
        return sides
    placed = {}
    for side, line in sides.items():
        count = block.cells[1 if side[0] == "i" else 0]
        curve = getattr(block.curves, side, None)
        if isinstance(curve, CurveTable) and curve.cells is not None:
            if sum(curve.cells) != count:
                raise BadInput(
                    f"{where}: curve {side} has {sum(curve.cells)} cells in all; the block has "
                    f"{count} along it"
                )
            placed[side] = line
        else:
            placed[side] = distribute_by_arc_length(line, count + 1)
    return placed


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
        at = tuple(int(k) for k in np.argwhere(~np.isfinite(found))[0]) if found.ndim else ()
        at_words = ", ".join(
            f"{name} = {np.asarray(value)[at]:.6g}" for name, value in values.items()
        )
        raise BadInput(f"{where} '{formula}': it is not a finite number at {at_words}")
    return found


def make_on_sides(
    sides: dict[str, np.ndarray], deck: BlocksDeck, block: BlockTable, where: str
) -> np.ndarray:
    """The grid on four polylines; BadInput says why there is none."""
    boundary = make_boundary(place_nodes(sides, block, where), None, where)
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
    for _ in range(PASSES):
        new = call_regridder(regridder, nodes, boundary).nodes
        moved = np.abs(new - nodes).max()
        nodes = new
        if moved < SETTLED * cell:
            break
    return nodes


def find_extent(nodes: np.ndarray) -> tuple[tuple[float, float], tuple[float, float]]:
    """Least and greatest coordinates [m] of a grid, which are on its sides."""
    points = np.concatenate(get_sides(nodes), axis=1)
    low, high = points.min(axis=1), points.max(axis=1)
    return (float(low[0]), float(low[1])), (float(high[0]), float(high[1]))


def count_cells(block: BlockTable) -> int:
    """Cells that a block's table asks for in numbers; 0 where its grid or points lie in files."""
    if block.cells is not None:
        return math.prod(block.cells)
    if block.curves is None:
        return 0
    sides = (getattr(block.curves, side) for side in ("j_min", "i_min"))
    return math.prod(sum(getattr(curve, "cells", None) or ()) for curve in sides)


RUN_OF_FACES = re.compile(r"(?P<block>[^.\[\]]+)\.(?P<side>\w+)(\[(?P<start>\d+):(?P<stop>\d+)\])?")
MATCH = 1e-9  # nodes of linked sides are as near as that, over the size of the side
MEASURED = ("u_mean", "v_mean", "x_mass", "p_max")  # of every block, see `measure_means`
Run = tuple[str, str, int, int]  # block, side, first face and the one after the last


class Blocks(Problem):
    """The blocks of the deck; `grids` are made when first asked for."""

    Deck = BlocksDeck
    measures_sides = True  # a block's means are found by who has the block
    deck: BlocksDeck

    def __init__(self, deck: BlocksDeck):
        super().__init__(deck)
        names = [block.name for block in deck.block]
        for name in names:
            if names.count(name) > 1:
                raise BadInput(f"deck: {names.count(name)} blocks are called {name!r}")
        self.materials = {block.name: find_block_material(block) for block in deck.block}
        deck.regrid.check_weight()
        if deck.geometry == "axisymmetric" and deck.gravity[1]:
            raise BadInput(
                f"deck: gravity = {list(deck.gravity)}: in axisymmetric flow y is the radius; "
                "gravity is along x, the axis"
            )
        for link in deck.link:
            if link.tension and link.kind != "interface":
                raise BadInput(
                    f"deck: link: {link.sides[0]} and {link.sides[1]}: tension = "
                    f"{link.tension:g}; only a link of kind 'interface' has surface tension, this "
                    f"one is a {link.kind!r}"
                )
        for block in deck.block:
            for k, side in enumerate(block.side):
                check_side(side, f"deck: block {block.name!r}, side {k} ({side.side})")
        self.units = {
            f"{quantity}_{name}": unit
            for name in names
            for quantity, unit in (
                ("u_mean", "m/s"), ("v_mean", "m/s"), ("x_mass", "m"), ("p_max", "Pa")
            )
        }  # fmt: skip

    @functools.cached_property
    def grids(self) -> dict[str, np.ndarray]:
        """Nodes (2, ni+1, nj+1) of every block, linked sides compared; BadInput where they miss."""
        check_digests(self.deck.digests)
        grids = {block.name: make_grid(self.deck, block) for block in self.deck.block}
        for link in self.deck.link:
            one, two = (self.find_run(text, grids) for text in link.sides)
            if link.kind != "slide":
                check_match(link.kind, one, two, grids)
        return grids

    def find_run(self, text: str, grids: Mapping[str, np.ndarray]) -> Run:
        """The faces that "block.side" or "block.side[from:to]" means; BadInput where none."""
        found = RUN_OF_FACES.fullmatch(text.strip())
        if not found:
            raise BadInput(
                f'deck: link: {text!r} is not a side; write "block.i_max" or "block.i_max[0:8]"'
            )
        name, side = found["block"], found["side"]
        if name not in grids:
            raise BadInput(
                f"deck: link: {text!r}: there is no block {name!r}{suggest(name, grids)}"
            )
        if side not in ("i_min", "i_max", "j_min", "j_max"):
            known = ("i_min", "i_max", "j_min", "j_max")
            raise BadInput(f"deck: link: {text!r}: there is no side {side!r}{suggest(side, known)}")
        count = grids[name].shape[2 if side[0] == "i" else 1] - 1
        start, stop = (int(found["start"] or 0), int(found["stop"] or count))
        if not start < stop <= count:
            raise BadInput(f"deck: link: {text!r}: the side has the faces 0 to {count}")
        return name, side, start, stop

    def estimate_cells(self) -> int:
        """Cells of the blocks on curves; grids in files are there already."""
        return sum(map(count_cells, self.deck.block))

    def plan(self):
        """End time and blocks, all files having been read and all grids made."""
        check_memory(self)
        plans = [
            BlockPlan(name, (nodes.shape[1] - 1, nodes.shape[2] - 1), *find_extent(nodes))
            for name, nodes in self.grids.items()
        ]
        return self.deck.run.t_end, plans

    def cautions(self, history=None) -> list[str]:
        """None; without a history the grids are made, so that a check tells what is wrong."""
        if history is None:
            self.build()
        return []

    def build(self) -> Simulation:
        deck = self.deck
        blocks = {table.name: self.make_block(table) for table in deck.block}
        links: list[Any] = []
        for link in deck.link:
            ends = [self.find_run(text, self.grids) for text in link.sides]
            one, two = ((blocks[name], *faces) for name, *faces in ends)
            options = {"tension": link.tension} if link.tension else {}
            links.append(
                slide(one, two) if link.kind == "slide" else join(link.kind, one, two, **options)
            )
        return self.simulate(
            blocks.values(),
            links,
            mesh=deck.mesh,
            geometry=deck.geometry,
            source=make_gravity(*deck.gravity) if any(deck.gravity) else None,
            measure_block=measure_means,
            measured_numbers=len(MEASURED),
        )

    def make_block(self, table: BlockTable) -> Block:
        """A block with its state and the segments of its sides that are not linked."""
        nodes, material = self.grids[table.name], self.materials[table.name]
        x, y = compute_centres(nodes)
        given = {"rho": material.rho0 if table.rho is None else table.rho}
        given |= {name: getattr(table, name) for name in ("u", "v", "p")}
        where = f"deck: block {table.name!r}"
        state = {
            name: evaluate(formula, {"x": x, "y": y}, f"{where}, {name}")
            for name, formula in given.items()
        }
        label = table.material if isinstance(table.material, str) else table.name
        block = Block(
            table.name,
            material.eos,
            nodes,
            *state.values(),
            material=label.rpartition(":")[2],
            limiter=self.deck.limiter,
        )
        for side in table.side:
            start, stop = side.faces or (0, block.side_faces(side.side)[1])
            if not start < stop <= block.side_faces(side.side)[1]:
                raise BadInput(
                    f"{where}, side {side.side}: faces {list(side.faces)}: the side has the faces "
                    f"0 to {block.side_faces(side.side)[1]}"
                )
            put(block, side.side, side.kind, start, stop, **collect_options(side, where))
        return block

    def measure(self, evolution: Simulation) -> dict[str, float]:
        """Mean velocity and centre of mass by mass, greatest pressure, of every block."""
        return {
            f"{name}_{table.name}": number
            for table, numbers in zip(self.deck.block, evolution.measured, strict=True)
            for name, number in zip(MEASURED, numbers, strict=True)
        }

    def report(self, history, final=None) -> Report:
        notes = [
            f"{name}: mean velocity {history[f'u_mean_{name}'][-1]:.5g} m/s along x, "
            f"{history[f'v_mean_{name}'][-1]:.3g} along y; its centre of mass went "
            f"{history[f'x_mass_{name}'][-1] - history[f'x_mass_{name}'][0]:.4g} m along x; "
            f"pressure up to {max(history[f'p_max_{name}']):.4g} Pa"
            for name in (block.name for block in self.deck.block if history)
        ]
        return Report(self.deck.title or "blocks of a deck:", notes=notes)

    def figures(self):
        return {"blocks": draw_blocks}


def measure_means(block: Block) -> list[float]:
    """What MEASURED names, of a block."""
    rho, u, v, p = block.state[:, 1:-1, 1:-1]
    mass = rho * block.volume
    x, _ = compute_centres(block.nodes)
    return [*(float((mass * field).sum() / mass.sum()) for field in (u, v, x)), float(p.max())]


def find_block_material(block: BlockTable) -> Material:
    """The material that a block names or describes; BadInput with the block's name."""
    where = f"deck: block {block.name!r}"
    if isinstance(block.material, dict):
        table = {"source": "the deck", "rho0": 1.0, **block.material}
        if "rho0" not in block.material and block.rho is None:
            raise BadInput(f"{where}: rho is missing, and its material says no rho0")
        from pathlib import Path

        return make_material(f"{where}, material", table, Path())
    try:
        return find_material(block.material)
    except BadInput as error:
        raise BadInput(f"{where}: {error}") from None


def check_side(side: BlockSide, where: str) -> None:
    """Raise BadInput for a kind that is none, that is for links, or that lacks what it needs."""
    if side.kind not in SEGMENTS:
        raise BadInput(f"{where}: there is no kind {side.kind!r}{suggest(side.kind, SEGMENTS)}")
    if issubclass(SEGMENTS[side.kind], Linked):
        link = next(name for name, kind in LINKED.items() if kind == side.kind)
        raise BadInput(f'{where}: a side of kind {side.kind!r} is made by [[link]] kind = "{link}"')
    needed = {"piston": "velocity", "inflow": "state"}.get(side.kind)
    if needed and getattr(side, needed) is None:
        raise BadInput(f"{where}: a side of kind {side.kind!r} needs the key {needed}")
    allowed = {
        "wall": (), "axis": (), "outflow": (), "piston": ("velocity",),
        "free-surface": ("pressure",), "inflow": ("state", "velocity"),
    }.get(side.kind)  # fmt: skip
    for key in ("velocity", "pressure", "state"):
        if allowed is not None and key not in allowed and getattr(side, key) is not None:
            raise BadInput(f"{where}: a side of kind {side.kind!r} has no {key}")
    collect_options(side, where)


def collect_options(side: BlockSide, where: str) -> dict[str, Any]:
    """The options of a side's segment; formulas of t are functions of time."""
    options: dict[str, Any] = dict(side.options)
    where = f"{where}, {side.kind}"
    if side.kind == "inflow" and side.velocity is not None:
        options["velocity"] = tuple(_constant(one, f"{where}, velocity") for one in side.velocity)
    elif side.velocity is not None:
        options["velocity"] = _of_time(side.velocity, f"{where}, velocity")
    if side.state is not None:
        options["state"] = _of_time(side.state, f"{where}, state")
    if side.pressure is not None:
        first = _of_time((side.pressure,), f"{where}, pressure")
        options["pressure"] = lambda t: first(t)[0]
    return options


def _of_time(formulas: tuple, where: str) -> Callable[[float], tuple[float, ...]]:
    """A function of time [s] that gives the values; BadInput for a formula that is none."""
    parsed = [Expression(one, where) if isinstance(one, str) else one for one in formulas]
    for one in parsed:
        if isinstance(one, Expression):
            one.check_names(("t",))

    def at(t: float) -> tuple[float, ...]:
        values = {"t": np.float64(t)}
        return tuple(
            float(one.evaluate(values)) if isinstance(one, Expression) else float(one)
            for one in parsed
        )

    if not np.isfinite(at(0.0)).all():
        raise BadInput(f"{where}: {list(formulas)} is not a finite number at t = 0")
    return at


def _constant(value: float | str, where: str) -> float:
    if isinstance(value, str):
        raise BadInput(f"{where}: {value!r}: an open side moves with a constant velocity, a number")
    return float(value)


def check_match(kind: str, one: Run, two: Run, grids: Mapping[str, np.ndarray]) -> None:
    """Raise BadInput where nodes of two linked sides do not match, with the largest gap."""
    (name_1, side_1, *_), (name_2, side_2, *_) = one, two
    lines = [_take_line(run, grids) for run in (one, two)]
    sides = f"{name_1}.{side_1} and {name_2}.{side_2}"
    counts = [line.shape[1] - 1 for line in lines]
    if counts[0] != counts[1]:
        raise BadInput(
            f"deck: link: {sides} have {counts[0]} and {counts[1]} faces; they must be as many, or "
            'be linked by kind = "slide"'
        )
    ways = []
    for order in (1, -1):
        apart = lines[1][:, ::order] - lines[0]
        if kind == "periodic":
            apart = apart - apart.mean(axis=1)[:, None]
        ways.append(np.hypot(*apart))
    gaps = min(ways, key=lambda gap: float(gap.max()))
    k = int(gaps.argmax())
    if gaps[k] > MATCH * np.ptp(lines[0], axis=1).max():
        x, y = lines[0][:, k]
        raise BadInput(
            f"deck: link: the nodes of {sides} do not match: the largest gap is {gaps[k]:.3g} m at "
            f"node {one[2] + k} of {name_1}.{side_1}, ({x:.6g}, {y:.6g})"
        )


def _take_line(run: Run, grids: Mapping[str, np.ndarray]) -> np.ndarray:
    name, side, start, stop = run
    edge = -1 if side.endswith("max") else 0
    nodes = grids[name]
    line = nodes[:, edge, :] if side[0] == "i" else nodes[:, :, edge]
    return line[:, start : stop + 1]


def draw_blocks(figure, run_data) -> None:
    """Pressure at the end, the outlines of the blocks and every fourth grid line."""
    dump = run_data.dumps[-1]
    low = np.min([block.nodes.min(axis=(1, 2)) for block in dump.blocks], axis=0)
    width, height = np.max([block.nodes.max(axis=(1, 2)) for block in dump.blocks], axis=0) - low
    figure.set_size_inches(10.0, float(np.clip(8.5 * height / width + 2.0, 3.0, 10.0)))
    axis = figure.subplots()
    outlines = [
        block.nodes[index]
        for block in dump.blocks
        for index in (np.s_[:, 0], np.s_[:, -1], np.s_[:, :, 0], np.s_[:, :, -1])
    ]
    picture = draw_field(axis, dump, "p", every=4, lines=outlines)
    figure.colorbar(
        picture, ax=axis, orientation="horizontal", fraction=0.08, aspect=50, label="pressure [Pa]"
    )
    axis.set_title(f"t = {dump.t:.4g} s", fontsize="medium")
