"""What the commands `shockgrid grid list | make | regrid | check` do, as functions.

Each returns the lines to be shown.  Outputs are checked before anything is computed.
"""

from __future__ import annotations

import inspect
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from regrid.domains import DOMAINS, make_domain
from regrid.domains_in_space import BLOCKS, SHAPES
from regrid.errors import BadInput, RunFailure
from regrid.given import read_grid
from regrid.registry import find_usable, load_regridder, takes_weight
from runs.grids.making import (
    Made,
    default_cells,
    make_family,
    make_in_block,
    make_moving,
    make_plane,
    make_spatial_law,
    march,
    parse_options,
    regrid_plane,
    regrid_space,
)
from runs.grids.quality import (
    Judgement,
    check_free,
    describe,
    describe_histograms,
    judge,
    plan_outputs,
    write_grid,
)

CELLS_IN_SPACE = (20, 20, 20)
MOST_CELLS = 4_000_000
Files = tuple[tuple[str, ...], bool, bool]  # names given with -o, --force, --plot
Request = tuple[str | None, tuple[str, ...], str | None]  # family, --option words, weight


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
        domain = make_domain(name, *default_cells(name))
        marches.append((name.replace("_", "-"), march(domain, make_family("barrier", {}), 40)))
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
    request: Request,
    cells: str | None,
    motion: tuple[int, float, int],
    block: str | None,
    files: Files,
) -> list[str]:
    """`grid make`; `motion`: as in `make_plane`."""
    steps, at, _ = motion
    family, words, weight = request
    given, name = parse_options(words), source.replace("-", "_")
    in_space = name in BLOCKS or name in SHAPES
    size = parse_cells(cells, 3 if in_space else 2)
    if name in BLOCKS:
        _refuse_family(family, source)
        family, law = "ed3", make_spatial_law(given, weight)
        plan, label = _plan(files, f"{source}.h5"), source
        made = make_in_block(name, law, size or CELLS_IN_SPACE, given)
    else:
        family = family or "barrier"
        plan = _plan(files, f"{Path(source).stem}-{family}.h5")
        label = f"{source}, {family}"
        if in_space and weight is not None:
            raise BadInput(f"--weight: {source} moves; its families take none")
        if in_space:
            made = make_moving(name, family, given, size or CELLS_IN_SPACE, steps, at)
        else:
            regridder = make_family(family, given, weight)
            made = make_plane(source, family, regridder, size, motion, block, weight)
    made.made_by = {"source": source, "family": family, "options": " ".join(words)}
    made.made_by |= {"weight": weight or "", "at": at, "steps": steps}
    return _finish(made, label, plan)


def _refuse_family(family: str | None, source: str) -> None:
    if family is not None:
        raise BadInput(f"--family {family}: {source} is in space, where cells are equidistributed")


def regrid_file(
    file: str, request: Request, passes: int, block: str | None, files: Files
) -> list[str]:
    """`grid regrid`."""
    family, words, weight = request
    given = parse_options(words)
    nodes = read_grid(file, block)
    stem = Path(file).stem
    if nodes.shape[0] == 3:
        _refuse_family(family, file)
        law, family = make_spatial_law(given, weight), "ed3"
        plan = _plan(files, f"{stem}-{family}.h5")
        made = regrid_space(nodes, law, given)
    else:
        family = family or "barrier"
        regridder = make_family(family, given, weight)
        plan = _plan(files, f"{stem}-{family}.h5")
        made = regrid_plane(nodes, regridder, passes, weight)
    before = judge(nodes)
    made.made_by = {"source": file, "family": family, "options": " ".join(words)}
    made.made_by |= {"weight": weight or ""}
    made.notes.insert(
        0,
        f"before: {len(before.bad_cells)} cells not convex, minimum scaled Jacobian "
        f"{before.least_sine:.4f}, worst aspect ratio {before.worst_aspect:.3f}",
    )
    return _finish(made, f"{file}, {family}", plan)


def check_file(
    file: str, block: str | None, picture: str | None, force: bool
) -> tuple[list[str], bool]:
    """`grid check`: the lines, and whether every cell is convex."""
    nodes = read_grid(file, block)
    if picture:
        check_free(Path(picture), force)
    judgement = judge(nodes)
    lines = [_title(file, nodes)]
    lines += ["  " + line for line in describe(judgement)]
    lines += ["  " + line for line in describe_histograms(judgement)]
    if picture:
        title = _title(file, nodes)
        lines.append(f"picture: {_draw(Made(nodes, []), judgement, title, Path(picture))}")
    return lines, judgement.valid


@dataclass(frozen=True)
class Plan:
    """Files to write, those of them that were asked for by name, the picture's path or None."""

    paths: list[Path]
    named: list[Path]
    picture: Path | None


def _plan(files: Files, default: str) -> Plan:
    outputs, force, picture = files
    paths = plan_outputs(outputs or (default,), force)
    drawn = paths[0].with_suffix(".png") if picture else None
    if drawn:
        check_free(drawn, force)
    return Plan(paths, paths if outputs else [], drawn)


def _title(label: str, nodes: np.ndarray) -> str:
    return f"{label}: {' x '.join(str(n - 1) for n in nodes.shape[1:])} cells"


def _finish(made: Made, label: str, plan: Plan) -> list[str]:
    """Judge, write, draw; the lines that tell of it.  RunFailure where there is no grid."""
    judgement = judge(made.nodes, made.weight)
    title = _title(label, made.nodes)
    if made.failure:
        words = made.failure + _keep_failed(made, judgement, title, plan)
        raise RunFailure(words, cause="no-grid")
    lines = [title, *("  " + line for line in (*made.notes, *describe(judgement)))]
    lines.append("written: " + _write(made, judgement, plan.paths))
    if plan.picture:
        lines.append(f"picture: {_draw(made, judgement, title, plan.picture)}")
    return lines


def _keep_failed(made: Made, judgement: Judgement, title: str, plan: Plan) -> str:
    """Write and draw what was asked for under names ending in -failed; words about it.

    Older ones are replaced: they hold nothing that anybody wants to keep.
    """
    made.made_by["failure"] = made.failure
    paths = [path.with_stem(path.stem + "-failed") for path in plan.named]
    words = f"; what it came to is in {_write(made, judgement, paths)}" if paths else ""
    if plan.picture:
        path = plan.picture.with_stem(plan.picture.stem + "-failed")
        words += f"; picture: {_draw(made, judgement, f'{title}, FAILED', path)}"
    return words


def _write(made: Made, judgement: Judgement, paths: list[Path]) -> str:
    written = [w for p in paths for w in write_grid(p, made.nodes, judgement, made.made_by)]
    return "  ".join(str(path) for path in written)


def _draw(made: Made, judgement: Judgement, title: str, path: Path) -> Path:
    from runs.grids.pictures import draw_block, draw_grid

    if made.nodes.shape[0] == 3:
        spreads = made.equidistributed.spreads if made.equidistributed else None
        return draw_block(made.nodes, title, path, spreads)
    return draw_grid(judgement, title, path, made.sides)
