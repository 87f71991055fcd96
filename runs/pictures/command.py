"""From the arguments of `shockgrid plot` to picture files.

matplotlib is used through its objects, without pyplot: faster to load, and no display is needed.
"""

from __future__ import annotations

import contextlib
import io
import math
import re
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cbook import is_math_text
from matplotlib.figure import Figure
from matplotlib.mathtext import MathTextParser
from matplotlib.text import Text

from shockgrid.regrid.errors import BadInput, suggest
from shockgrid.regrid.text_files import escape_controls
from shockgrid.runs.pictures import curves
from shockgrid.runs.pictures.fields import View, draw_fields, find_field, time_titles
from shockgrid.runs.pictures.finishing import finish_figure
from shockgrid.runs.quantities import add_unit, is_time
from shockgrid.runs.store.files import check_folder, check_free, disk_errors
from shockgrid.runs.store.provenance import describe_software, hash_deck
from shockgrid.runs.store.reader import Dump, RunData

NAMES = {  # of the fields of metadata: what made it, what of
    "png": ("Software", "Description"), "pdf": ("Creator", "Subject"),
    "svg": ("Creator", "Description"), "eps": ("Creator", None), "ps": ("Creator", None),
}  # fmt: skip


def clean_words(figure: Figure) -> None:
    """Escape control characters in all texts of a figure; only formulas are interpreted."""
    for text in figure.findobj(Text):
        content = text.get_text()
        if (plain := escape_controls(content)) != content:
            text.set_text(plain)
        try:
            for line in plain.splitlines() if "$" in plain and is_math_text(plain) else ():
                MathTextParser("path").parse(line)
        except ValueError:
            text.set_parse_math(False)


OPTIONS = ("at", "mesh", "zoom", "mirror", "line", "limits", "colours")  # that name a picture
HEEDED = {  # of the options that choose what is shown, by picture; a problem's own heeds none
    "fields": ("FIELDS", "--at", "--mesh", "--zoom", "--mirror", "--limits", "--colours"),
    "mesh": ("--at", "--zoom", "--mirror"),
    "interface": ("--at", "--zoom", "--mirror"),
    "history": ("FIELDS",),
    "gauges": ("FIELDS",),
    "line": ("FIELDS", "--at", "--mirror", "--line", "--csv"),
}
BESIDE = ("fields", "line")  # pictures that can show a second run
DEFAULT_TIMES = 4
SLENDER_PICTURE_RATIO = 1000.0  # a picture's longer side over the other
PANEL_PAD_INCHES = 0.1  # inches around each panel: less cuts titles at the edge
FIRST_CHOICE = ("rho", "p")
# of solids, whose density says little
FIRST_CHOICE_OF_SOLIDS = ("von_mises", "p")


Numbers = str | Sequence[float] | None  # of the command line, with commas between, or of Python


class Wanted(NamedTuple):
    """The picture to draw, by the options of `shockgrid plot`.

    fields: names, of derived fields too; what: fields, mesh, interface, history, line or one of the
    problem's; at: times [s]; zoom: x0,x1,y0,y1 [m]; mirror: x or y; beside: another run, drawn to
    the same scale; line: x0,y0,x1,y1 [m]; limits: low,high of the colours; colours: a colour map.
    """

    fields: tuple[str, ...] = ()
    what: str | None = None
    at: Numbers | float = None
    mesh: bool = False
    zoom: Numbers = None
    mirror: str | None = None
    beside: str | Path | None = None
    line: Numbers = None
    limits: Numbers = None
    colours: str | None = None


DEFAULT = Wanted()


def draw(
    directory: str,
    wanted: Wanted = DEFAULT,
    output: str | None = None,
    dpi: int = 140,
    say: Callable[[str], None] | None = None,
    table: str | None = None,
) -> list[Path]:
    """Write one picture of a run; return its path and, with `table`, the path of the CSV file.

    table: a CSV file for the values along a line; say: receives remarks.  Raises BadInput if the
    run lacks the picture, the field or the time.
    """
    run = RunData(directory)
    figure = new_figure()
    stem, write_table = fill_figure(figure, run, wanted, say)
    if table:
        if not write_table:
            raise BadInput(f"--csv {table}: it is for the values along a line; --line says which")
        check_free(Path(table))
    path = Path(output) if output else run.path / f"{stem}.png"
    paths = [save(figure, path, dpi, find_deck_text(run))]
    return paths + [write_table(Path(table))] if table and write_table else paths


def fill_figure(
    figure: Figure, run: RunData, wanted: Wanted, say: Callable[[str], None] | None = None
) -> tuple[str, Callable[[Path], Path] | None]:
    """Draw one picture of a run into `figure`.

    Returns a stem for its file name and, for values along a line, a function that writes their
    table. Raises BadInput if the run lacks the picture, the field or the time.
    """
    at = wanted.at
    beside = wanted.beside
    line = wanted.line
    view = make_view(wanted.zoom, wanted.mirror, wanted.mesh, wanted.limits, wanted.colours)
    names = [name for entry in wanted.fields for name in entry.split(",") if name]
    given = {f"--{name}": getattr(wanted, name) for name in OPTIONS} | {"FIELDS": names or None}
    given = {n: value for n, value in given.items() if value is not None and value is not False}
    what = wanted.what or ("fields" if line is None else "line")
    shown = [what]
    write_table = None
    part = False
    if beside and what not in BESIDE:
        raise BadInput(f"--beside {beside}: for {' and '.join(BESIDE)}, not for {what!r}")
    runs = [run, RunData(beside)] if beside else [run]
    if what in BESIDE:
        names = names or default_fields(run)
        shown += names
    if what == "fields":
        dumps = choose_pairs(runs, at, say) if beside else choose_dumps(run, at, say=say)
        pairs = zip(name_paths(runs) * len(dumps), time_titles(dumps), strict=False)
        titles = [f"{name}: {when}" for name, when in pairs] if beside else ()
        part = draw_fields(figure, dumps, names, view, titles)
    elif what == "line":
        if line is None:
            raise BadInput("--what line: --line X0,Y0,X1,Y1 says which line [m]")
        way = parse_numbers("--line", line, "x0,y0,x1,y1, two points in metres")
        if way[:2] == way[2:]:
            raise BadInput(f"--line {line}: two points in metres are wanted, these are the same")
        dumps = choose_pairs(runs, at, say)
        titles = name_paths(runs)
        lineouts = [
            curves.sample_lineouts(dumps[k :: len(runs)], names, way, view, say)
            for k in range(len(runs))
        ]
        curves.draw_lineouts(figure, lineouts, names, titles)
        write_table = partial(curves.write_csv, lineouts=lineouts, names=names, runs=titles)
    elif what == "mesh":
        part = draw_fields(figure, choose_dumps(run, at, say=say), (), view)
    elif what == "interface":
        curves.draw_interfaces(figure, choose_dumps(run, at, 12, say), view)
    elif what == "history":
        curves.draw_history(figure, run, names)
    elif what == "gauges" and (run.deck.gauge or what not in run.problem.figures()):
        curves.draw_gauges(figure, run, names)
    else:
        own = run.problem.figures()
        if what not in own:
            hint = suggest(what, [*HEEDED, *own])
            raise BadInput(f"there is no picture {what!r} of {run.problem_name}{hint}")
        try:
            own[what](figure, run)
        except KeyError as error:  # a missing column, perhaps because there is no history
            if len(run.history.get("t", ())):
                raise
            raise BadInput(f"{run.path} has no history yet: no step was made") from error
    idle = [name for name in given if name not in HEEDED.get(what, ())]
    if idle and say:
        say(f"{', '.join(idle)} does not apply to the picture {what!r}")
    if part and say:
        say("the panels show only a part of the domain; --zoom shows any other part")
    if what not in BESIDE:
        shown += names
    for name in OPTIONS:
        if (value := given.get(f"--{name}")) is not None:
            shown.append(name if value is True else f"{name}-{value}")
    shown += [f"beside-{Path(beside).name}"] if beside else []
    finish_figure(figure)
    return "-".join(re.sub(r"[^\w.+-]+", "_", word) for word in shown), write_table


def draw_all(directory: str, say: Callable[[str], None] | None = None) -> list[Path]:
    """The pictures of a finished run: its fields and its problem's own pictures."""
    paths = draw(directory, say=say)
    for name in RunData(directory).problem.figures():
        paths += draw(directory, Wanted(what=name), say=say)
    return paths


class Picture(Figure):
    """A figure that notebooks show directly and that needs no display."""

    def _repr_png_(self) -> bytes:
        image = io.BytesIO()
        self.savefig(image, format="png", dpi=100)
        return image.getvalue()


def new_figure() -> Figure:
    """An empty figure that can be saved; no window."""
    figure = Picture(figsize=(10.0, 6.0), layout="constrained")
    FigureCanvasAgg(figure)
    figure.get_layout_engine().set(w_pad=PANEL_PAD_INCHES, h_pad=PANEL_PAD_INCHES)
    return figure


def save(figure: Figure, path: Path, dpi: int, deck_text: str | None = None) -> Path:
    """Write the figure; the file name's suffix sets the format.

    deck_text: the resolved deck as TOML of the run that is shown; its digest goes into the file.
    """
    ending = path.suffix.lstrip(".").lower()
    if ending not in figure.canvas.get_supported_filetypes():
        raise BadInput(f"{path}: a picture's name has to end in .png, .pdf or .svg")
    check_folder(path)
    finish_figure(figure)
    clean_words(figure)
    maker, content = NAMES.get(ending, (None, None))
    metadata = {maker: describe_software()} if maker else {}
    if content and deck_text is not None:
        metadata[content] = f"deck SHA-256 {hash_deck(deck_text)}"
    with disk_errors(path):
        figure.savefig(path, dpi=dpi, format=ending, metadata=metadata or None)
    return path


def find_deck_text(run: RunData) -> str | None:
    """The resolved deck of a run from its last dump; None if there is no dump."""
    return run.dumps[-1].deck_text if run.dumps else None


def default_fields(run: RunData) -> list[str]:
    """The density if all dumps have it, else the first field that all have; where all blocks are
    solids, the von Mises stress and the pressure."""
    dumps = choose_dumps(run, None)
    names = [dump.field_names() for dump in dumps]
    known = [name for name in names[-1] if all(name in others for others in names)] or names[-1]
    if not known:
        raise BadInput(f"{run.path} has no fields to draw; try --what mesh")
    blocks = [block for dump in dumps for block in dump.blocks]
    if all(find_field(block, name) for block in blocks for name in FIRST_CHOICE_OF_SOLIDS):
        return list(FIRST_CHOICE_OF_SOLIDS)
    return [next((name for name in FIRST_CHOICE if name in known), known[0])]


def choose_dumps(
    run: RunData,
    at: Numbers | float,
    count: int = DEFAULT_TIMES,
    say: Callable[[str], None] | None = None,
) -> list[Dump]:
    """The dumps nearest to the times in `at`, or `count` of them from first to last.

    A run that counts iterations instead of time is shown by its last state.

    `say` receives a message for times outside the run.
    """
    if not run.dumps:
        skipped = f": {run.skipped[0]}" if run.skipped else ""
        raise BadInput(f"{run.path} has no dump that can be read{skipped}")
    if at is None and not is_time(run.dumps[-1].t_unit):
        return run.dumps[-1:]  # earlier ones are iterates, not states
    if at is None:
        numbers = np.unique(np.linspace(0, len(run.dumps) - 1, min(count, len(run.dumps))).round())
        return [run.dumps[int(k)] for k in numbers]
    named_times = {"start": run.dumps[0].t, "end": run.dumps[-1].t}
    at = at if isinstance(at, str) else ",".join(map(str, np.atleast_1d(at)))
    times = [
        named_times[w] if w in named_times else parse_number("--at", at, w) for w in at.split(",")
    ]
    chosen = list(dict.fromkeys(run.dump_at(t) for t in times))
    first = named_times["start"]
    last = named_times["end"]
    slack = 1e-3 * (last - first)
    if say and any(not first - slack <= t <= last + slack for t in times):
        drawn = ", ".join(f"{dump.t:.6g}" for dump in chosen[:-1])
        unit = chosen[-1].t_unit
        drawn += ", " * bool(drawn) + add_unit(chosen[-1].t, unit)
        before = "t = " if is_time(unit) else ""
        say(
            f"--at {at}: the dumps are of "
            f"{before}{first:.6g} to {add_unit(last, unit)}; drawn: {before}{drawn}"
        )
    return chosen


def choose_pairs(
    runs: list[RunData], at: Numbers | float, say: Callable[[str], None] | None = None
) -> list[Dump]:
    """Dumps of the first run, each followed by the dumps of the other runs nearest to it in time.

    at: None for halfway and the end.
    """
    first = choose_dumps(runs[0], at, 3, say)
    if at is None and len(first) > 2:
        first = first[1:]
    return [dump for one in first for dump in (one, *(run.dump_at(one.t) for run in runs[1:]))]


def name_paths(runs: list[RunData]) -> list[str]:
    """Short names of runs: those of their folders, or full paths if these are equal."""
    same = len({run.path.name for run in runs}) < len(runs)
    return [str(run.path) if same else run.path.name for run in runs]


def make_view(
    zoom: Numbers = None,
    mirror: str | None = None,
    mesh: bool = False,
    limits: Numbers = None,
    colours: str | None = None,
) -> View:
    """The view of a picture or film; BadInput for invalid values."""
    if limits is not None:
        limits = parse_numbers("--limits", limits, "low,high with low < high", 1)
    if colours is not None and colours not in colormaps:
        hint = suggest(colours, colormaps)
        raise BadInput(f"--colours {colours}: there is no such colour map{hint}")
    return View(parse_zoom(zoom), mirror, mesh, limits, colours)


def parse_zoom(zoom: Numbers) -> tuple[float, ...] | None:
    """x0,x1,y0,y1 in metres."""
    if zoom is None:
        return None
    x0, x1, y0, y1 = parse_numbers("--zoom", zoom, "x0,x1,y0,y1 with x0 < x1, y0 < y1", rising=2)
    if not 1.0 / SLENDER_PICTURE_RATIO <= (x1 - x0) / (y1 - y0) <= SLENDER_PICTURE_RATIO:
        raise BadInput(
            f"--zoom {zoom}: one side is more than {SLENDER_PICTURE_RATIO:g} times the other"
        )
    return x0, x1, y0, y1


def parse_numbers(
    option: str, given: str | Sequence[float], form: str, rising: int = 0
) -> tuple[float, ...]:
    """Parse as many finite numbers as `form` lists; the first `rising` pairs must increase."""
    wanted = form.partition(" ")[0].strip(",").count(",") + 1
    text = given if isinstance(given, str) else ",".join(map(str, given))
    numbers = tuple(parse_number(option, text, word) for word in text.split(","))
    pairs = zip(numbers[0 : 2 * rising : 2], numbers[1 : 2 * rising : 2], strict=False)
    if len(numbers) != wanted or not all(low < high for low, high in pairs):
        raise BadInput(f"{option} {text}: {wanted} numbers are wanted, {form}")
    return numbers


def parse_number(option: str, text: str, word: str) -> float:
    """Parse `word`, one of the numbers in the `text` of an option; BadInput if it is not finite."""
    with contextlib.suppress(ValueError):
        if math.isfinite(number := float(word)):
            return number
    raise BadInput(f"{option} {text}: {word!r} is not a number")
