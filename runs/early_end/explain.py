"""What a run that ended early leaves behind: sentence, meaning, what has helped, a picture.

Nothing that goes wrong in here may hide the sentence: each part is made by itself, and one that
cannot be made is reported in its place.
"""

from __future__ import annotations

import contextlib
import re
import shlex
import textwrap
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.patches import Polygon, Rectangle

from problems.pictures import name_axis
from regrid.errors import BadInput, Place, RunFailure
from regrid.measure.quality import compute_corner_areas
from regrid.sides import SIDE_NAMES, get_side
from runs.deck.checking import is_runtime_key
from runs.deck.reading import ReadDeck, resolve_deck
from runs.early_end.causes import ENDS, Cause
from runs.pictures import fields
from runs.pictures.command import default_fields, new_figure, save
from runs.pictures.curves import draw_panel
from runs.quantities import pick_prefix
from runs.store.directory import RunDirectory
from runs.store.dumps import has_state
from runs.store.files import write_atomically
from runs.store.history import read_history
from runs.store.reader import RunData

CELLS_BESIDE_SIDE = 2  # cells: so near to a side is beside it
CALM_STEP_PART = 0.3  # of the usual dt: with less a run is in trouble already
SHOWN_SETTINGS = 3  # settings
CELLS_AROUND_MARK = 5  # cells on each side of the marked one in the picture
MOST_SHOWN = 0.3  # of the longer side of the domain: half a window at most
MARK = "tab:red"


@dataclass
class EarlyEnd:
    """What was left of a run that ended early; None and [] for what could not be made.

    picture: path of early-end.png; point: step of the restart point to go back to; settings: words
    for `--set`, the best first; commands: one for each of them; lines: all of it as words.
    """

    picture: Path | None = None
    point: int | None = None
    settings: list[str] = field(default_factory=list)
    commands: list[str] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)


def explain(failure: RunFailure, directory: RunDirectory, deck: ReadDeck, restart: str) -> EarlyEnd:
    """Write early-end.png and early-end.txt into `directory`, whose last dump shows the end.

    restart: the command that continues the run.  The failure gets what was made as its
    `early_end`, and the words as its notes.  Raises nothing that is an Exception.
    """
    cause = ENDS.get(failure.cause, Cause("", ""))
    place = failure.place
    end = failure.early_end = EarlyEnd()

    def say(head: str, words: str) -> None:
        end.lines += [f"{head}: {words.replace('`', '')}"] if words else []

    def measure() -> None:
        outputs = RunData(directory.path).outputs
        say("what happened there", describe_event(outputs[-1].blocks, place) if outputs else "")

    def choose_point() -> None:
        end.point = find_calm_point(directory)

    def list_commands() -> None:
        told = list_settings(cause, deck)[:SHOWN_SETTINGS]
        end.settings = [setting for setting, _ in told]
        end.commands = [make_command(s, directory, deck, restart, end.point) for s in end.settings]
        end.lines += ["what has helped in such runs:"] * bool(told)
        for command, (_, words) in zip(end.commands, told, strict=True):
            end.lines.append(f"  {command}   ({words})")

    def draw() -> None:
        title = re.split("; last restart point is|; there is no restart point yet", str(failure))[0]
        end.picture = draw_early_end(RunData(directory.path), title, place, end.point)
        end.lines.append(f"picture of the place: {end.picture}")

    say("what it means", cause.means)
    parts: dict[str, Callable[[], None]] = {
        "the outlines could not be measured": measure,
        "no restart point could be chosen": choose_point,
        "settings that have helped could not be looked up": list_commands,
        "no picture of the place could be made": draw,
    }
    for otherwise, part in parts.items():
        try:
            part()
        except Exception as error:  # whatever it is: the sentence comes first
            say(otherwise, str(error).partition("\n")[0] or type(error).__name__)
    say("what else can be done", cause.advice)
    for line in end.lines:
        failure.add_note(line)
    with contextlib.suppress(BadInput, OSError):
        write_atomically(directory.early_words, "\n".join([str(failure), *end.lines]) + "\n")
    return end


def find_calm_point(directory: RunDirectory) -> int | None:
    """Step of the last restart point from before the trouble; None where there is none at all.

    Trouble begins after the last step that was not retried and had CALM of the usual dt.  Where all
    points are later, the first of them.
    """
    points = []
    for step, path in directory.list_points():
        with contextlib.suppress(BadInput):  # damaged
            points += [step] if has_state(path) else []
    history = read_history(directory.history)
    steps = history.get("step", ())
    dt = history.get("dt")
    if not points or dt is None or len(steps) < 2:
        return points[-1] if points else None
    retried = history.get("retries", np.zeros(len(steps))) > 0
    calm = steps[(dt >= CALM_STEP_PART * float(np.nanmedian(dt))) & ~retried]
    last = min(calm[-1] if len(calm) else points[0], steps[-1] - 1)
    return max((step for step in points if step <= last), default=points[0])


def list_settings(cause: Cause, deck: ReadDeck) -> list[tuple[str, str]]:
    """(`key=value`, what it does) of the settings of a cause that this deck can take."""
    found = []
    for setting in cause.settings:
        present: Any = msgspec.to_builtins(deck.deck)
        for name in setting.key.split("."):
            present = present.get(name) if isinstance(present, dict) else None
        words = f"{setting.key}={setting.choose(present)}"
        with contextlib.suppress(BadInput):  # not for this problem, or with this deck
            table = tomllib.loads(deck.to_toml())
            if setting.choose(present) is not None:
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


def find_marked(blocks: Sequence, place: Place | None) -> tuple[Any, tuple[int, int], bool]:
    """The block and the cell (i, j) that a place names, and whether it names a cell: beside the
    first of a side's nodes.  If not, it is the smallest of the block, or of all blocks."""
    named = [block for block in blocks if place is not None and block.name == place.block]
    areas = [measure_areas(block.nodes) for block in named or blocks]
    number = int(np.argmin([area.min() / np.median(area) for area in areas]))
    block = (named or blocks)[number]
    last = np.array(areas[number].shape) - 1
    cell = np.array(np.unravel_index(areas[number].argmin(), areas[number].shape))
    known = bool(named and place is not None and (place.cell or (place.side and place.nodes)))
    if known and place is not None:
        cell = np.array(place.cell or 2 * place.nodes[:1])
        if not place.cell and place.side:
            cell["ij".index(place.side[0])] = last.max() if place.side.endswith("max") else 0
    i, j = np.clip(cell, 0, last).tolist()
    return block, (i, j), known


def measure_areas(nodes: np.ndarray) -> np.ndarray:
    """Areas [m2] of cells (ni, nj)."""
    return 0.5 * np.abs(compute_corner_areas(nodes).sum(axis=0))


def describe_event(blocks: Sequence, place: Place | None) -> str:
    """A sentence on how small the cell where it failed, or the smallest, is, and what is beside.

    blocks: with `name` and `nodes` (2, ni + 1, nj + 1) [m].
    """
    block, (i, j), _ = find_marked(blocks, place)
    areas = measure_areas(block.nodes)
    away = zip(SIDE_NAMES, (i, areas.shape[0] - 1 - i, j, areas.shape[1] - 1 - j), strict=True)
    beside = [side for side, cells in away if cells < CELLS_BESIDE_SIDE]
    where = f", beside {' and '.join(beside)}" if beside else ""
    x, y = block.nodes[:, i : i + 2, j : j + 2].mean(axis=(1, 2))
    share = float(areas[i, j] / np.median(areas))
    return (
        f"cell i={i}, j={j} of block '{block.name}' at ({x:.6g}, {y:.6g}){where} has {share:.2g} "
        "of the usual area of the block's cells"
    )


def draw_early_end(run: RunData, title: str, place: Place | None, point: int | None) -> Path:
    """Write DIR/early-end.png from the last dump of `run`; returns its path.

    The place with its grid, the whole domain, dt over the steps with those retried and the restart
    point of step `point`.  A failure without a cell is marked at the smallest.  Raises BadInput
    where the disk is full.
    """
    figure = new_figure()
    dump = run.outputs[-1]
    figure.set_size_inches(13.0, 6.8)
    figure.suptitle(textwrap.fill(title, 190), fontsize=9, x=0.01, ha="left")
    left, right = figure.subfigures(1, 2, width_ratios=(1.35, 1.0))
    near = left.subplots()
    whole, below = right.subplots(2, 1, height_ratios=(1.25, 1.0))
    block, (i, j), named = find_marked(dump.blocks, place)
    name = default_fields(run)[0]
    sheets = fields.make_sheets(dump, [name], fields.View())
    extent = fields.find_extent([sheets])
    scale, unit = pick_prefix(float(np.abs(extent).max()), dump.length_unit)
    part = block.nodes[
        :,
        max(i - CELLS_AROUND_MARK, 0) : i + CELLS_AROUND_MARK + 2,
        max(j - CELLS_AROUND_MARK, 0) : j + CELLS_AROUND_MARK + 2,
    ]
    corners = block.nodes[:, [i, i + 1, i + 1, i], [j, j, j + 1, j + 1]]
    x, y = corners.mean(axis=1)
    reach = 1.05 * max(np.abs(part[0] - x).max(), np.abs(part[1] - y).max())
    reach = min(reach, MOST_SHOWN * max(extent[1] - extent[0], extent[3] - extent[2]))
    window = x - reach, x + reach, y - reach, y + reach
    words = f"block {block.name!r}, cell i={i}, j={j}{'' if named else ': the smallest'}"
    for axes, box, title in ((near, window, words), (whole, extent, "the whole domain")):
        look = fields.choose_colours(dump, name, [fields.find_range(sheets, name, box)])
        fields.draw_blocks(axes, sheets, name, look, scale, box)
        figure.colorbar(ScalarMappable(*look[:2]), ax=axes, label=look[3], shrink=0.9)
        axes.set_title(title, fontsize=10, color=MARK if axes is near else "k")
        axes.set(**{f"{a}label": name_axis(n, unit) for a, n in zip("xy", dump.axes, strict=True)})
        ring = {"markersize": 16, "markeredgewidth": 1.8, "fillstyle": "none", "zorder": 6}
        axes.plot(x * scale, y * scale, "o", color=MARK, **ring)  # seen however flat the cell is
    near.add_patch(Polygon(corners.T * scale, fill=False, edgecolor=MARK, linewidth=2.0, zorder=5))
    if place is not None and place.side and place.nodes:
        line = get_side(block.nodes, place.side)
        there = [node for node in place.nodes if node < line.shape[1]]
        near.plot(*(line[:, there] * scale), "o", markersize=5, color=MARK, zorder=7)
    box = (window[0] * scale, window[2] * scale), 2 * reach * scale, 2 * reach * scale
    whole.add_patch(Rectangle(*box, fill=False, edgecolor=MARK, zorder=5))
    if len(run.history.get("dt", ())):
        draw_panel(below, run.history["step"], run.history, ["dt"], {"dt": dump.t_unit})
    below.axvline(dump.step, color=MARK, label=f"end, step {dump.step}")
    if point is not None:
        below.axvline(point, color="tab:blue", ls="--", label=f"restart point, step {point}")
    below.set(xlabel="step", yscale="log")
    below.autoscale(axis="y")
    below.legend(fontsize=8, loc="lower left")
    return save(figure, run.directory.early_picture, 120)
