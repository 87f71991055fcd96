"""Films: a field and its grid over all dumps of a run, on one colour scale.

An mp4 if ffmpeg is available, else a GIF; written under a temporary name first, so that the file is
always complete.  Note: a long run does not fit into memory; the dumps are read twice, one at a
time, first for the scale and the window, then for the frames.
"""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import animation
from matplotlib.cm import ScalarMappable
from tqdm import tqdm

from shockgrid.problems.pictures import name_axis
from shockgrid.problems.prefixes import pick_prefix
from shockgrid.regrid.errors import BadInput
from shockgrid.runs.pictures import command, fields
from shockgrid.runs.pictures.fields import View
from shockgrid.runs.store.files import check_folder, disk_errors
from shockgrid.runs.store.provenance import describe_software, hash_deck
from shockgrid.runs.store.reader import Dump, RunData

FILM_SECONDS = 8.0  # length of a film, within the frame rates below
SLOWEST_FRAME_RATE = 3
FASTEST_FRAME_RATE = 25
# inches
FILM_WIDTH_INCHES = 9.0
LOWEST_FILM_INCHES = 2.4
TALLEST_FILM_INCHES = 8.0
SLENDER_WINDOW_RATIO = 0.3  # height over width of a window, below which the colour bar is under it
KINDS = (".mp4", ".gif")


def make_film(
    directory: str | Path,
    field: str | None = None,
    output: str | Path | None = None,
    *,
    follow: bool = False,
    fps: int | None = None,
    dpi: int = 110,
    **look: Any,
) -> Path:
    """Write a film of a run and return its path; [DIR/film-FIELD.mp4, .gif without ffmpeg].

    Other choices are part of the name, too: film-p-mesh.mp4.

    field: of the dumps or derived, by default the density; follow: the window moves with the
    interface, else it is `zoom`, the domain or, if that is long, the interface's surroundings; fps:
    frames per second, one per dump.  look, as for pictures: zoom (x0,x1,y0,y1 [m]), mesh (bool),
    mirror ("x" or "y"), limits (low,high of the colours), colours (a map of matplotlib).  Raises
    BadInput.
    """
    run = RunData(directory)
    view = command.make_view(**look)
    if follow and view.zoom:
        raise BadInput("--follow and --zoom: the window follows the interface or is fixed; use one")
    name = field or command.default_fields(run)[0]
    marks = ["follow"] * follow + ["mesh"] * view.mesh
    marks += [f"mirror-{view.mirror}"] if view.mirror else []
    marks += [view.colours] if view.colours else []
    marks += [re.sub(r"[^\w.+-]+", "_", f"zoom-{look['zoom']}")] if view.zoom else []
    has_ffmpeg = animation.writers.is_available("ffmpeg")
    stem = "-".join(["film", name, *marks])
    path = Path(output) if output else run.path / f"{stem}{KINDS[0] if has_ffmpeg else KINDS[1]}"
    kind = path.suffix.lower()
    if kind not in KINDS:
        raise BadInput(f"{path}: a film's name has to end in .mp4 or .gif")
    if kind == ".mp4" and not has_ffmpeg:
        raise BadInput(
            f"{path}: an mp4 needs the program ffmpeg, which is not installed; choose a .gif"
        )
    check_folder(path)
    paths = [dump.path for dump in run.dumps]
    if len(paths) < 2:
        raise BadInput(f"{run.path} has {len(paths)} dump: a film needs two or more")
    extents = [
        fields.measure_extent(fields.make_sheets(Dump(one), (), view), view.zoom is None)
        for one in paths
    ]
    if follow and not all(span for _, span in extents):
        raise BadInput(f"--follow: no two materials touch in {paths[0]}, there is no interface")
    boxes, _ = fields.choose_boxes(extents, view, follow)
    ranges = [
        fields.find_range(fields.make_sheets(Dump(one), [name], view), name, box)
        for one, box in zip(paths, boxes, strict=True)
    ]
    rate = fps or int(
        np.clip(round(len(paths) / FILM_SECONDS), SLOWEST_FRAME_RATE, FASTEST_FRAME_RATE)
    )
    figure = command.new_figure()
    ratio = (boxes[0][3] - boxes[0][2]) / (boxes[0][1] - boxes[0][0])
    figure.set_size_inches(
        FILM_WIDTH_INCHES,
        float(
            np.clip(0.8 * FILM_WIDTH_INCHES * ratio + 1.0, LOWEST_FILM_INCHES, TALLEST_FILM_INCHES)
        ),
    )
    draw_frame = make_frames(figure, run.dumps, name, view, boxes, ranges)
    command.clean_words(figure)
    part = path.with_name(f".{path.stem}.part{path.suffix}")
    with disk_errors(path):
        try:
            digest = hash_deck(run.dumps[-1].deck_text)
            made = {"comment": f"{describe_software()}; deck SHA-256 {digest}"}
            if kind == ".mp4":
                options = {"codec": "h264", "extra_args": ["-movflags", "+faststart"]}
                writer = animation.FFMpegWriter(fps=rate, metadata=made, **options)
            else:
                writer = CommentedGif(fps=rate, metadata=made)
            with writer.saving(figure, str(part), dpi):
                for number in tqdm(range(len(paths)), "frames", leave=False, disable=None):
                    draw_frame(number)
                    writer.grab_frame()
            os.replace(part, path)
        except subprocess.CalledProcessError as error:
            printed = (error.stderr or error.stdout or b"").decode(errors="replace").strip()
            reason = printed.splitlines()[-1] if printed else f"exit code {error.returncode}"
            raise BadInput(f"{path}: ffmpeg cannot write it ({reason}); try a .gif") from error
        finally:
            part.unlink(missing_ok=True)
    return path


def make_frames(
    figure, dumps: Sequence[Dump], name: str, view: View, boxes, ranges
) -> Callable[[int], None]:
    """Return a function that draws the frame of a dump, by its number from 0, into one axes."""
    paths = [dump.path for dump in dumps]
    titles = fields.time_titles(dumps)
    first = Dump(paths[0])
    axes = figure.subplots()
    box = boxes[0]
    last = Dump(paths[-1])
    look = fields.choose_colours(first, name, ranges, view, fields.find_size([first, last], name))
    scale, unit = pick_prefix(float(np.abs(boxes).max()), first.length_unit)
    labels = [name_axis(axis, unit) for axis in first.axes]
    place = {"shrink": 0.9, "pad": 0.015}
    if box[3] - box[2] < SLENDER_WINDOW_RATIO * (box[1] - box[0]):  # no room for labels at the side
        place = {"location": "bottom", "aspect": 50}
    figure.colorbar(
        ScalarMappable(look.norm, look.map),
        ax=axes,
        label=look.label,
        extend=look.extend,
        **place,
    )

    def draw(number: int) -> None:
        axes.clear()
        sheets = fields.make_sheets(Dump(paths[number]), [name], view)
        fields.draw_blocks(axes, sheets, name, look, scale, boxes[number], view.mesh)
        axes.set_title(titles[number], fontsize=10)
        axes.set(xlabel=labels[0], ylabel=labels[1])

    draw(0)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # the same frame in every picture
    return draw


class CommentedGif(animation.PillowWriter):
    """A GIF whose comment has the provenance."""

    def finish(self) -> None:
        for frame in self._frames[:1]:
            frame.info["comment"] = self.metadata["comment"].encode()
        super().finish()
