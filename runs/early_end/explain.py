"""What a run that ended early leaves behind: sentence, meaning, what has helped, a picture.

Nothing that goes wrong in here may hide the sentence: each part is made by itself, and one that
cannot be made is reported in its place.

What happened there is measured on the outlines of the last dump: two places of one outline that are
near each other, but far along it, have thin material between them, or a gap.  Below MET of the
distance of neighbouring nodes no grid resolves what lies between.
"""

from __future__ import annotations

import contextlib
import shlex
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from regrid.errors import BadInput, Place, RunFailure
from regrid.measure.quality import compute_corner_areas
from regrid.sides import get_side
from runs.deck.checking import is_runtime_key
from runs.deck.reading import ReadDeck, resolve_deck
from runs.early_end.causes import ENDS, Cause
from runs.store.directory import RunDirectory
from runs.store.dumps import has_state
from runs.store.files import write_atomically
from runs.store.history import read_history

MET = 0.1  # distances of neighbouring nodes: lines as near as this have met
DETOUR = 6.0  # times their distance: two places of an outline less far apart along it are one
NEAR = 10  # distances of neighbouring nodes from the place that failed
CALM = 0.3  # of the usual dt: with less a run is in trouble already
SHOWN = 3  # settings


@dataclass(frozen=True)
class EarlyEnd:
    """What was left of a run that ended early; None and () for what could not be made.

    picture: path of early-end.png; point: step of the restart point to go back to; settings: words
    for `--set`, the best first; commands: one for each of them; lines: all of it as words.
    """

    directory: Path
    cause: str
    picture: Path | None = None
    point: int | None = None
    settings: tuple[str, ...] = ()
    commands: tuple[str, ...] = ()
    lines: tuple[str, ...] = ()


def explain(failure: RunFailure, directory: RunDirectory, deck: ReadDeck, restart: str) -> EarlyEnd:
    """Write early-end.png and early-end.txt into `directory`, whose last dump shows the end.

    restart: the command that continues the run.  The failure gets what was made as its
    `early_end`, and the words as its notes.  Raises nothing that is an Exception.
    """
    from runs.store.reader import RunData  # not at the start of every run

    cause, made, lines = ENDS.get(failure.cause), {}, []

    def measure() -> str:
        outputs = RunData(directory.path).outputs
        return describe_event(outputs[-1].blocks, failure.place) if outputs else ""

    def draw() -> Path:
        from runs.early_end.picture import draw_early_end

        title = str(failure).partition("; last restart point is")[0]
        title = title.partition("; there is no restart point yet")[0]
        run = RunData(directory.path)
        marked = find_marked(run.outputs[-1].blocks, failure.place)
        return draw_early_end(run, title, failure.place, marked, made["point"])

    def attempt(part: Callable[[], Any], otherwise: str) -> Any:
        try:
            return part()
        except Exception as error:  # whatever it is: the sentence comes first
            lines.append(f"{otherwise}: {str(error).partition(chr(10))[0] or type(error).__name__}")
            return None

    if cause is not None:
        lines.append(f"what it means: {cause.means.replace('`', '')}")
    if event := attempt(measure, "the outlines could not be measured"):
        lines.append(f"what happened there: {event}")
    made["point"] = attempt(lambda: find_calm_point(directory), "no restart point could be chosen")
    settings = attempt(
        lambda: list_settings(cause, deck)[:SHOWN],
        "settings that have helped could not be looked up",
    )
    if settings:
        made["settings"] = tuple(one for one, _ in settings)
        made["commands"] = tuple(
            make_command(one, directory, deck, restart, made["point"]) for one in made["settings"]
        )
        lines.append("what has helped in such runs:")
        lines += [
            f"  {command}   ({words})"
            for command, (_, words) in zip(made["commands"], settings, strict=True)
        ]
    if picture := attempt(draw, "no picture of the place could be made"):
        made["picture"] = picture
        lines.append(f"picture of the place: {picture}")
    if cause is not None and cause.advice:
        lines.append(f"what else can be done: {cause.advice.replace('`', '')}")
    failure.early_end = EarlyEnd(directory.path, failure.cause, **made, lines=tuple(lines))
    for line in lines:
        failure.add_note(line)
    with contextlib.suppress(BadInput, OSError):
        write_atomically(directory.early_words, "\n".join([str(failure), *lines]) + "\n")
    return failure.early_end


def find_calm_point(directory: RunDirectory) -> int | None:
    """Step of the last restart point from before the trouble; None where there is none at all.

    Trouble begins after the last step that was not retried and had CALM of the usual dt.  Where all
    points are later, the first of them.
    """
    points = []
    for step, path in directory.list_points():
        try:
            points += [step] if has_state(path) else []
        except BadInput:  # torn
            continue
    if not points:
        return None
    history = read_history(directory.history)
    steps, dt = history.get("step"), history.get("dt")
    if steps is None or dt is None or len(steps) < 2:
        return points[-1]
    retries = history.get("retries", np.zeros(len(steps)))
    calm = steps[(dt >= CALM * float(np.nanmedian(dt))) & ~(retries > 0)]
    last = int(calm[-1]) if len(calm) else points[0]
    return max((s for s in points if s <= last and s < int(steps[-1])), default=points[0])


def list_settings(cause: Cause | None, deck: ReadDeck) -> list[tuple[str, str]]:
    """(`key=value`, what it does) of the settings of a cause that this deck can take."""
    found = []
    for setting in cause.settings if cause else ():
        present: Any = msgspec.to_builtins(deck.deck)
        for name in setting.key.split("."):
            present = present.get(name) if isinstance(present, dict) else None
        if (value := setting.choose(present)) is None:
            continue
        words = f"{setting.key}={value}"
        with contextlib.suppress(BadInput):  # not for this problem, or with this deck
            table = tomllib.loads(deck.to_toml())
            resolve_deck(table, deck.origin, (words,), deck.file).make_problem()
            found.append((words, setting.words))
    return found


def make_command(
    setting: str, directory: RunDirectory, deck: ReadDeck, restart: str, point: int | None
) -> str:
    """The command that continues, or starts again, with a setting."""
    words = f"--set {shlex.quote(setting)}"
    if not restart.startswith("shockgrid "):  # by a script: blocks of one's own
        return f"{restart}, with {setting}"
    if is_runtime_key(setting.partition("=")[0], type(deck.deck)) and point is not None:
        return f"{restart} --at {point} {words}"
    return f"shockgrid run {shlex.quote(str(directory.deck))} {words}"


def describe_event(blocks: Sequence, place: Place | None) -> str:
    """A sentence on the thinnest layer, neck or gap where it failed; "" where none is thin.

    Where one of a layer's sides is a seam inside one material, that is said: no material is cut.

    blocks: with `name` and `nodes` (2, ni + 1, nj + 1) [m]; without a place all are looked at.
    """
    named = [block for block in blocks if place is not None and block.name == place.block]
    found = []
    for block in named or blocks:
        cell = find_cell(block.nodes, place) if named else None
        centre = None if cell is None else block.nodes[:, cell[0], cell[1]]
        event = find_thinnest(block.nodes, centre)
        found += [(event, block.name)] if event is not None else []
    (share, width, sides, x, y, inside), name = min(
        found, key=lambda one: one[0][0], default=((np.inf, 0.0, ("", ""), 0.0, 0.0, False), "")
    )
    if share > MET:
        return ""
    size = f"{width:.3g} m, {share:.2g} of the distance of its nodes, at ({x:.6g}, {y:.6g})"
    one, other = sides
    if inside and one == other:
        return f"block '{name}' is pinched off: between two parts of its side {one} it is {size}"
    if inside and (seam := _find_seam(blocks, name, sides, x, y)) is not None:
        side, neighbour = seam
        return (
            f"side {other if side == one else one} of block '{name}' has come to its seam with "
            f"'{neighbour}', of the same material: what is left between them is {size}"
        )
    if inside:
        return f"block '{name}' is a thin layer: between its sides {one} and {other} it is {size}"
    whose = f"side {one} of '{name}' has" if one == other else f"sides {one} and {other} have"
    return f"{whose} met {'itself' if one == other else f'outside of {name!r}'}: the gap is {size}"


def _find_seam(blocks, name: str, sides, x: float, y: float) -> tuple[str, str] | None:
    """The one of two sides whose node nearest to (x, y) lies on another block of the same material,
    and that block's name."""
    block = next(block for block in blocks if block.name == name)
    material = getattr(block, "material", "")
    for side in sides if material else ():
        line = get_side(block.nodes, side)
        node = line[:, [int(np.argmin((line[0] - x) ** 2 + (line[1] - y) ** 2))]]
        close = 1e-9 * float(np.ptp(line, axis=1).max())
        for other in blocks:
            if other.name != name and getattr(other, "material", "") == material:
                if np.hypot(*(_trace_ring(other.nodes)[0] - node)).min() <= close:
                    return side, other.name
    return None


def find_thinnest(nodes: np.ndarray, centre: np.ndarray | None = None):
    """The nearest two places of a block's outline that are far apart along it, or None.

    Returns their distance over that of neighbouring nodes, their distance [m], their sides, x, y of
    the middle between them, and whether that lies inside of the block.  centre (2,): only nodes
    near it count.
    """
    ring, side = _trace_ring(nodes)
    way = np.roll(ring, -1, axis=1) - ring
    steps = np.hypot(*way)
    arc = np.concatenate(([0.0], np.cumsum(steps)))
    spacing, best = np.maximum(steps, np.roll(steps, 1)), None
    squares = np.maximum((way**2).sum(axis=0), 1e-300)
    for k in range(ring.shape[1]):
        here = ring[:, k : k + 1]
        if centre is not None and np.hypot(*(ring[:, k] - centre)) > NEAR * spacing[k]:
            continue
        part = np.clip(((here - ring) * way).sum(axis=0) / squares, 0.0, 1.0)
        foot = ring + part * way
        away = np.hypot(*(foot - here))
        along = np.abs(arc[:-1] + part * steps - arc[k])
        along = np.minimum(along, arc[-1] - along)
        far = (along > DETOUR * away) & (along > spacing[k])
        if not far.any():
            continue
        m = int(np.argmin(np.where(far, away, np.inf)))
        share = float(away[m] / spacing[k])
        if best is None or share < best[0]:
            x, y = 0.5 * (foot[:, m] + ring[:, k])
            best = share, float(away[m]), (side[k], side[m]), float(x), float(y)
    if best is None:
        return None
    (x0, y0), (x1, y1), (x, y) = ring, np.roll(ring, -1, axis=1), best[3:5]
    with np.errstate(all="ignore"):
        crossed = ((y0 > y) != (y1 > y)) & (x < x0 + (y - y0) / (y1 - y0) * (x1 - x0))
    return (*best, bool(np.count_nonzero(crossed) % 2))


def _trace_ring(nodes: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """Nodes (2, n) round a block, each once, and the side of the segment that begins at each."""
    parts = (
        ("j_min", nodes[:, :-1, 0]),
        ("i_max", nodes[:, -1, :-1]),
        ("j_max", nodes[:, :0:-1, -1]),
        ("i_min", nodes[:, 0, :0:-1]),
    )
    ring = np.concatenate([line for _, line in parts], axis=1)
    return ring, [name for name, line in parts for _ in range(line.shape[1])]


def find_cell(nodes: np.ndarray, place: Place | None) -> tuple[int, int] | None:
    """The cell (i, j) of a block that a place means: for nodes of a side the one beside the first
    of them; None where it names no more than the block."""
    if place is None:
        return None
    most_i, most_j = (n - 2 for n in nodes.shape[1:])
    if place.cell is not None:
        i, j = place.cell
    elif place.side and place.nodes:
        along = place.nodes[0]
        i = {"i_min": 0, "i_max": most_i}.get(place.side, along)
        j = {"j_min": 0, "j_max": most_j}.get(place.side, along)
    else:
        return None
    return min(max(i, 0), most_i), min(max(j, 0), most_j)


def find_marked(blocks: Sequence, place: Place | None) -> tuple[Any, tuple[int, int]]:
    """The block and the cell (i, j) that a place means.

    Without a cell the smallest one of the block, without a place that of all blocks.
    """
    named = [block for block in blocks if place is not None and block.name == place.block]
    candidates = named or list(blocks)
    areas = [np.abs(compute_corner_areas(block.nodes).sum(axis=0)) for block in candidates]
    number = int(np.argmin([float(area.min() / np.median(area)) for area in areas]))
    i, j = np.unravel_index(areas[number].argmin(), areas[number].shape)
    cell = find_cell(candidates[number].nodes, place) if named else None
    return candidates[number], cell or (int(i), int(j))
