"""The report of a study: its table and pictures, with a link to the report of each run.

A study is a folder with `study.csv`, a row a run, and the run directories in `runs/`.  A run's
report is made again where the run has gone on since.  The links are relative: the folder can be
moved as a whole.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Callable
from pathlib import Path

from regrid.errors import BadInput
from runs.report.page import check_path, embed, load_template, make_report, read_text
from runs.store.files import disk_errors, write_atomically

TABLE, RUNS, PAGE = "study.csv", "runs", "report.html"


def report(
    directory: str | Path,
    output: str | Path | None = None,
    *,
    film: bool | None = None,
    dpi: int = 90,
    say: Callable[[str], None] | None = None,
) -> Path:
    """Write the report of a run or of a study and return its path [DIR/report.html].

    film: with films; if not said, of a run yes, of the runs of a study no.  `say` takes remarks.
    Raises BadInput where the directory is neither, or the file cannot be written.
    """
    if is_study(Path(directory)):
        return make_study_report(directory, output, film=bool(film), dpi=dpi, say=say)
    return make_report(directory, output, film=film is not False, dpi=dpi, say=say)


def is_study(directory: Path) -> bool:
    """Does the folder hold the table of a study?"""
    return (directory / TABLE).is_file()


def make_study_report(
    directory: str | Path,
    output: str | Path | None = None,
    *,
    film: bool = False,
    dpi: int = 90,
    say: Callable[[str], None] | None = None,
) -> Path:
    """Write the reports of a study's runs where they are missing or old, and the page over them.

    Raises BadInput where the table cannot be read; a run that cannot be reported is named on the
    page.
    """
    home = Path(directory)
    path = Path(output) if output else home / PAGE
    check_path(path)
    heads, rows = read_table(home / TABLE)
    folders = sorted(one.parent for one in (home / RUNS).glob("*/deck.toml"))
    links, failed = {}, []
    for folder in folders:
        page = folder / PAGE
        try:
            if is_old(page, folder):
                make_report(folder, page, film=film, dpi=dpi)
            links[folder.name] = Path(os.path.relpath(page, path.parent)).as_posix()
        except BadInput as error:
            failed.append(f"{folder.name}: {error}")
    named = [next((cell for cell in row if Path(cell).name in links), "") for row in rows]
    lonely = [name for name in links if name not in {Path(cell).name for cell in named}]
    cells = [[(show_number(cell), links.get(Path(cell).name, "")) for cell in row] for row in rows]
    pictures = [(one.stem, embed(one.read_bytes(), ".png")) for one in sorted(home.glob("*.png"))]
    page_text = load_template("study.html.j2").render(
        title=f"study {home.resolve().name}",
        directory=str(home),
        heads=heads,
        rows=cells,
        pictures=pictures,
        lonely=[(name, links[name]) for name in lonely],
        failed=failed,
        log=read_text(home / "study.toml"),
    )
    for sentence in failed if say else ():
        say(f"no report of {sentence}")
    write_atomically(path, page_text, durable=False)
    return path


def read_table(path: Path) -> tuple[list[str], list[list[str]]]:
    """Heads and rows of a table in CSV; lines that begin with # are remarks."""
    with disk_errors(path), open(path, encoding="utf-8", newline="") as file:
        lines = [row for row in csv.reader(file) if row and not row[0].startswith("#")]
    if not lines:
        raise BadInput(f"{path} is empty: the study has no table yet")
    return lines[0], lines[1:]


def show_number(cell: str) -> str:
    """A number of the table to six digits; words and whole numbers as they are."""
    try:
        return cell if cell.lstrip("+-").isdigit() else f"{float(cell):.6g}"
    except ValueError:
        return cell


def is_old(page: Path, folder: Path) -> bool:
    """Is there no page of a run, or has its log been written to since?"""
    log = folder / "run.log"
    if not page.exists():
        return True
    return log.exists() and log.stat().st_mtime > page.stat().st_mtime
