"""The report of a run: one HTML file with all in it, which opens anywhere without a network.

Nothing is computed here that another command does not say: the screens, pictures, film and tables
are theirs.  What cannot be drawn is left out, with the sentence that says why.
"""

from __future__ import annotations

import base64
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from shockgrid.problems.evolution import get_material
from shockgrid.regrid.errors import BadInput, RunFailure
from shockgrid.regrid.text_files import escape_controls
from shockgrid.runs.grids.quality import judge
from shockgrid.runs.inspection.account import (
    CONSERVATION_ERROR_LIMIT,
    HEAD,
    describe_cautions,
    describe_convexity,
    describe_own,
    describe_run,
    describe_verdict,
    measure_drifts,
)
from shockgrid.runs.inspection.info import (
    describe_problem,
    describe_settings,
    describe_state,
    find_verdict,
    other_name,
)
from shockgrid.runs.pictures.command import (
    Wanted,
    default_fields,
    fill_figure,
    find_deck_text,
    new_figure,
    save,
)
from shockgrid.runs.pictures.fields import get_style, list_fields
from shockgrid.runs.pictures.film import make_film
from shockgrid.runs.store.files import check_folder, write_atomically
from shockgrid.runs.store.reader import Dump, RunData

TEMPLATES = Path(__file__).resolve().with_name("templates")
KINDS = {".png": "image/png", ".gif": "image/gif", ".mp4": "video/mp4", ".toml": "text/plain"}
PICTURES = (  # heading, words of `shockgrid plot`
    ("{field} at four times", {}),
    ("Density gradient at the end", {"fields": ("schlieren",), "at": "end"}),
    ("The grids at the end", {"what": "mesh", "at": "end"}),
    ("The interfaces", {"what": "interface"}),
    ("Which cells limit the step, at the end", {"fields": ("rate",), "at": "end"}),
    ("History", {"what": "history"}),
)


def report(
    directory: str | os.PathLike,
    output: str | Path | None = None,
    *,
    film: bool = True,
    dpi: int = 90,
    say: Callable[[str], None] = lambda text: None,
) -> Path:
    """Write one HTML file about a run, as `shockgrid report` does; its path.

    output: FILE [DIR/report.html]; film: with one, where there are two dumps or more; dpi: of the
    pictures; say: takes remarks.  Raises BadInput where there is no run, the file cannot be
    written, or the extra `report` is not installed.
    """
    run = RunData(directory)
    path = Path(output) if output else run.path / "report.html"
    if path.suffix.lower() not in (".html", ".htm"):
        raise BadInput(f"{path}: a report's name has to end in .html")
    check_folder(path)
    template = load_template("run.html.j2")
    left_out: list[str] = []
    page = template.render(
        title=run.problem_name,
        directory=str(run.path),
        **describe_run_in_words(run, left_out),
        pictures=draw_pictures(run, dpi, left_out),
        film=embed_film(run, left_out) if film else "",
        left_out=left_out,
    )
    for sentence in left_out:
        say(f"left out: {sentence}")
    write_atomically(path, page, durable=False)
    return path


def load_template(name: str) -> Any:
    """A template of TEMPLATES, in which all words are escaped; BadInput without jinja2."""
    try:
        import jinja2
    except ImportError as error:
        raise BadInput(
            "a report needs jinja2, which is not installed: pip install 'shockgrid[report]'"
        ) from error
    loader = jinja2.FileSystemLoader(TEMPLATES)
    environment = jinja2.Environment(
        loader=loader,
        autoescape=True,
        finalize=lambda value: escape_controls(value) if type(value) is str else value,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(name)


def describe_run_in_words(run: RunData, left_out: list[str]) -> dict[str, Any]:
    """What the page says besides pictures: state, verdict, cautions, tables, provenance, deck."""
    history = run.history
    last = run.dumps[-1] if run.dumps else None
    marched = len(history.get("t", ())) > 1
    try:
        cautions = describe_cautions(run.problem, history)
        errors = run.problem.errors(history) if marched else {}
        theory = find_own_words(run)
        script = run.problem.say_repeat()
    except (BadInput, RunFailure, KeyError, ValueError, IndexError) as error:  # of another version
        left_out.append(f"what the problem says ({error})")
        cautions = []
        errors = {}
        theory = ""
        script = ""
    try:
        verdict = find_verdict(run)
    except BadInput as error:
        left_out.append(f"the verdict ({error})")
        verdict = None
    left_out += run.skipped
    drifts = measure_drifts(history) if marched else {}
    states = [(describe_state(last, history), bool(last.finished))] if last else []
    if convexity := describe_convexity(history):
        states.append((convexity, not convexity.startswith("NOT")))
    if drifts:
        worst = max(drifts, key=drifts.__getitem__)
        states.append(
            (
                f"largest conservation error: {drifts[worst]:.1e} ({worst.replace('_', ' ')})",
                drifts[worst] <= CONSERVATION_ERROR_LIMIT,
            )
        )
    names = [block.name for block in last.blocks] if last else []
    deck = read_text(run.directory.deck)
    return {
        "about": describe_problem(run).strip(" ()"),
        "verdict": describe_verdict(verdict) if verdict else "",
        "trusted": bool(verdict and verdict["status"] == "finished" and not verdict["trust"]),
        "states": states or [("there is no dump that can be read", False)],
        "theory": theory,
        "errors": {name: f"{value:.4g}" for name, value in errors.items()},
        "cautions": [line.removeprefix(HEAD) for line in cautions],
        "account": describe_run(history, last.cells if last else 0, names) if history else [],
        "settings": describe_settings(run),
        "blocks": judge_blocks(last) if last else [],
        "drifts": drifts,
        "provenance": last.provenance if last else {},
        "deck": deck,
        "deck_link": embed(deck.encode("utf-8"), ".toml"),
        "log": read_text(run.directory.log),
        "repeat": [  # commands that compute the run again and compare the two
            "shockgrid run deck.toml -o again",
            f"shockgrid compare {run.directory.quoted} again",
        ],
        "script": script,
    }


def find_own_words(run: RunData) -> str:
    """What the problem itself says beside theory: of its summary, or said again."""
    screen = read_text(run.directory.summary)
    if not screen and len(run.history.get("t", ())) > 1:
        return describe_own(run.problem, run.history)
    own = screen.split("\n\n")[1:-1]
    return "\n\n".join(part for part in own if not part.startswith(HEAD))


def judge_blocks(dump: Dump) -> list[dict[str, str]]:
    """Cells and quality of each block's grid in a dump."""
    rows = []
    for block in dump.blocks:
        judgement = judge(block.nodes)
        fields = judgement.fields
        ni, nj = block.cells
        rows.append(
            {
                "block": block.name + other_name(block),
                "cells": f"{ni} x {nj}",
                "not convex": str(len(judgement.bad_cells)),
                "minimum scaled Jacobian": f"{judgement.least_sine:.3f}",
                "worst aspect ratio": f"{np.nanmax(fields['aspect_ratio']):.3g}",
                "smallest cell area": f"{np.nanmin(fields['size']):.3g}",
                "largest cell area": f"{np.nanmax(fields['size']):.3g}",
            }
        )
    return rows


def draw_pictures(run: RunData, dpi: int, left_out: list[str]) -> list[tuple[str, str]]:
    """Headings and data URIs: the fields, the grids, what the problem draws itself."""
    wanted = [(heading, what) for heading, what in PICTURES if applies(run, what)]
    try:
        own = run.problem.figures()
        name = default_fields(run)[0]
        field = get_style(run.dumps[-1], name).words.capitalize()
    except BadInput as error:
        left_out.append(str(error))
        own = {}
        field = "The field"
    wanted[1:1] = [(f"{name}, drawn by the problem", {"what": name}) for name in own]
    drawn = []
    deck_text = find_deck_text(run)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "picture.png")
        for heading, what in wanted:
            try:
                figure = new_figure()
                fill_figure(figure, run, Wanted(**what))
                save(figure, path, dpi, deck_text)
            except (BadInput, KeyError) as error:
                left_out.append(f"{heading.format(field=field)} ({error})")
                continue
            drawn.append((heading.format(field=field), embed(path.read_bytes(), ".png")))
    return drawn


def applies(run: RunData, words: dict[str, Any]) -> bool:
    """Has the run what this picture shows: the fields, an interface between two materials?"""
    if not run.dumps:
        return False
    last = run.dumps[-1]
    if words.get("what") == "history":
        return len(run.history.get("t", ())) > 1
    if words.get("what") == "interface":
        return len({get_material(block) for block in last.blocks}) > 1
    return set(words.get("fields", ())) <= set(list_fields(last))


def embed_film(run: RunData, left_out: list[str]) -> str:
    """A film of the run as a data URI; "" where none can be made."""
    if len(run.dumps) < 2:
        return ""
    with tempfile.TemporaryDirectory() as folder:
        for ending in (".mp4", ".gif"):
            try:
                made = make_film(run.path, None, Path(folder, f"film{ending}"), dpi=80)
                return embed(made.read_bytes(), ending)
            except BadInput as error:  # no ffmpeg, or one that cannot do it
                reason = str(error)
    left_out.append(f"the film ({reason})")
    return ""


def embed(content: bytes, ending: str) -> str:
    """The content as a data URI of the kind that its file's ending says."""
    return f"data:{KINDS[ending]};base64,{base64.b64encode(content).decode('ascii')}"


def read_text(path: Path) -> str:
    """The text of a file; "" where it is not there."""
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
