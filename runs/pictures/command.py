"""From the words of `shockgrid plot` to picture files.

matplotlib is used through its objects, without pyplot: faster to load and no display is asked for.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from regrid.errors import BadInput, suggest
from runs.pictures.fields import View, draw_fields, draw_meshes
from runs.pictures.history import draw_history
from runs.pictures.interfaces import draw_interfaces
from runs.store.files import disk_errors
from runs.store.reader import Dump, RunData

OWN = ("fields", "mesh", "interface", "history")
HEEDED = {  # of the options that choose what is shown, by picture; a problem's own heeds none
    "fields": ("FIELDS", "--at", "--mesh", "--zoom", "--mirror"),
    "mesh": ("--at", "--zoom", "--mirror"),
    "interface": ("--at", "--zoom", "--mirror"),
    "history": ("FIELDS",),
}
TIMES = 4
SLENDER = 1000.0  # a picture's longer side over the other
PAD = 0.1  # inches around each panel: less cuts titles at the edge
FIRST_CHOICE = ("rho", "p")


def draw(
    directory: str,
    fields: tuple[str, ...] = (),
    what: str | None = None,
    at: str | None = None,
    mesh: bool = False,
    zoom: str | None = None,
    mirror: str | None = None,
    output: str | None = None,
    dpi: int = 140,
    say: Callable[[str], None] | None = None,
) -> list[Path]:
    """Draw one picture of a run and return its path in a list; `say` takes remarks on it."""
    run, figure = RunData(directory), new_figure()
    stem = fill_figure(figure, run, fields, what, at, mesh, zoom, mirror, say)
    for sentence in run.skipped if say else ():
        say(f"skipped: {sentence}")
    return [save(figure, Path(output) if output else run.path / f"{stem}.png", dpi)]


def fill_figure(
    figure: Figure,
    run: RunData,
    fields: tuple[str, ...] = (),
    what: str | None = None,
    at: str | None = None,
    mesh: bool = False,
    zoom: str | None = None,
    mirror: str | None = None,
    say: Callable[[str], None] | None = None,
) -> str:
    """Draw one picture of a run into `figure`; returns the stem of a name for it."""
    view = View(parse_zoom(zoom), mirror, mesh)
    names = [name for entry in fields for name in entry.split(",") if name]
    what = what or "fields"
    stem = what
    if what == "fields":
        names = names or default_fields(run)
        draw_fields(figure, choose_dumps(run, at, say=say), names, view)
        stem = "-".join(["fields", *names])
    elif what == "mesh":
        draw_meshes(figure, choose_dumps(run, at, say=say), view)
    elif what == "interface":
        draw_interfaces(figure, choose_dumps(run, at, 12, say), view)
    elif what == "history":
        check_history(run)
        draw_history(figure, run, names)
    else:
        own = run.problem.figures()
        if what not in own:
            hint = suggest(what, [*OWN, *own])
            raise BadInput(f"there is no picture {what!r} of {run.problem_name}{hint}")
        try:
            own[what](figure, run)
        except KeyError:  # perhaps of a column, where there is no history
            check_history(run)
            raise
    given = {"FIELDS": names, "--at": at, "--mesh": mesh, "--zoom": zoom, "--mirror": mirror}
    idle = [option for option in given if given[option] and option not in HEEDED.get(what, ())]
    if idle and say:
        say(f"{', '.join(idle)}: not heeded by the picture {what!r}")
    return stem


def check_history(run: RunData) -> None:
    """Raise BadInput where a run has no history to draw, and say why."""
    if len(run.history.get("t", ())):
        return
    points = run.directory.list_points()
    if points and points[-1][0] > 0:
        state = "empty" if run.directory.history.exists() else "missing"
        raise BadInput(f"{run.directory.history} is {state}, so there is no history to draw")
    raise BadInput(f"{run.path} has no history yet: no step was made")


def draw_all(directory: str, dpi: int = 140) -> list[Path]:
    """The pictures that a finished run gets: its fields and what its problem draws."""
    paths = draw(directory, dpi=dpi)
    for name in RunData(directory).problem.figures():
        paths += draw(directory, what=name, dpi=dpi)
    return paths


def new_figure(kind: type[Figure] = Figure) -> Figure:
    """An empty figure that can be saved; no window."""
    figure = kind(figsize=(10.0, 6.0), layout="constrained")
    FigureCanvasAgg(figure)
    figure.get_layout_engine().set(w_pad=PAD, h_pad=PAD)
    return figure


def save(figure: Figure, path: Path, dpi: int) -> Path:
    """Write the figure; the name's ending says the format."""
    known = figure.canvas.get_supported_filetypes()
    if path.suffix.lstrip(".").lower() not in known:
        raise BadInput(f"{path}: a picture's name has to end in .png, .pdf or .svg")
    if not path.parent.is_dir():
        raise BadInput(f"{path.parent} is no folder to write {path.name} into")
    with disk_errors(path):
        figure.savefig(path, dpi=dpi)
    return path


def default_fields(run: RunData) -> list[str]:
    """The density where there is one, else the first field."""
    dumps = choose_dumps(run, None)
    known = dumps[-1].field_names()
    if not known:
        raise BadInput(f"{run.path} has no fields to draw; try --what mesh")
    return [next((name for name in FIRST_CHOICE if name in known), known[0])]


def choose_dumps(
    run: RunData,
    at: str | None,
    count: int = TIMES,
    say: Callable[[str], None] | None = None,
) -> list[Dump]:
    """The dumps nearest to the times in `at`, or `count` of them from first to last.

    Without times of its own (iterations) a run is shown by its last state.

    `say` is told of times that lie outside the run.
    """
    if not run.dumps:
        words = f": {run.skipped[0]}" if run.skipped else ""
        raise BadInput(f"{run.path} has no dump that can be read{words}")
    if at is None and run.dumps[-1].t_unit != "s":
        return run.dumps[-1:]  # what is before are no states, but the way to one
    if at is None:
        numbers = np.unique(np.linspace(0, len(run.dumps) - 1, min(count, len(run.dumps))).round())
        return [run.dumps[int(k)] for k in numbers]
    words = {"start": run.dumps[0].t, "end": run.dumps[-1].t}
    times = [words[w] if w in words else _number(w, f"--at {at}") for w in at.split(",")]
    chosen = list(dict.fromkeys(run.dump_at(t) for t in times))
    first, last = words["start"], words["end"]
    slack = 1e-3 * (last - first)
    if say and any(not first - slack <= t <= last + slack for t in times):
        drawn, unit = ", ".join(f"{dump.t:.6g}" for dump in chosen), chosen[-1].t_unit
        before = "t = " if unit == "s" else ""
        words = f"{before}{first:.6g} to {last:.6g} {unit}; drawn: {before}{drawn} {unit}"
        say(f"--at {at}: the dumps are of {words}")
    return chosen


def parse_zoom(zoom: str | None) -> tuple[float, float, float, float] | None:
    """x0,x1,y0,y1 in metres."""
    if zoom is None:
        return None
    numbers = [_number(word, f"--zoom {zoom}") for word in zoom.split(",")]
    if len(numbers) != 4 or not (numbers[0] < numbers[1] and numbers[2] < numbers[3]):
        raise BadInput(f"--zoom {zoom}: four numbers are wanted, x0,x1,y0,y1 with x0 < x1, y0 < y1")
    x0, x1, y0, y1 = numbers
    if not 1.0 / SLENDER <= (x1 - x0) / (y1 - y0) <= SLENDER:
        raise BadInput(f"--zoom {zoom}: one side is more than {SLENDER:g} times the other")
    return x0, x1, y0, y1


def _number(word: str, whole: str) -> float:
    try:
        number = float(word)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise BadInput(f"{whole}: {word!r} is not a number")
    return number
