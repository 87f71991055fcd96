"""`python tests/soak`: trials of all kinds for so many minutes, kept, told as a table.

A later call with the same file and seed goes on where the last one stopped.  The exit code is 1
where a defect was found.  It needs a system that forks (Linux, macOS).
"""

from __future__ import annotations

import os

os.environ["NUMBA_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"  # see child.py

import shutil
import sys
import tempfile
import time
from pathlib import Path

import click

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # the folder of this package
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # the folder of benchmarks

from soak.catalogue import make_kinds
from soak.child import import_commands
from soak.record import Record, describe, list_outcomes


@click.command(help=__doc__)
@click.option("--minutes", type=click.FloatRange(0), default=20.0, show_default=True)
@click.option("--seed", type=int, default=1, show_default=True)
@click.option("--only", metavar="KIND,...", help="These kinds alone.")
@click.option("--most", type=click.IntRange(1), help="No more trials of a kind in this call.")
@click.option(
    "--resume",
    "kept",
    type=click.Path(path_type=Path, dir_okay=False),
    default=Path("out/soak.jsonl"),
    show_default=True,
    help="File of the outcomes; one that is there is gone on with.",
)
@click.option("--write", is_flag=True, help="Write the table of docs/soak.md.")
@click.option("--reproduce", metavar="KIND:NUMBER", help="Make one trial again; keep its files.")
def soak(minutes, seed, only, most, kept, write, reproduce) -> None:
    folder = Path(tempfile.mkdtemp(prefix="soak-")).resolve()
    import_commands()
    kinds = {kind.name: kind for kind in make_kinds(seed, folder)}
    wanted = only.split(",") if only else list(kinds)
    if reproduce:
        wanted = [reproduce.partition(":")[0]]
    for name in wanted:
        if name not in kinds:
            raise click.BadParameter(f"there is no kind {name!r}; there are: {', '.join(kinds)}")
    if reproduce:
        number = reproduce.partition(":")[2]
        if not number.isdigit():
            raise click.BadParameter("--reproduce: the form is KIND:NUMBER, such as kills:17")
        kind = kinds[wanted[0]]
        kind.prepare()
        (folder / "trial").mkdir()
        outcome = kind.attempt(int(number), folder / "trial")
        click.echo(f"{'DEFECT ' * outcome.defect}{outcome.label}: {outcome.words}\n{folder}/trial")
        sys.exit(outcome.defect)
    try:
        record = march([kinds[name] for name in wanted], folder, kept, seed, minutes, most)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    summary = record.summarise(kinds.values())
    click.echo(describe(summary))
    if write:
        from benchmarks.result_tables import write_result

        write_result("soak", list_outcomes(summary))
    sys.exit(any(kind["defects"] for kind in summary["kinds"]))


def march(kinds, folder: Path, kept: Path, seed: int, minutes: float, most: int | None) -> Record:
    """Make trials until the time is over; next is the kind that had least of its share of it."""
    kept.parent.mkdir(parents=True, exist_ok=True)
    record = Record(kept, seed)
    end = time.monotonic() + 60.0 * minutes
    spent = {kind.name: record.find_seconds(kind.name) for kind in kinds}
    made = {kind.name: 0 for kind in kinds}
    prepared = set()
    while time.monotonic() < end:
        open_ones = [
            kind
            for kind in kinds
            if record.find_next(kind.name) < kind.wanted and made[kind.name] != most
        ]
        if not open_ones:
            break
        kind = min(open_ones, key=lambda kind: spent[kind.name] / kind.weight)
        began = time.monotonic()
        if kind.name not in prepared:
            click.echo(f"soak: {kind.name} ...", err=True)
            kind.prepare()
            prepared.add(kind.name)
            began = time.monotonic()
        trial = folder / "trial"
        number = record.find_next(kind.name)
        trial.mkdir()
        outcome = kind.attempt(number, trial)
        shutil.rmtree(trial, ignore_errors=True)
        seconds = time.monotonic() - began
        spent[kind.name] += seconds
        made[kind.name] += 1
        record.add(kind.name, number, outcome, seconds)
        if outcome.defect:
            click.echo(f"{kind.name}:{number}  {outcome.label}: {outcome.words}", err=True)
    return record


if __name__ == "__main__":
    soak()
