"""What the commands `shockgrid grid list | make | regrid | check` do, as functions.

Each gives the lines to be shown.  Outputs are checked before anything is computed.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from regrid.domains import DOMAINS, make_domain
from regrid.domains_in_space import BLOCKS, SHAPES
from regrid.errors import BadInput, RunFailure
from regrid.given import read_grid
from regrid.registry import find_usable, load_regridder, takes_weight
from runs.grids import making
from runs.grids.making import Grid, name_family, parse_options
from runs.grids.quality import check_free, describe, describe_histograms, judge, plan_outputs

MOST_CELLS = 4_000_000
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
    from runs.grids.pictures import draw_gallery

    path = Path(picture)
    check_free(path, force)
    marches = []
    for name in DOMAINS:
        domain = make_domain(name, *making.default_cells(name))
        found = making.march(domain, making.choose_family("barrier"), making.STEPS)
        marches.append((name.replace("_", "-"), found))
    return f"picture: {draw_gallery(marches, path)}"


def _first(thing, otherwise=None) -> str:
    words = inspect.getdoc(thing) or ""
    if not words or words.startswith("`"):
        words = inspect.getdoc(otherwise) or words
    return " ".join(words.split("\n\n")[0].split()).partition(". ")[0].rstrip(".")


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
    if math.prod(cells) > MOST_CELLS:
        raise BadInput(f"--cells {text}: more than {MOST_CELLS} cells; take fewer")
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
    size = parse_cells(cells, 3 if making.is_in_space(source) else 2)
    given, own = parse_options(options), source.replace("-", "_") in BLOCKS
    used = name_family(family, source, own)
    label, stem = (source, source) if own else (f"{source}, {used}", f"{Path(source).stem}-{used}")
    return _write(
        lambda: making.make(source, family, given, cells=size, **words), label, stem, files
    )


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
    given, nodes = parse_options(options), read_grid(file, block)
    used = name_family(family, file, nodes.shape[0] == 3)

    def compute() -> Grid:
        before, made = judge(nodes), making.regrid(nodes, family, given, source=file, **words)
        words_before = (
            f"before: {len(before.bad_cells)} cells not convex, minimum scaled Jacobian "
            f"{before.least_sine:.4f}, worst aspect ratio {before.worst_aspect:.3f}"
        )
        made.notes.insert(0, words_before)
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
    told = [*describe(grid.quality), *describe_histograms(grid.quality)]
    lines = [title, *("  " + line for line in told)]
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
    made = compute()
    title, words = _title(label, made.nodes), made.failure
    if made.failure:
        made.made_by["failure"] = made.failure
        title += ", FAILED"
        drawn, *paths = [p.with_stem(p.stem + "-failed") for p in (drawn, *paths)]
        paths = paths if outputs else []
    written = "  ".join(str(path) for path in made.write(*paths, force=True))
    if picture:
        _draw(made, title, drawn)
    if words is not None:
        words += f"; what it came to is in {written}" if written else ""
        words += f"; picture: {drawn}" if picture else ""
        raise RunFailure(words, cause="no-grid")
    lines = [title, *("  " + line for line in (*made.notes, *describe(made.quality)))]
    return [*lines, f"written: {written}", *[f"picture: {drawn}"] * picture]


def _draw(made: Grid, title: str, path: Path) -> Path:
    from runs.grids.pictures import draw_block, draw_grid

    if made.nodes.shape[0] == 3:
        return draw_block(made.nodes, title, path, made.spreads)
    return draw_grid(made.quality, title, path, made.sides)
