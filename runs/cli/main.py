"""The command line: `shockgrid list | run | restart | check | schema | info | plot | compare |
grid | verify | bench`.

Heavy packages are imported inside the commands, so that `--help` answers at once.  Exit codes:
0 well, 1 `compare` found a difference or `verify` a missed bar, 2 bad input, 3 the physics
failed or a steady state was not reached, 130 / 143 stopped by a signal, 70 a mistake in shockgrid
itself (`--debug` shows where).
"""

from __future__ import annotations

import os
import sys

import click

from problems.problem_file import describe_mistake
from regrid.errors import BadInput, RunFailure
from runs.cli.command_group import Commands
from runs.cli.grid import grid

BAD_INPUT, FAILED, INTERNAL = 2, 3, 70


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="shockgrid")
@click.option("--debug", is_flag=True, help="Show the traceback of an error (works anywhere).")
def cli(debug: bool) -> None:
    """Shock hydrodynamics on moving blocks whose grids are rebuilt every step.

    \b
    shockgrid run interface-instability      compute, then look at the closing screen
    shockgrid plot out/interface-instability-1
    """


setting = click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="KEY=VALUE",
    help="Change a key of the deck, such as run.t_end=1e-3; can be repeated.",
)
quiet = click.option("-q", "--quiet", is_flag=True, help="No progress, only the closing screen.")
with_plot = click.option("--plot", "picture", is_flag=True, help="Draw pictures at the end.")
threads = click.option("--threads", type=click.IntRange(1), help="Same as --set run.threads=N.")


@cli.command("list")
@click.argument("name", required=False)
def list_problems(name: str | None) -> None:
    """List the problems and their decks.

    With NAME, the page of that one.
    """
    from runs.inspection import listing

    click.echo(listing.describe_problem(name) if name else listing.describe_all())


@cli.command()
@click.argument("deck", metavar="PROBLEM_OR_DECK")
@setting
@click.option("-o", "--output", metavar="DIR", help="Run directory [out/<problem>-<n>].")
@click.option("--force", is_flag=True, help="Replace the run that is in the output directory.")
@click.option("--dry-run", is_flag=True, help="Check the deck, say its size, and stop.")
@threads
@with_plot
@quiet
def run(deck, settings, output, force, dry_run, threads, picture, quiet) -> int:
    """Run a problem, a packaged deck, a deck file (TOML) or a problem's own file (Python)."""
    from runs.deck import reading as deck_reading

    checked = deck_reading.read_deck(deck, _with_threads(settings, threads))
    if dry_run:
        from runs.inspection.listing import describe_plan

        click.echo(describe_plan(checked))
        return 0
    from runs.march.launching import start_runner

    runner = start_runner(checked, output, force, quiet, _say)
    return _finish(runner.start(), runner.directory, picture)


@cli.command()
@click.argument("directory", metavar="DIR")
@click.option("--at", type=click.IntRange(0), help="Go on from the restart point of this step.")
@setting
@threads
@with_plot
@quiet
def restart(directory, at, settings, threads, picture, quiet) -> int:
    """Go on with a run from its last restart point.

    Of the deck, run.*, output.* and regrid.* may be changed.
    """
    from runs.march.launching import continue_runner
    from runs.store.directory import open_directory

    opened = open_directory(directory)
    runner = continue_runner(opened, _with_threads(settings, threads), quiet)
    return _finish(runner.resume(at, _say), opened, picture)


@cli.command()
@click.argument("deck", metavar="PROBLEM_OR_DECK")
@setting
@click.option("--schema", is_flag=True, help="Print the JSON schema instead, for editors.")
def check(deck, settings, schema) -> None:
    """Check a deck and print it with every key resolved.

    Where its results are not to be trusted, standard error says so.
    """
    from runs.deck import reading as deck_reading

    checked = deck_reading.read_deck(deck, settings)
    if schema:
        from runs.deck.schema import schema_text

        click.echo(schema_text(checked.problem), nl=False)
        return
    from runs.inspection.cautions import describe_cautions

    problem = checked.make_problem()
    click.echo(checked.to_toml(), nl=False)
    with checked.numbers_in_reach():
        cautions = describe_cautions(problem)
    for line in cautions:
        _say(line)


@cli.command()
@click.argument("problem")
def schema(problem) -> None:
    """Print the JSON schema of a problem's deck, for editors."""
    from runs.deck.schema import schema_text

    click.echo(schema_text(problem), nl=False)


@cli.command()
@click.argument("path", metavar="DIR_OR_FILE")
def info(path) -> None:
    """Say what a run or a dump holds and how well it kept."""
    from runs.inspection.info import describe

    click.echo(describe(path))


@cli.command()
@click.argument("directory", metavar="DIR")
@click.argument("fields", nargs=-1)
@click.option("--what", default=None, help="fields, mesh, interface, history or a problem's own.")
@click.option("--at", metavar="T1,T2,...", help="Times [s]: the nearest dumps are drawn.")
@click.option("--mesh", is_flag=True, help="Draw the grid over the fields.")
@click.option("--zoom", metavar="X0,X1,Y0,Y1", help="Part of the plane [m] to show.")
@click.option("--mirror", type=click.Choice(["x", "y"]), help="Complete a half domain.")
@click.option("-o", "--output", metavar="FILE", help="Picture to write [DIR/<what>.png].")
@click.option("--dpi", type=click.IntRange(20, 1200), default=140, help="Dots an inch [140].")
def plot(directory, fields, what, at, mesh, zoom, mirror, output, dpi) -> None:
    """Draw fields, grids, interfaces or the history of a run.

    Without options: the density (or the first field) at four times.
    """
    from runs.pictures.command import draw

    for path in draw(directory, fields, what, at, mesh, zoom, mirror, output, dpi, _say):
        click.echo(path)


@cli.command()
@click.argument("a")
@click.argument("b")
@click.option("--rtol", type=click.FloatRange(0), default=0.0, help="Relative tolerance [0].")
@click.option("--atol", type=click.FloatRange(0), default=0.0, help="Absolute tolerance [0].")
def compare(a, b, rtol, atol) -> int:
    """Compare two runs or two dumps.

    The exit code is 1 if they differ. Wall times (columns seconds_*) do not
    count.  A tolerance is relative to the largest size in an array.
    """
    from runs.inspection.compare import compare as find
    from runs.inspection.compare import report

    differences = find(a, b, rtol, atol)
    click.echo(report(differences, a, b))
    return 1 if differences else 0


cli.add_command(grid)


@cli.command()
@click.argument("problems", nargs=-1)
@click.option("--short", is_flag=True, help="One small size of each, a minute in all.")
@click.option("-o", "--output", metavar="FILE", help="Write a table (FILE.md) and FILE.json.")
def verify(problems, short, output) -> int:
    """Run the standard problems (or PROBLEMS) at stated sizes: errors, orders, bars.

    The exit code is 1 if a bar is missed.
    """
    from runs.verify.table import verify as run_all

    return run_all(problems, short, output, click.echo)


@cli.command()
@click.option("--cells", type=click.IntRange(8, 4000), default=400, help="Square of cells [400].")
@click.option("--rounds", type=click.IntRange(1), default=5, help="Timings of each case [5].")
@click.option(
    "--runs",
    type=click.Choice(["none", "default", "long", "large"]),
    default="default",
    help="Whole commands: the default problem's; long: a mushroom, too; large: 25 minutes.",
)
@click.option("--json", "path", metavar="FILE", help="Keep the tables in this file, too.")
@click.option("--peer", metavar="DIR", help="A built CloverLeaf_ref to measure beside.")
def bench(cells, rounds, runs, path, peer) -> None:
    """Measure how fast this machine computes, and where the time goes.

    Other work on the machine counts: leave it alone meanwhile.
    """
    from runs.bench.command import bench as measure

    measure(cells, rounds, runs, path, peer, click.echo)


def _say(text: str) -> None:
    click.echo(text, err=True)


def _with_threads(settings: tuple[str, ...], threads: int | None) -> tuple[str, ...]:
    if threads is None:
        return settings
    if threads > (os.cpu_count() or 1):  # numba allows no more than it is told at its start
        os.environ.setdefault("NUMBA_NUM_THREADS", str(threads))
    return (*settings, f"run.threads={threads}")


def _finish(ending, directory, picture: bool) -> int:
    paths = []
    if picture and ending.exit_code < 128:  # not where a signal stopped it
        from runs.pictures.command import draw_all

        paths = draw_all(str(directory))
    click.echo(ending.screen)
    if paths:
        click.echo("pictures:    " + "  ".join(str(path) for path in paths))
    return ending.exit_code


def main(arguments: list[str] | None = None) -> int:
    """The console command; returns the exit code."""
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in arguments
    arguments = [argument for argument in arguments if argument != "--debug"]
    try:
        return cli.main(arguments, prog_name="shockgrid", standalone_mode=False) or 0
    except click.ClickException as error:
        error.show()
        return BAD_INPUT
    except (click.Abort, KeyboardInterrupt) as error:
        click.echo(f"stopped; {error}" if str(error) else "stopped", err=True)
        return 130
    except BrokenPipeError:  # `shockgrid info ... | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except Exception as error:
        if debug:
            raise
        known = {BadInput: BAD_INPUT, MemoryError: BAD_INPUT, RunFailure: FAILED}
        code = next((code for kind, code in known.items() if isinstance(error, kind)), INTERNAL)
        if code == INTERNAL and (mistake := describe_mistake(error)):
            click.echo(f"shockgrid: {mistake}; --debug shows the way there", err=True)
            return BAD_INPUT
        for sentence in _words(error, code).splitlines():
            click.echo(f"shockgrid: {sentence}", err=True)
        return code


def _words(error: Exception, code: int) -> str:
    if isinstance(error, MemoryError):
        return "not enough memory; fewer cells need less"
    if code != INTERNAL:
        return str(error)
    kind = type(error).__name__
    return f"a mistake in shockgrid itself ({kind}: {error}); --debug shows where"


if __name__ == "__main__":
    sys.exit(main())
