"""Mending the history of a run that goes on: rows that are lost, measured anew on the dumps.

A row that is damaged or cut out is lost as such: its dt, its wall times, what limited it.  Where a
dump of its step can be read, the totals and the problem's own measurements are those of the dumped
state; they fill the row, whose other fields stay empty like those of the start.  The file as it
was found is kept in `superseded`.

Where nothing of the file is left, what was made again is written as a provisional history
(`runs.store.history`): a run that has finished makes no step that would tell the other columns.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hydro.history import compute_chosen_columns, find_columns
from problems.evolution import get_start_row
from regrid.errors import BadInput
from runs.deck.reading import ReadDeck
from runs.store.directory import RunDirectory
from runs.store.dumps import read_state
from runs.store.history import format_row, is_provisional, list_texts, write_rows
from runs.store.history_rows import Rows, read_rows, say_stretches

Row = dict[str, Any]


def mend_history(
    directory: RunDirectory,
    deck: ReadDeck,
    step: int,
    t: float,
    restore: Callable[..., None],
    say: Callable[[str], None],
) -> tuple[list[str] | None, list[Row]]:
    """Cut the history at the restart point of `step` and time `t` [s]; fill in what is lost.

    restore: `runs.march.restart_point.restore`.  Returns the columns, None where those of a step
    are not known, and then the rows before `step`, which the file has, too.  Says, a sentence each,
    what was damaged, what was made again and what stays lost.
    """
    found = read_rows(directory.history)
    if _is_foreign(found, step, t):
        found = Rows(found.path, faults=[f"has a row of step {step} that is not of t = {t:.6g} s"])
    elif not found.faults and found.last < step and (step or found.rows):
        there = f"ends at step {found.last}" if found.rows else "is missing or empty"
        found.faults.append(f"{there}, while the run goes on from step {step}")
    kept = {number: text for number, text in found.rows if number <= step}
    if found.faults:
        say(f"{found.path} {' and '.join(found.faults)}")
        _keep_as_found(directory)
    made = _measure_dumps(directory, deck, step, kept, restore) if found.faults else {}
    if made:
        say(f"measured anew on dumps: {say_stretches(list(made), list(made), 'step')}")
    columns = found.columns
    if columns is None:
        columns = list(dict.fromkeys(name for row in made.values() for name in row))
    kept |= {number: format_row(columns, row) for number, row in made.items()}
    if not kept:
        directory.history.unlink(missing_ok=True)
        return None, []
    write_rows(found.path, columns, sorted(kept.items()))
    if not is_provisional(columns):
        return columns, []
    before = [(number, text) for number, text in sorted(kept.items()) if number < step]
    return None, list_texts(columns, before)


def _is_foreign(found: Rows, step: int, t: float) -> bool:
    """Has the row of the restart point another time than the point itself?"""
    text = dict(found.rows).get(step)
    if text is None or found.columns is None or "t" not in found.columns:
        return False
    try:
        return float(text.split(",")[found.columns.index("t")]) != t
    except (ValueError, IndexError):
        return True


def _keep_as_found(directory: RunDirectory) -> None:
    if directory.history.exists():
        directory.set_aside(directory.history)


def _measure_dumps(
    directory: RunDirectory,
    deck: ReadDeck,
    step: int,
    kept: dict[int, str],
    restore: Callable[..., None],
) -> dict[int, Row]:
    """Rows of those dumps up to `step` whose rows are lost, by step."""
    points = {number: path for number, path in directory.list_points() if number <= step}
    lost = {number: path for number, path in points.items() if number not in kept}
    if not lost:
        return {}
    problem = deck.make_problem()
    with deck.numbers_in_reach():
        evolution = problem.build()  # another one: what is measured must not touch the run
    chosen = find_columns(deck.deck.output.columns)
    made = {}
    for number, path in sorted(lost.items()):
        try:
            restore(evolution, read_state(path), directory, number)
        except BadInput:  # light or damaged: told of where it is read for itself
            continue
        row: Row = {"step": evolution.step, "t": evolution.t} | get_start_row(evolution)
        row |= compute_chosen_columns(evolution, chosen)
        row |= problem.measure(evolution)
        totals = getattr(evolution, "measure_restored", None)  # last: it touches the state
        made[number] = row | (totals() if totals else {})
    return made
