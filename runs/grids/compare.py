"""`shockgrid grid compare`: families of grids side by side, on named domains, in a flow, in files.

A domain is marched from its simple shape to its last one; a flow is run from its start to its
end, with each family; on the sides in a file a family is called until its grid stays.  Rows are
handed out as they are found.

Note: figures are the worst over the steps that a family survived (in a file those of the last
grid); one that ends early looks better than it is, so the steps come first.
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from problems.registry import PROBLEMS
from regrid.domains import DOMAINS, make_domain
from regrid.errors import BadInput, RunFailure
from regrid.given import is_file_name, read_sides, read_source
from regrid.measure.quality import measure_first_line_gap
from regrid.registry import find_usable, takes_weight
from regrid.sides import SIDE_NAMES, get_side, get_sides
from runs.deck.reading import packaged_decks, read_deck
from runs.grids.making import (
    March,
    default_cells,
    make_family,
    make_on_curves,
    march,
    parse_options,
    regrid_plane,
    warm_up,
)
from runs.grids.quality import check_free

HEAD = (
    f"{'family':34s} {'steps':>12s} {'gap':>7s} {'min. sine':>10s} {'aspect':>8s}"
    f" {'us/node':>8s} {'sub-moves':>9s} {'folded':>7s}"
)
REASON = 110  # characters of a reason that are shown


class Family(NamedTuple):
    """A name of the registry with options, as given on the command line."""

    label: str
    name: str
    options: dict[str, Any]


def parse_family(words: str) -> Family:
    """`name`, or `name:key=value:key=value`; BadInput for what the registry does not know."""
    name, *options = words.split(":")
    family = Family(words, name, parse_options(tuple(options)))
    make_family(family.name, family.options)
    return family


def every_family() -> list[Family]:
    """All that is registered, and the paper's sweeps, which are an option of the barrier."""
    families = [Family(name, name, {}) for name in find_usable()]
    sweeps = Family("barrier:method=sweeps", "barrier", {"method": "sweeps"})
    return [families[0], sweeps, *families[1:]]


def compare_families(
    domains: str,
    cells: tuple[int, int] | None,
    steps: int,
    words: Sequence[str],
    weight: str | None,
    settings: tuple[str, ...],
    block: str | None,
    picture: str | None,
    force: bool,
) -> Iterator[str]:
    """Lines of the tables, as they are found; one table a domain, deck or file."""
    families = [parse_family(word) for word in words] or every_family()
    names = [name.strip() for name in domains.split(",") if name.strip()]
    kinds = {name: _find_kind(name) for name in names}
    if not names:
        raise BadInput(
            "name a domain, a deck of a flow or a file; `shockgrid grid list` shows the domains"
        )
    if settings and "flow" not in kinds.values():
        raise BadInput(f"--set changes the deck of a flow; a {kinds[names[0]]} has none")
    pictures = _plan_pictures(picture, names, force)
    for name in names:
        if kinds[name] == "flow":
            title, compute = _prepare_flow(name, settings)
        elif kinds[name] == "file":
            title, compute = _prepare_file(name, block, cells, steps)
        else:
            title, compute = _prepare_domain(name, cells, steps)
        yield title
        yield HEAD
        drawn, reasons = [], []
        for family in families:
            found = compute(family, weight if takes_weight(family.name) else None)
            yield describe_march(family.label, found.march, found.steps)
            if found.march.failure:
                words_why = found.march.failure.removeprefix("regrid: ")
                why = textwrap.shorten(words_why, REASON, placeholder="...")
                reasons.append(f"  {family.label}{found.when}: {why}")
            drawn.append((f"{family.label}: {found.title}", found.march, found.sides))
        yield from reasons
        if name in pictures:
            from runs.grids.pictures import draw_comparison

            yield f"picture: {draw_comparison(drawn, name, pictures[name])}"
        yield ""


class Compared(NamedTuple):
    """What came of a family: its march, the steps and the title in words, the sides that are drawn,
    and when it failed."""

    march: March
    steps: str
    title: str
    sides: np.ndarray
    when: str = ""


Compute = Callable[[Family, str | None], Compared]  # from a family and its weight


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
    ni, nj = cells or default_cells(name)
    domain = make_domain(name, ni, nj)

    def compute(family: Family, weight: str | None) -> Compared:
        found = march(domain, make_family(family.name, family.options, weight), steps)
        last = found.done + 1 if found.failure else steps
        title, when = f"{found.done} of {steps} steps", f", step {found.done + 1}"
        return Compared(found, f"{found.done}/{steps}", title, domain.boundary(last / steps), when)

    way = domain.travel_in_cells / steps
    words = f"{ni} x {nj} cells, {steps} steps of {way:.2g} cells at the fastest node"
    return f"{name}: {words}", compute


def _prepare_file(name: str, block: str | None, cells, passes: int) -> tuple[str, Compute]:
    source = read_source(name, block)
    given = not isinstance(source, dict) and cells is None  # a grid, whose own inside is the start
    sides = source if given else read_sides(name, block, cells)
    if sides.shape[0] == 3:
        raise BadInput(f"{name} is a grid in space; families are compared on plane grids")

    def compute(family: Family, weight: str | None) -> Compared:
        regridder = make_family(family.name, family.options, weight)
        warm_up(make_domain("swan", 8, 8), regridder)
        if given:
            made = regrid_plane(sides, regridder, passes)
        else:
            made = make_on_curves(sides, regridder, passes, name)
        found = made.march or March(made.nodes, passes)
        found.nodes, found.failure = made.nodes, made.failure
        if found.done:
            found.gap = max(measure_first_line_gap(found.nodes, side) for side in SIDE_NAMES)
        title = "no grid" if made.failure else f"sine {found.sine:.2f}"
        return Compared(found, f"{found.done}/{passes}", title, sides)

    size = f"{sides.shape[1] - 1} x {sides.shape[2] - 1} cells"
    return f"{name}: {size}, the last of at most {passes} passes on its sides", compute


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
    started = read.make_problem().build()

    def compute(family: Family, weight: str | None) -> Compared:
        options = family.options | ({} if weight is None else {"weight": weight})
        found, part = _run_flow(read, family.name, options)
        share = 100.0 * part
        title = f"{share:.0f} % of the time"
        return Compared(found, f"{found.done} {share:3.0f}%", title, found.nodes)

    sizes = ", ".join(f"{b.nodes.shape[1] - 1} x {b.nodes.shape[2] - 1}" for b in started.blocks)
    return f"{name}: flow to t = {started.t_end:.6g} s, blocks of {sizes} cells", compute


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
