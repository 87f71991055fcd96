"""`python tests/regrid_suite`: write the marches, run regridders on them, draw the grids.

    list                        names of marches and regridders, and the peers that are not there
    make -o DIR [NAME...]       the marches as files, one each, with README.md beside them
    run [NAME...] [--json FILE] a table of all regridders on all marches, or on those named
    draw NAME... -o FILE.png    last grids side by side

NAME is a march of `list` or a file of one.  A peer that is not installed is left out with a word.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import click

from regrid_suite.catalogue import NAMES, load_march, tell
from regrid_suite.files import ENDINGS, read_march, write_march
from regrid_suite.marches import March
from regrid_suite.regridders import REGRIDDERS, Entry, choose
from shockgrid.regrid.errors import BadInput


class Group(click.Group):
    """Commands that tell what is wrong with their input in one sentence, with exit code 2."""

    def invoke(self, ctx):
        try:
            return super().invoke(ctx)
        except BadInput as error:
            raise click.UsageError(str(error)) from None


def load(name: str) -> March:
    """A march by its name or file."""
    return read_march(Path(name)) if name.endswith(ENDINGS) else load_march(name)


def choose_present(names: str | None) -> dict[str, Entry]:
    """The entries that are wanted and installed; a word for each that is not."""
    entries = choose(names.split(",") if names else [])
    for name, entry in entries.items():
        if entry.version is None:
            click.echo(f"{name} is left out: the package {entry.package} is not installed")
    return {name: entry for name, entry in entries.items() if entry.version is not None}


wanted = click.option("--with", "names", metavar="NAME,...", help="These regridders alone.")


@click.group(cls=Group, help=__doc__, context_settings={"help_option_names": ["-h", "--help"]})
def suite() -> None:
    pass


@suite.command("list")
def list_names() -> None:
    """Names of all marches and regridders."""
    for name in NAMES:
        click.echo(f"{name:24} {tell(name)}")
    click.echo()
    for name, entry in REGRIDDERS.items():
        there = entry.version or f"not installed: pip install {entry.package}"
        click.echo(f"{name:24} {entry.source} {there}; {entry.about}")


@suite.command()
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option("-o", "folder", required=True, type=click.Path(path_type=Path, file_okay=False))
@click.option("--kind", type=click.Choice([e[1:] for e in ENDINGS]), default="npz")
@click.option("--force", is_flag=True, help="Replace files that exist.")
def make(names, folder, kind, force) -> None:
    """Write marches as files into a folder, with the words on their format."""
    marches = [load_march(name) for name in names or NAMES]
    paths = {march.name: folder / f"{march.name}.{kind}" for march in marches}
    there = [str(path) for path in paths.values() if path.exists()]
    if there and not force:
        raise BadInput(f"{there[0]} exists; --force replaces it")
    folder.mkdir(parents=True, exist_ok=True)
    for march in marches:
        click.echo(write_march(march, paths[march.name]))
    if force or not (folder / "README.md").exists():
        shutil.copy(Path(__file__).with_name("README.md"), folder / "README.md")


@suite.command()
@click.argument("marches", nargs=-1, metavar="[NAME]...")
@wanted
@click.option("--json", "page", type=click.Path(path_type=Path, dir_okay=False))
@click.option("--lag/--no-lag", default=True, help="Look for the converged grid at the end.")
@click.option("--add", is_flag=True, help="Keep what the file has of other regridders, marches.")
def run(marches, names, page, lag, add) -> None:
    """Run the regridders on marches: a line each; with --json also the tables of docs/results."""
    from regrid_suite.results import run_all

    loaded = [load(name) for name in marches or NAMES]
    run_all(loaded, choose_present(names), lag, page, click.echo, add)
    if page is not None:
        from regrid_suite.tables import write_tables

        write_tables(page)


@suite.command()
@click.argument("marches", nargs=-1, required=True, metavar="NAME...")
@wanted
@click.option("-o", "path", required=True, type=click.Path(path_type=Path, dir_okay=False))
def draw(marches, names, path) -> None:
    """Last grids side by side: a row for each march, a column for each regridder."""
    from regrid_suite.pictures import draw_marches

    click.echo(draw_marches([load(name) for name in marches], choose_present(names), path))
