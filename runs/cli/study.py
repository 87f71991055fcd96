"""`shockgrid study`: one deck at many points."""

from __future__ import annotations

import click

from runs.cli.echo import echo


@click.command()
@click.argument("deck", metavar="PROBLEM_DECK_OR_STUDY")
@click.option(
    "--vary",
    multiple=True,
    metavar="KEY=VALUES",
    help="A:B:N, A:B:N:log or V1,V2,...; several are varied in all combinations.",
)
@click.option(
    "--set", "settings", multiple=True, metavar="KEY=VALUE", help="A key of the deck for all runs."
)
@click.option("-o", "--output", metavar="DIR", help="Folder of the study.")
@click.option("--jobs", type=click.IntRange(1), help="Runs at once [one a processor].")
@click.option("--engine", default="processes", help="processes, mpi or dask://ADDRESS [processes].")
@click.option("--of", "shown", multiple=True, metavar="NAME", help="Quantity to draw and print.")
@click.option("--refine", metavar="KEY", help="The key of cells, for orders [cells].")
@click.option("--retry", is_flag=True, help="Go on with runs that failed, too.")
@click.option("--dry-run", is_flag=True, help="List the runs and what is there of each, and stop.")
@click.option("-q", "--quiet", is_flag=True, help="No progress, only the closing screen.")
def study(deck, vary, settings, output, jobs, engine, shown, refine, retry, dry_run, quiet) -> int:
    """Run a deck at many points: table, orders and picture.

    DECK may be a study file, or the folder of a study to go on with.  Each point is a run directory
    in DIR/runs and is computed once, also where the study was killed; a changed deck computes anew
    what has changed.  Runs that fail are listed and end nothing.
    """
    from runs.study.command import study as compute

    words = deck, vary, settings, output, jobs, engine, shown, refine, retry, dry_run, quiet
    return compute(*words, echo, lambda text: echo(text, err=True))
