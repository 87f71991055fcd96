"""What the commands `shockgrid grid list | make | regrid | check | compare` do, as functions.

Each gives the lines to be shown.  Outputs are checked before anything is computed.

To compare families a domain is marched from its simple shape to its last one; a flow is run from
its start to its end, with each family; on the sides in a file a family is called until its grid
stays.  Note: figures are the worst over the steps that a family survived (in a file those of the
last grid); one that ends early looks better than it is, so the steps come first.
"""

from __future__ import annotations

import inspect
import math
import textwrap
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from shockgrid.problems.registry import PROBLEMS
from shockgrid.regrid.domains import DOMAINS, make_domain
from shockgrid.regrid.domains_in_space import BLOCKS, SHAPES
from shockgrid.regrid.errors import BadInput, RunFailure
from shockgrid.regrid.given import is_file_name, read_grid, read_sides, read_source
from shockgrid.regrid.marching import March
from shockgrid.regrid.measure.quality import measure_first_line_gap
from shockgrid.regrid.registry import find_usable, load_regridder, takes_weight
from shockgrid.regrid.sides import SIDE_NAMES, get_side, get_sides
from shockgrid.runs.deck.reading import packaged_decks, read_deck
from shockgrid.runs.grids import making
from shockgrid.runs.grids.making import Grid, choose_family, name_family, parse_options
from shockgrid.runs.grids.quality import describe, plan_outputs
from shockgrid.runs.quantities import add_unit
from shockgrid.runs.store.files import check_free

MOST_GRID_CELLS = 4_000_000
Files = tuple[tuple[str, ...], bool, bool]  # names given with -o, --force, --plot


def list_everything() -> str:
    """Domains, blocks and families, each with its first line of words."""
    lines = []
    for head, makers in (
        ("domains (marched from a simple shape to the one described)", DOMAINS),
        ("blocks in space", BLOCKS),
        ("moving blocks in space (families barrier, equidistribution)", SHAPES),
    ):
        lines += [
            head,
            *(f"  {n.replace('_', '-'):22s} {_first(m)}" for n, m in makers.items()),
            "",
        ]
    lines.append("families (* takes a --weight)")
    for name in find_usable():
        star = "*" if takes_weight(name) else " "
        module = inspect.getmodule(load_regridder(name))
        lines.append(f"{star} {name:22s} {_first(load_regridder(name), module)}")
    return "\n".join(lines)


def draw_every_domain(picture: str, force: bool) -> str:
    """`grid list --plot`: the last grid of every domain, marched in 40 steps by the barrier."""
    import shockgrid.runs.pictures  # noqa: F401 - loads matplotlib
    from shockgrid.runs.grids.pictures import draw_gallery

    path = Path(picture)
    check_free(path, force)
    marches = []
    for name in DOMAINS:
        domain = make_domain(name, *making.default_cells(name))
        found = making.march(domain, choose_family("barrier"), making.MOTION_STEPS)
        marches.append((name.replace("_", "-"), found))
    return f"picture: {draw_gallery(marches, path)}"


def _first(thing, otherwise=None) -> str:
    docstring = inspect.getdoc(thing) or ""
    if not docstring or docstring.startswith("`"):
        docstring = inspect.getdoc(otherwise) or docstring
    return " ".join(docstring.split("\n\n")[0].split()).partition(". ")[0].rstrip(".")


def parse_cells(text: str | None, dimensions: int = 2) -> tuple[int, ...] | None:
    """`60x40` as numbers; BadInput where it is not that."""
    if text is None:
        return None
    example = "60x40" if dimensions == 2 else "20x20x20"
    try:
        cells = tuple(int(word) for word in text.lower().replace("×", "x").split("x"))
    except ValueError:
        cells = ()
    if len(cells) != dimensions or min(cells) < 2:
        raise BadInput(f"--cells {text}: write {example}, with at least 2 cells each way")
    if math.prod(cells) > MOST_GRID_CELLS:
        raise BadInput(f"--cells {text}: more than {MOST_GRID_CELLS} cells; take fewer")
    return cells


def make_grid(
    source: str,
    files: Files,
    *,
    family: str | None,
    options: tuple[str, ...],
    cells: str | None,
    **words,
) -> list[str]:
    """`grid make`; words: of `making.make`."""
    name = source.replace("-", "_")
    given = _parse_family_options(options)
    size = parse_cells(cells, 3 if name in (*BLOCKS, *SHAPES) else 2)
    used = name_family(family, source, name in BLOCKS)
    label = f"{source}, {used}"
    stem = f"{Path(source).stem}-{used}"
    if name in BLOCKS:
        label = stem = source
    return _write(
        lambda: making.make(source, family, cells=size, **words, **given), label, stem, files
    )


def _parse_family_options(words: tuple[str, ...]) -> dict[str, Any]:
    """`parse_options` without those that are options of the command; BadInput for them."""
    given = parse_options(words)
    for key in ("family", "weight", "cells", "steps", "at", "block"):
        if key in given:
            other = ", such as --family barrier-i" if key == "family" else ""
            raise BadInput(f"--option {key}: write --{key}{other}")
    return given


def regrid_file(
    file: str,
    files: Files,
    *,
    family: str | None,
    options: tuple[str, ...],
    block: str | None,
    **words,
) -> list[str]:
    """`grid regrid`; words: of `making.regrid`."""
    given = _parse_family_options(options)
    grid = Grid(read_grid(file, block), made_by={"source": file})
    used = name_family(family, file, grid.nodes.shape[0] == 3)
    before = grid.quality

    def compute() -> Grid:
        made = making.regrid(grid, family, **words, **given)
        made.notes.insert(
            0,
            f"before: {len(before.bad_cells)} cells not convex, minimum scaled Jacobian "
            f"{before.least_sine:.4f}, worst aspect ratio {before.worst_aspect:.3f}",
        )
        return made

    return _write(compute, f"{file}, {used}", f"{Path(file).stem}-{used}", files)


def check_file(
    file: str, block: str | None, picture: str | None, force: bool
) -> tuple[list[str], bool]:
    """`grid check`: the lines, and whether every cell is convex."""
    grid = Grid(read_grid(file, block))
    if picture:
        check_free(Path(picture), force)
    title = _title(file, grid.nodes)
    lines = [title, *("  " + line for line in describe(grid.quality))]
    if picture:
        lines.append(f"picture: {_draw(grid, title, Path(picture))}")
    return lines, grid.quality.valid


def _title(label: str, nodes: np.ndarray) -> str:
    return f"{label}: {' x '.join(str(n - 1) for n in nodes.shape[1:])} cells"


def _write(compute: Callable[[], Grid], label: str, stem: str, files: Files) -> list[str]:
    """Make, judge, write, draw; the lines that tell of it.

    Where there is no grid, RunFailure; what was asked for by name is then written and drawn under
    names ending in -failed.  Older ones are replaced: they hold nothing that anybody wants to keep.
    """
    outputs, force, picture = files
    paths = plan_outputs(outputs or (f"{stem}.h5",), force)
    drawn = paths[0].with_suffix(".png")
    if picture:
        check_free(drawn, force)
    try:
        made = compute()
        title = _title(label, made.nodes)
    except making.NoGrid as error:
        made = error.made
        made.made_by["failure"] = made.failure
        title = f"{_title(label, made.nodes)}, FAILED"
        drawn, *paths = [p.with_stem(p.stem + "-failed") for p in (drawn, *paths)]
        paths = paths if outputs else []
    written = "  ".join(str(path) for path in made.write(*paths, force=True))
    if picture:
        _draw(made, title, drawn)
    if made.failure:
        files_note = f"; what it came to is in {written}" if written else ""
        files_note += f"; picture: {drawn}" if picture else ""
        raise RunFailure(made.failure + files_note, cause="no-grid")
    lines = [title, *("  " + line for line in (*made.notes, *describe(made.quality)))]
    return [*lines, f"written: {written}", *[f"picture: {drawn}"] * picture]


def _draw(made: Grid, title: str, path: Path) -> Path:
    import shockgrid.runs.pictures  # noqa: F401 - loads matplotlib
    from shockgrid.runs.grids.pictures import draw_block, draw_grid

    if made.nodes.shape[0] == 3:
        return draw_block(made.nodes, title, path, made.spreads)
    return draw_grid(made.quality, title, path, made.sides)


HEAD = (
    f"{'family':34s} {'steps':>12s} {'gap':>7s} {'min. sine':>10s} {'aspect':>8s}"
    f" {'µs/node':>8s} {'sub-moves':>9s} {'folded':>7s}"
)
REASON_CHARACTERS = 110  # characters of a reason that are shown
Compared = tuple[March, str, np.ndarray]  # what came of a family, its steps, the sides drawn
Compute = Callable[[str, dict[str, Any]], Compared]  # from the name and options of a family


def parse_family(words: str) -> tuple[str, dict[str, Any]]:
    """`name`, or `name:key=value:key=value`; BadInput for what the registry does not know."""
    name, *options = words.split(":")
    family = name, parse_options(tuple(options))
    choose_family(*family)
    return family


def every_family() -> list[str]:
    """All that is registered, and the paper's sweeps, which are an option of the barrier."""
    first, *others = find_usable()
    return [first, "barrier:method=sweeps", *others]


@dataclass(frozen=True)
class Comparison:
    """Which families are compared, and on what; the options of `shockgrid grid compare`."""

    families: Sequence[str]
    cells: tuple[int, int] | None
    steps: int
    weight: str | None
    settings: tuple[str, ...]
    block: str | None


def compare_families(
    domains: str, comparison: Comparison, picture: str | None, force: bool
) -> Iterator[str]:
    """Lines of the tables, as they are found; one table a domain, deck or file."""
    known = {label: parse_family(label) for label in comparison.families or every_family()}
    names = [name.strip() for name in domains.split(",") if name.strip()]
    kinds = {name: _find_kind(name) for name in names}
    if not names:
        raise BadInput(
            "name a domain, a deck of a flow or a file; `shockgrid grid list` shows the domains"
        )
    if comparison.settings and "flow" not in kinds.values():
        raise BadInput(f"--set changes the deck of a flow; a {kinds[names[0]]} has none")
    pictures = _plan_pictures(picture, names, force)
    for name in names:
        if kinds[name] == "flow":
            title, compute = _prepare_flow(name, comparison.settings)
        elif kinds[name] == "file":
            title, compute = _prepare_file(
                name, comparison.block, comparison.cells, comparison.steps
            )
        else:
            title, compute = _prepare_domain(name, comparison.cells, comparison.steps)
        yield f"{name}: {title}"
        yield HEAD
        drawn = []
        reasons = []
        for label, (family, options) in known.items():
            if comparison.weight is not None and takes_weight(family):
                options = {"weight": comparison.weight} | options
            march, done, sides = compute(family, options)
            yield describe_march(label, march, done)
            if march.failure:
                why = march.failure.removeprefix("regrid: ")
                why = textwrap.shorten(why, REASON_CHARACTERS, placeholder="...")
                reasons.append(f"  {label}, step {march.done + 1}: {why}")
            number, _, part = done.partition(" ")
            heading = f"{label}: {number} steps" + f", {part.strip()}" * bool(part)
            drawn.append((heading, march, sides))
        yield from reasons
        if name in pictures:
            import shockgrid.runs.pictures  # noqa: F401 - loads matplotlib
            from shockgrid.runs.grids.pictures import draw_comparison

            yield f"picture: {draw_comparison(drawn, name, pictures[name])}"
        yield ""


def _find_kind(name: str) -> str:
    """`domain`, `flow` or `file`; BadInput where there is none of that name."""
    if name.replace("-", "_") in DOMAINS:
        return "domain"
    if name in PROBLEMS or name in packaged_decks() or name.endswith(".toml"):
        return "flow"
    if is_file_name(name):
        return "file"
    make_domain(name, 4, 4)  # says which names are near
    return "domain"


def _plan_pictures(picture: str | None, names: list[str], force: bool) -> dict[str, Path]:
    if picture is None:
        return {}
    path = Path(picture)
    one = len(names) == 1
    found = {n: path if one else path.with_stem(f"{path.stem}-{Path(n).stem}") for n in names}
    for target in found.values():
        check_free(target, force)
    return found


def _prepare_domain(name: str, cells, steps: int) -> tuple[str, Compute]:
    ni, nj = cells or making.default_cells(name)
    domain = make_domain(name, ni, nj)

    def compute(family: str, options: dict[str, Any]) -> Compared:
        found = making.march(domain, choose_family(family, options), steps)
        last = found.done + 1 if found.failure else steps
        return found, f"{found.done}/{steps}", domain.boundary(last / steps)

    way = domain.travel_in_cells / steps
    return f"{ni} x {nj} cells, {steps} steps of {way:.2g} cells at the fastest node", compute


def _prepare_file(name: str, block: str | None, cells, passes: int) -> tuple[str, Compute]:
    source = read_source(name, block)
    given = not isinstance(source, dict) and cells is None  # a grid, whose own inside is the start
    sides = source if given else read_sides(name, block, cells)
    if sides.shape[0] == 3:
        raise BadInput(f"{name} is a grid in space; families are compared on plane grids")

    def compute(family: str, options: dict[str, Any]) -> Compared:
        regridder = choose_family(family, options)
        making.warm_up(make_domain("swan", 8, 8), regridder)
        if given:
            made = making.regrid_plane(sides, regridder, passes)
        else:
            made = making.make_on_curves(sides, regridder, passes, name)
        found = made.march or March(made.nodes, passes)
        found.nodes = made.nodes
        found.failure = made.failure
        if found.done:
            found.gap = max(measure_first_line_gap(found.nodes, side) for side in SIDE_NAMES)
        return found, f"{found.done}/{passes}", sides

    size = f"{sides.shape[1] - 1} x {sides.shape[2] - 1} cells"
    return f"{size}, the last of at most {passes} passes on its sides", compute


def describe_march(label: str, found: March, steps: str) -> str:
    """A line of the table under HEAD; `steps` is shown as it is."""
    if found.done == 0:
        return f"{label:34s} {steps:>12s} {'-':>7s} {'-':>10s} {'-':>8s} {'-':>8s}"
    return (
        f"{label:34s} {steps:>12s} {found.gap:7.2f} {found.sine:10.3g} {found.aspect:8.2f}"
        f" {found.cost:8.2f} {found.sub_moves:9d} {found.rescues:7d}"
    )


def _prepare_flow(name: str, settings: tuple[str, ...]) -> tuple[str, Compute]:
    read = read_deck(name, settings)
    if not hasattr(read.deck, "regrid") or read.problem == "grid-march":
        raise BadInput(f"{name}: the problem {read.problem} has no regridder to compare")
    problem = read.make_problem()
    started = problem.build()

    def compute(family: str, options: dict[str, Any]) -> Compared:
        found, part = _run_flow(read, family, options)
        return found, f"{found.done} {100.0 * part:3.0f}%", found.nodes

    sizes = ", ".join(f"{b.nodes.shape[1] - 1} x {b.nodes.shape[2] - 1}" for b in started.blocks)
    t_end = add_unit(started.t_end, problem.t_unit)
    return f"flow to t = {t_end}, blocks of {sizes} cells", compute


def _run_flow(read, name: str, options: dict[str, Any]) -> tuple[March, float]:
    """Run one flow as far as it goes; `nodes` of the result are those of the interface's block."""
    own = {"epsilon", "method", "edge_lengths"} & options.keys() if name == "barrier" else set()
    chosen = msgspec.structs.replace(
        read.deck.regrid,
        name=name,
        options={key: value for key, value in options.items() if key not in own},
        **{key: options[key] for key in own},
    )
    deck = msgspec.structs.replace(read.deck, regrid=chosen)
    evolution = replace(read, deck=deck).make_problem().build()
    block, sides = _find_interface(evolution.blocks)
    found = March(block.nodes.copy(), 0)
    inner = [(b.nodes.shape[1] - 2) * (b.nodes.shape[2] - 2) for b in (block, *evolution.blocks)]
    while evolution.finished is None:
        if deck.run.max_steps is not None and found.done >= deck.run.max_steps:
            found.failure = f"stopped after run.max_steps = {deck.run.max_steps} steps"
            break
        try:
            row = evolution.advance()
        except RunFailure as failure:
            found.failure = str(failure)
            break
        found.done = evolution.step
        # Of one node, whichever block it is in: `cost` divides by the shown block's own count.
        found.seconds.append(row.get("seconds_regrid", np.nan) * inner[0] / sum(inner[1:]))
        found.sine = min(found.sine, row["least_scaled_jacobian"])
        found.aspect = max(found.aspect, row["worst_aspect"])
        found.sub_moves += int(row.get("regrid_sub_moves", 0))
        found.rescues += int(row.get("regrid_rescues", 0))
        found.gap = max(found.gap, *(measure_first_line_gap(b.nodes, side) for b, side in sides))
    found.nodes = block.nodes.copy()
    found.steps = found.done
    return found, evolution.t / evolution.t_end


def _find_interface(blocks):
    """The block whose picture is drawn, and the sides that two blocks have in common.

    A flow of one block: all its sides.
    """
    sides = [
        (block, side)
        for block in blocks
        for side in SIDE_NAMES
        if any(
            other is not block and np.array_equal(get_side(block.nodes, side), line)
            for other in blocks
            for line in get_sides(other.nodes)
        )
    ]
    if not sides:
        return blocks[0], [(blocks[0], side) for side in SIDE_NAMES]
    return sides[-1][0], sides
