"""Films: a field and its grid over all dumps of a run, on one colour scale.

An mp4 where ffmpeg is there, else a GIF; written under another name first, so that what is there
is whole.  Note: a long run does not fit into memory; the dumps are read twice, one at a time,
first for the scale and the window, then for the frames.
"""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib import animation
from matplotlib.cm import ScalarMappable
from tqdm import tqdm

from regrid.errors import BadInput
from runs.inspection.account import pick_prefix
from runs.pictures.command import (
    check_folder,
    clean_words,
    default_fields,
    new_figure,
    parse_zoom,
)
from runs.pictures.fields import (
    View,
    check_fields,
    choose_boxes,
    choose_colours,
    draw_panel,
    find_range,
    make_sheets,
    measure_extent,
    time_titles,
)
from runs.store.files import disk_errors
from runs.store.provenance import describe_software, hash_deck
from runs.store.reader import Dump, RunData

SECONDS = 8.0  # that a film takes, within the rates of frames below
SLOWEST, FASTEST = 3, 25
WIDTH, LOWEST, TALLEST = 9.0, 2.4, 8.0  # inches
SLENDER = 0.3  # height over width of a window below which the colours stand under it
KINDS = (".mp4", ".gif")


def make_film(
    directory: str | Path,
    field: str | None = None,
    output: str | Path | None = None,
    *,
    follow: bool = False,
    zoom: str | None = None,
    mesh: bool = False,
    mirror: str | None = None,
    fps: int | None = None,
    dpi: int = 110,
) -> Path:
    """Write a film of a run and return its path; [DIR/film-FIELD.mp4, .gif without ffmpeg].

    What is chosen besides stands in the name, too: film-p-mesh.mp4.

    field: of the dumps or derived, the density if not said; follow: the window goes with the
    interface, else it is `zoom` (x0,x1,y0,y1 [m]) or the domain, in a long one again what is about
    the interface.  fps: frames per second, one each dump.  Raises BadInput.
    """
    run = RunData(directory)
    view = View(parse_zoom(zoom), mirror, mesh)
    if follow and view.zoom:
        raise BadInput("--follow and --zoom: the window follows the interface or is fixed; use one")
    name = field or default_fields(run)[0]
    marks = ["follow"] * follow + ["mesh"] * mesh + [f"mirror-{mirror}"] * bool(mirror)
    marks += [re.sub(r"[^\w.+-]+", "_", f"zoom-{zoom}")] * bool(zoom)
    path = choose_path(run, output, "-".join(["film", name, *marks]))
    paths = [dump.path for dump in run.dumps]
    if len(paths) < 2:
        raise BadInput(f"{run.path} has {len(paths)} dump: a film needs two or more")
    extents = [measure_extent(make_sheets(Dump(one), (), view), view.zoom is None) for one in paths]
    if follow and not all(span for _, span in extents):
        raise BadInput(f"--follow: no two materials touch in {paths[0]}, there is no interface")
    boxes, _ = choose_boxes(extents, view, follow)
    check_fields([Dump(paths[0])], [name])
    ranges = [
        find_range(make_sheets(Dump(one), [name], view), name, box)
        for one, box in zip(paths, boxes, strict=True)
    ]
    rate = fps or int(np.clip(round(len(paths) / SECONDS), SLOWEST, FASTEST))
    figure = new_figure()
    ratio = (boxes[0][3] - boxes[0][2]) / (boxes[0][1] - boxes[0][0])
    figure.set_size_inches(WIDTH, float(np.clip(0.8 * WIDTH * ratio + 1.0, LOWEST, TALLEST)))
    frames = Frames(figure, run.dumps, name, view, boxes, ranges)
    clean_words(figure)
    part = path.with_name(f".{path.stem}.part{path.suffix}")
    with disk_errors(path):
        try:
            writer = make_writer(path, rate, run.dumps[-1].deck_text)
            with writer.saving(figure, str(part), dpi):
                for number in tqdm(range(len(paths)), "frames", leave=False, disable=None):
                    frames.draw(number)
                    writer.grab_frame()
            os.replace(part, path)
        except subprocess.CalledProcessError as error:
            words = (error.stderr or error.stdout or b"").decode(errors="replace").strip()
            reason = words.splitlines()[-1] if words else f"exit code {error.returncode}"
            raise BadInput(f"{path}: ffmpeg cannot write it ({reason}); try a .gif") from error
        finally:
            part.unlink(missing_ok=True)
    return path


class Frames:
    """The frames of a film, drawn one after another into the same axes of a figure."""

    def __init__(self, figure, dumps: Sequence[Dump], name: str, view: View, boxes, ranges):
        self.paths, self.name, self.view, self.boxes = [d.path for d in dumps], name, view, boxes
        self.titles = time_titles(dumps)
        first = Dump(self.paths[0])
        self.look = choose_colours(first, name, ranges)
        self.scale, unit = pick_prefix(float(np.abs(boxes).max()), "m")
        self.labels = [f"{axis} [{unit}]" for axis in first.axes]
        self.figure, self.axes = figure, figure.subplots()
        bar = ScalarMappable(*self.look[:2])
        box = boxes[0]
        place = {"shrink": 0.9, "pad": 0.015}
        if box[3] - box[2] < SLENDER * (box[1] - box[0]):  # no room for words at the side
            place = {"location": "bottom", "aspect": 50}
        figure.colorbar(bar, ax=self.axes, label=self.look[3], **place)
        self.draw(0)
        figure.draw_without_rendering()
        figure.set_layout_engine("none")  # the same frame in every picture

    def draw(self, number: int) -> None:
        """Draw the frame of a dump, by its number from 0."""
        axes = self.axes
        axes.clear()
        sheets = make_sheets(Dump(self.paths[number]), [self.name], self.view)
        draw_panel(
            axes, sheets, self.name, self.look, self.scale, self.boxes[number], self.view.mesh
        )
        axes.set_title(self.titles[number], fontsize=10)
        axes.set(xlabel=self.labels[0], ylabel=self.labels[1])


def choose_path(run: RunData, output: str | Path | None, stem: str) -> Path:
    """Where the film goes; BadInput where that cannot be, before anything is drawn."""
    has_ffmpeg = animation.writers.is_available("ffmpeg")
    ending = KINDS[0] if has_ffmpeg else KINDS[1]
    path = Path(output) if output else run.path / f"{stem}{ending}"
    if path.suffix.lower() not in KINDS:
        raise BadInput(f"{path}: a film's name has to end in .mp4 or .gif")
    if path.suffix.lower() == ".mp4" and not has_ffmpeg:
        raise BadInput(f"{path}: an mp4 needs the program ffmpeg, which is not here; take a .gif")
    check_folder(path)
    return path


def make_writer(path: Path, fps: int, deck_text: str) -> animation.AbstractMovieWriter:
    """What makes a film of this name's kind; `deck_text`: of the run, for the film's comment."""
    made = f"{describe_software()}; deck SHA-256 {hash_deck(deck_text)}"
    if path.suffix.lower() == ".gif":
        return CommentedGif(fps=fps, metadata={"comment": made})
    extra = ["-movflags", "+faststart"]
    return animation.FFMpegWriter(
        fps=fps, codec="h264", extra_args=extra, metadata={"comment": made}
    )


class CommentedGif(animation.PillowWriter):
    """A GIF whose comment says what made it."""

    def finish(self) -> None:
        for frame in self._frames[:1]:
            frame.info["comment"] = self.metadata["comment"].encode()
        super().finish()
