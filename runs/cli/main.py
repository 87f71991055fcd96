"""The command line: `shockgrid list | run | restart | study | check | schema | materials | info |
inspect | plot | film | export | report | compare | grid | verify`.

Heavy packages are imported inside the commands, so that `--help` answers at once.  Exit codes: 0
success, 1 `compare` found a difference or `verify` an error above its bar, 2 bad input, 3 the
physics failed or a steady state was not reached, 130 / 143 stopped by a signal, 70 a bug in
shockgrid (`--debug` shows where).
"""

from __future__ import annotations

import functools
import os
import sys
from functools import partial
from pathlib import Path
from typing import NamedTuple

import click

from shockgrid.regrid.errors import BadInput
from shockgrid.runs.cli.grid import grid
from shockgrid.runs.cli.terminal import (
    EXIT_BAD_INPUT,
    Commands,
    check_pairs,
    describe_error,
    echo,
    echo_sentences,
    echo_usage,
    print_what_can_be_shown,
)
from shockgrid.runs.ranks.started import is_for_ranks


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="shockgrid")
@click.option("--debug", is_flag=True, help="Show the traceback of an error (works anywhere).")
def cli(debug: bool) -> None:
    """Shock hydrodynamics on moving blocks whose grids are improved in every step.

    \b
    shockgrid run interface-instability      compute, then print the summary
    shockgrid plot out/interface-instability-1
    """


_say = partial(echo, err=True)
setting = click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="KEY=VALUE",
    help="Change a key of the deck, such as run.t_end=1e-3; can be repeated.",
)
quiet = click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
zoom = click.option("--zoom", metavar="X0,X1,Y0,Y1", help="Part of the plane [m] to show.")
mesh = click.option("--mesh", is_flag=True, help="Draw the grid over the field.")
mirror = click.option("--mirror", type=click.Choice(["x", "y"]), help="Complete a half domain.")
with_plot = click.option("--plot", "picture", is_flag=True, help="Draw pictures at the end.")
threads = click.option("--threads", type=click.IntRange(1), help="Same as --set run.threads=N.")
max_wall = click.option(
    "--max-wall",
    metavar="TIME",
    help="Stop with a restart point before this time (2h, 90m, 1:30:00).",
)
limits = click.option("--limits", metavar="LOW,HIGH", help="Ends of the colour scale.")
colours = click.option("--colours", metavar="NAME", help="A colour map of matplotlib.")


class March(NamedTuple):
    """Options that `run` and `restart` have in common."""

    settings: tuple[str, ...]
    threads: int | None
    max_wall: str | None
    picture: bool
    quiet: bool


def with_march(command):
    """Give a command the options of `March`; it takes them together, as `march`."""

    @functools.wraps(command)
    def call(*arguments, **options):
        march = March(**{name: options.pop(name) for name in March._fields})
        return command(*arguments, march=march, **options)

    for option in (quiet, with_plot, max_wall, threads, setting):
        call = option(call)
    return call


@cli.command("list")
@click.argument("name", required=False)
def list_problems(name: str | None) -> None:
    """List the problems and their decks.

    With NAME, the page of that one.
    """
    from shockgrid.runs.inspection import listing

    echo(listing.describe_problem(name) if name else listing.describe_all())


@cli.command()
@click.argument("deck", metavar="PROBLEM_OR_DECK")
@click.option("-o", "--output", metavar="DIR", help="Run directory [out/<problem>-<n>].")
@click.option("--force", is_flag=True, help="Replace the run that is in the output directory.")
@click.option("--dry-run", is_flag=True, help="Check the deck, print its size and cost, and stop.")
@click.option("--ranks", type=click.IntRange(1), help="With --dry-run: as on N MPI ranks.")
@with_march
@click.pass_obj  # the ranks of MPI that share the command, or None
def run(world, deck, output, force, dry_run, ranks, march: March) -> int:
    """Run a problem, a packaged deck, a deck file (TOML) or a problem's own file (Python)."""
    from shockgrid.runs.deck import reading as deck_reading
    from shockgrid.runs.march.runner import WallLimit

    limit = WallLimit(march.max_wall) if march.max_wall is not None else None
    checked = deck_reading.read_deck(deck, _with_threads(march.settings, march.threads))
    if dry_run:
        from shockgrid.regrid.compilation.first_calls import interpreted
        from shockgrid.runs.forecast import foretell, measure_size
        from shockgrid.runs.inspection.listing import describe_plan
        from shockgrid.runs.march.launching import check_deck_fully
        from shockgrid.runs.ranks.map import describe_map

        with interpreted():
            problem = checked.make_problem()
        check_deck_fully(checked, problem)
        echo(describe_plan(checked))
        with interpreted():
            lines, cautions = foretell(checked, problem, None, output)
            echo("\n".join([*lines, *cautions]))
            if count := ranks or getattr(world, "size", None):
                size = measure_size(problem)
                echo("\n".join(describe_map(size.blocks, count, checked.deck.run.cut)))
        return 0
    if ranks is not None:
        raise BadInput(f"--ranks needs --dry-run; to run, type mpiexec -n {ranks} shockgrid ...")
    from shockgrid.runs.march.compiling import compiling
    from shockgrid.runs.march.launching import start_runner

    with compiling(march.quiet, helped=world is None):
        runner = start_runner(checked, output, force, march.quiet, _say, world)
        runner.limit = limit
        runner.world = world
        end = runner.start()
    return _finish(end, runner.directory, march.picture, march.quiet)


@cli.command()
@click.argument("directory", metavar="DIR")
@click.option("--at", type=click.IntRange(0), help="Continue from the restart point of this step.")
@click.option("--cells", metavar="N[,M]", help="Continue with these cells, in another DIR.")
@click.option("-o", "--output", metavar="DIR", help="With --cells: where [out/<problem>-<n>].")
@click.option("--force", is_flag=True, help="With --cells: replace the run that is there.")
@with_march
@click.pass_obj
def restart(world, directory, at, cells, output, force, march: March) -> int:
    """Continue a run from its last restart point.

    Keys that do not affect the state may be changed (run.t_end, output.*, ...;
    `shockgrid schema` marks them).  With --cells the state is
    remapped to another grid, and the run continues in a directory of its own.
    """
    from shockgrid.runs.march.launching import continue_runner, remap_runner
    from shockgrid.runs.march.runner import WallLimit
    from shockgrid.runs.store.directory import open_directory

    limit = WallLimit(march.max_wall) if march.max_wall is not None else None
    opened = open_directory(directory)
    settings = _with_threads(march.settings, march.threads)
    if cells is not None:
        runner = remap_runner(opened, cells, settings, at, output, force, march.quiet, _say)
        runner.limit = limit
        runner.world = world
        return _finish(runner.start(), runner.directory, march.picture, march.quiet)
    if output is not None or force:
        raise BadInput("restart: -o and --force need --cells; a run continues in its directory")
    runner = continue_runner(opened, settings, march.quiet, at, _say, world)
    runner.limit = limit
    runner.world = world
    return _finish(runner.resume(at, _say), opened, march.picture, march.quiet)


@cli.command()
@click.argument("deck", metavar="PROBLEM_DECK_OR_STUDY")
@click.option(
    "--vary",
    multiple=True,
    metavar="KEY=VALUES",
    help="A:B:N, A:B:N:log or V1,V2,...; several are varied in all combinations.",
)
@setting
@click.option("-o", "--output", metavar="DIR", help="Folder of the study.")
@click.option("--jobs", type=click.IntRange(1), help="Parallel runs [one per processor].")
@click.option("--engine", default="processes", help="processes or mpi [processes].")
@click.option("--of", "shown", multiple=True, metavar="NAME", help="Quantity to draw and print.")
@click.option("--refine", metavar="KEY", help="Key that sets the resolution, for orders [cells].")
@click.option("--retry", is_flag=True, help="Also continue failed runs.")
@click.option("--dry-run", is_flag=True, help="List the runs and the state of each, and stop.")
@quiet
def study(deck, **options) -> int:
    """Run a deck at many points: table, orders and picture.

    DECK may be a study file, or the folder of a study to continue.  Each point is a run directory
    in DIR/runs and is computed once, also if the study was killed; after a change of the deck only
    what has changed is computed.  Failed runs are listed; the study continues.
    """
    from shockgrid.runs.study.command import Request
    from shockgrid.runs.study.command import study as compute

    return compute(Request(deck, **options), say=echo, note=_say)


@cli.command()
@click.argument("deck", metavar="PROBLEM_OR_DECK")
@setting
@click.option("--all", "everything", is_flag=True, help="Print the keys at their defaults, too.")
def check(deck, settings, everything) -> None:
    """Check a deck and print the keys that it sets, each with its meaning.

    Of a problem by its name all keys are printed, those without a value
    commented out.  Cautions about the results go to standard error.
    """
    from shockgrid.problems.registry import is_problem
    from shockgrid.regrid.compilation.first_calls import interpreted
    from shockgrid.runs.deck import reading as deck_reading
    from shockgrid.runs.deck.checking import describe_deck
    from shockgrid.runs.inspection.account import describe_cautions
    from shockgrid.runs.march.launching import check_deck_fully

    checked = deck_reading.read_deck(deck, settings)
    with interpreted():
        problem = checked.make_problem()
    check_deck_fully(checked, problem)
    bare = is_problem(deck) and not settings
    whole = everything or bare
    echo(describe_deck(checked.problem, checked.deck, problem.t_unit, not whole), nl=False)
    with checked.numbers_in_reach(), interpreted():
        cautions = describe_cautions(problem)
    for line in cautions:
        _say(line)


@cli.command()
@click.argument("problem")
def schema(problem) -> None:
    """Print the JSON schema of a problem's deck, for editors."""
    from shockgrid.runs.deck.checking import schema_text

    echo(schema_text(problem), nl=False)


@cli.command()
@click.argument("name", required=False)
@click.option("-o", "--output", metavar="FILE.h5", help="Table to write of FILE.ses:NUMBER.")
def materials(name, output) -> None:
    """List the materials of the library, or print the parameters of one.

    NAME may be a file in the form of the SESAME library, FILE.ses, whose materials are listed, or
    one of these, FILE.ses:3336, of which -o writes a table for `eos = "tabular"`.
    """
    from shockgrid.runs.inspection import listing, sesame

    source = sesame.split_name(name) if name else None
    if source is None:
        if output is not None:
            raise BadInput("--output: only a material of a SESAME file is written, FILE.ses:NUMBER")
        echo(listing.describe_materials(name))
        return
    path, number = source
    if number is None:
        echo(sesame.describe_file(path))
        return
    if output is None:
        raise BadInput(f"materials: {name}: say where its table is to be written, -o FILE.h5")
    echo(sesame.convert(path, number, Path(output)))


@cli.command()
@click.argument("path", metavar="DIR_OR_FILE")
@click.option("--deck", is_flag=True, help="Print the deck stored in the (last) dump.")
def info(path, deck) -> int:
    """Describe a run or a dump: contents, conservation errors, damage.

    The exit code is 2 if a file of the run is damaged; a line names it.
    """
    from shockgrid.runs.inspection.info import DAMAGED, describe, find_deck

    if deck:
        echo(find_deck(path), nl=False)
        return 0
    description = describe(path)
    echo(description)
    return EXIT_BAD_INPUT if f"\n{DAMAGED}" in description else 0


@cli.command()
@click.argument("file")
def inspect(file) -> None:
    """Print a dump's contents: names, shapes, units, ranges, NaNs, checksums."""
    from shockgrid.runs.inspection.info import inspect as describe

    echo(describe(file))


@cli.command()
@click.argument("directory", metavar="DIR")
@click.argument("fields", nargs=-1)
@click.option(
    "--what",
    default=None,
    help="fields, mesh, interface, history, gauges, line or a problem's own.",
)
@click.option("--at", metavar="T1,T2,...", help="Times [s]: the nearest dumps are drawn.")
@mesh
@zoom
@mirror
@click.option("--beside", metavar="DIR2", help="Another run, drawn to the same scale.")
@click.option("--line", metavar="X0,Y0,X1,Y1", help="Values of the cells that this line [m] meets.")
@limits
@colours
@click.option("--csv", "table", metavar="FILE", help="Write the values along --line, too.")
@click.option("-o", "--output", metavar="FILE", help="Picture to write [DIR/<what>.png].")
@click.option("--dpi", type=click.IntRange(20, 1200), default=140, help="Dots per inch [140].")
def plot(directory, output, dpi, table, **words) -> None:
    """Draw fields, grids, interfaces or the history of a run.

    Without options: the density (or the first field) at four times. Beside
    the fields of the dumps: schlieren, pressure_gradient, vorticity, rate (of
    the cells; the largest limits dt).
    """
    from shockgrid.runs.pictures.command import Wanted, draw

    for path in draw(directory, Wanted(**words), output, dpi, _say, table):
        echo(path)


@cli.command()
@click.argument("directory", metavar="DIR")
@click.option("-o", "--output", metavar="FILE", help="CSV file [DIR/interfaces.csv].")
def export(directory, output) -> None:
    """Write the interfaces of a run as curves.

    At every dump: x, y and the length along each curve.
    """
    from shockgrid.runs.pictures.curves import export_interfaces

    echo(export_interfaces(directory, output))


@cli.command()
@click.argument("directory", metavar="DIR")
@click.argument("field", required=False)
@click.option("--follow", is_flag=True, help="Move the window with the interface.")
@zoom
@mesh
@mirror
@limits
@colours
@click.option("--fps", type=click.IntRange(1, 60), help="Frames per second [a film of 8 s].")
@click.option("--dpi", type=click.IntRange(20, 600), default=110, help="Dots per inch [110].")
@click.option("-o", "--output", metavar="FILE", help="Film [DIR/film-FIELD.mp4 or .gif].")
def film(directory, field, output, **words) -> None:
    """Make a film of a field over the dumps: mp4 with ffmpeg, else GIF."""
    from shockgrid.runs.pictures.film import make_film

    echo(make_film(directory, field, output, **words))


@cli.command()
@click.argument("directory", metavar="DIR")
@click.option("-o", "--output", metavar="FILE", help="Page to write [DIR/report.html].")
@click.option("--film/--no-film", default=True, help="With a film [yes].")
@click.option("--dpi", type=click.IntRange(20, 600), default=90, help="Of pictures [90].")
def report(directory, output, film, dpi) -> None:
    """Write a report of a run as one HTML file: verdict, pictures, film, history.

    The file is complete and needs no network.  Needs the extra: pip install 'shockgrid[report]'.
    """
    from shockgrid.runs.report import report as write_report

    echo(write_report(directory, output, film=film, dpi=dpi, say=_say))


@cli.command()
@click.argument("a")
@click.argument("b")
@click.option("--rtol", type=click.FloatRange(0), default=0.0, help="Relative tolerance [0].")
@click.option("--atol", type=click.FloatRange(0), default=0.0, help="Absolute tolerance [0].")
def compare(a, b, rtol, atol) -> int:
    """Compare two runs or two dumps.

    The exit code is 1 if they differ.  Wall times (columns seconds_*) do not
    count.  A tolerance is relative to the largest size in an array.  If numbers
    of cells or steps differ, dumps are paired by time, and tolerances apply to L1 norms.
    """
    from shockgrid.runs.inspection.compare import compare_in_words

    comparison, differ = compare_in_words(a, b, rtol, atol)
    echo(comparison)
    return 1 if differ else 0


cli.add_command(grid)


@cli.command()
@click.argument("problems", nargs=-1)
@click.option("--short", is_flag=True, help="One small size of each, a minute in all.")
@click.option("-o", "--output", metavar="FILE", help="Write the results as JSON.")
@click.option("--jobs", type=click.IntRange(1), default=1, help="Parallel runs [1].")
def verify(**words) -> int:
    """Run the standard problems (or PROBLEMS) at stated sizes: errors, orders, bars.

    The exit code is 1 if a bar is missed.
    """
    from shockgrid.runs.verify import verify as run_all

    return run_all(**words, say=echo)


def _with_threads(settings: tuple[str, ...], threads: int | None) -> tuple[str, ...]:
    if threads is None:
        return settings
    if threads > (os.cpu_count() or 1):  # numba reads its limit when it is imported
        os.environ.setdefault("NUMBA_NUM_THREADS", str(threads))
    return (*settings, f"run.threads={threads}")


def _finish(ending, directory, picture: bool, quiet: bool) -> int:
    if not quiet:
        echo(ending.screen)
    elif ending.exit_code:
        _say(f"shockgrid: {ending.reason}; {directory} can be continued")
    if picture and ending.exit_code < 128:  # not where a signal stopped it
        try:
            from shockgrid.runs.pictures.command import draw_all

            paths = draw_all(str(directory), None if quiet else _say)
        except Exception as error:  # whatever it is: the run has ended as it has
            _say(f"no pictures: {describe_error(error)[1].removeprefix('shockgrid: ')}")
        else:
            if not quiet:
                echo("pictures:    " + "  ".join(str(path) for path in paths))
    return ending.exit_code


def main(arguments: list[str] | None = None) -> int:
    """The console command; returns the exit code."""
    print_what_can_be_shown()
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    if is_for_ranks(arguments):
        from shockgrid.runs.ranks.world import run_on_ranks

        return run_on_ranks(lambda world: _main(arguments, world), echo_sentences)
    return _main(arguments)


def _main(arguments: list[str], world: object = None) -> int:
    """Run a command; with several ranks only the first of `world` calls this."""
    debug = "--debug" in arguments
    arguments = [argument for argument in arguments if argument != "--debug"]
    try:
        check_pairs(arguments)
        return cli.main(arguments, prog_name="shockgrid", standalone_mode=False, obj=world) or 0
    except click.ClickException as error:
        echo_usage(error)
        return EXIT_BAD_INPUT
    except (click.Abort, KeyboardInterrupt) as error:
        echo(f"stopped; {error}" if str(error) else "stopped", err=True)
        return 130
    except BrokenPipeError:  # `shockgrid info ... | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except Exception as error:
        if debug:
            raise
        code, message = describe_error(error)
        echo_sentences("\n".join([message, *getattr(error, "__notes__", [])]))
        return code


if __name__ == "__main__":
    sys.exit(main())
