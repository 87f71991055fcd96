"""The commands `shockgrid grid list | make | regrid | check | compare`.

Exit codes are those of `runs.cli.main`; `grid check` ends with 1 where a cell is not convex, and
`grid compare` with 0 however many families fail.
"""

from __future__ import annotations

import click

from shockgrid.runs.cli.terminal import Commands, echo


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
def grid() -> None:
    """Make, regrid, check and compare grids, without flow.

    \b
    shockgrid grid list                           named domains, blocks and families
    shockgrid grid make swan --plot               marched from a square to a swan
    shockgrid grid make curves.npz --cells 60x40  between your own boundary curves
    shockgrid grid regrid mine.vts -o better.vts  your own grid, on its own sides
    shockgrid grid check mine.h5                  convexity and quality
    shockgrid grid compare swan --plot swan.png   every family on one domain, or in a file

    \b
    Your own curves: a file .npz or .h5 with four arrays, named
      left, right, bottom, top      (or i_min, i_max, j_min, j_max)
    each of shape (n, 2) or (2, n), any number of points, in either direction; the
    ends have to meet at four corners.  In Python:
      numpy.savez("curves.npz", left=..., right=..., bottom=..., top=...)
    A grid: arrays x and y (and z) of shape (ni+1, nj+1[, nk+1]), or nodes of
    shape (2, ni+1, nj+1), in .npz or .h5, a dump of a run, a structured .vts
    or .vtk of VTK, or Plot3D (.p3d, .xyz, .x, .g, .fmt).
    """


family = click.option(
    "--family", metavar="NAME", help="Kind of grid [barrier]; `grid list` names them all."
)
weight = click.option(
    "--weight",
    metavar="FORMULA",
    help="Cells are small where this is large, such as '1+10*y' or 'own*(1+5*exp(-9*x**2))'.",
)
options = click.option(
    "--option",
    "options",
    multiple=True,
    metavar="KEY=VALUE",
    help="An option of the family, such as epsilon=1e-2; can be repeated.",
)
outputs = click.option(
    "-o",
    "--output",
    "outputs",
    multiple=True,
    metavar="FILE",
    help="Output: .h5 (with an .xdmf beside it), .vts or .npz; can be repeated.",
)
force = click.option("--force", is_flag=True, help="Replace files that exist.")
block = click.option("--block", metavar="NAME", help="Which block of an HDF5 file.")
picture = click.option(
    "--plot", "picture", is_flag=True, help="Draw the grid: a .png beside the file."
)


@grid.command("list")
@click.option("--plot", "picture", metavar="FILE", help="Draw every domain into this picture.")
@force
def list_names(picture, force) -> None:
    """List the named domains, the 3D blocks and the families."""
    from shockgrid.runs.grids.commands import draw_every_domain, list_everything

    echo(list_everything())
    if picture:
        echo(draw_every_domain(picture, force))


@grid.command()
@click.argument("source", metavar="DOMAIN_OR_FILE")
@family
@click.option("--cells", metavar="NIxNJ", help="60x40 [default of a domain], in 3D 20x20x20.")
@weight
@options
@click.option(
    "--at", type=click.FloatRange(0, 1), default=1.0, help="Part of the domain's motion [1]."
)
@click.option(
    "--steps",
    type=click.IntRange(0, 100000),
    default=40,
    help="Steps of a domain's motion [40]; 0: at once, as between curves.",
)
@block
@outputs
@force
@picture
def make(source, outputs, force, picture, **words) -> None:
    """Make a grid: of a named domain, between curves in a file, of a 3D block.

    \b
    shockgrid grid make three-fingers --family barrier -o fingers.h5 -o fingers.vts
    shockgrid grid make curves.npz --cells 80x30 --family winslow --plot
    shockgrid grid make swan --family equidistribution --weight '1+10*y'
    shockgrid grid make ks-block-1 --cells 20x20x20 --weight '1+10*(z+1)' --plot

    A named domain is marched from a simple shape to its last one.  Between curves
    nodes are placed at equal distances along them, or, where --cells is left out and
    opposite curves have as many points, at their points; the first grid is
    transfinite interpolation, untangled if need be, and --family is called on it
    until it no longer changes.  In 3D blocks weight times size is equal on edges,
    on faces and in the volume; --option sides=false leaves edges and faces, iterations=100.
    """
    from shockgrid.runs.grids.commands import make_grid

    echo("\n".join(make_grid(source, (outputs, force, picture), **words)))


@grid.command()
@click.argument("file")
@family
@weight
@options
@block
@outputs
@force
@picture
def regrid(file, outputs, force, picture, **words) -> None:
    """Regenerate the inside of your own grid; its side nodes stay bitwise.

    A grid with non-convex cells is untangled first.  A 3D grid is
    equidistributed inside its faces (--weight, --option iterations=100).
    """
    from shockgrid.runs.grids.commands import regrid_file

    echo("\n".join(regrid_file(file, (outputs, force, picture), **words)))


@grid.command()
@click.argument("file")
@block
@click.option("--plot", "picture", metavar="FILE", help="Draw it into this picture (.png, .pdf).")
@force
def check(file, block, picture, force) -> int:
    """Check a grid: non-convex cells, corner sines, aspect ratios; --plot has a histogram.

    The exit code is 1 if a cell is not convex.
    """
    from shockgrid.runs.grids.commands import check_file

    lines, valid = check_file(file, block, picture, force)
    echo("\n".join(lines))
    return 0 if valid else 1


@grid.command()
@click.argument("source", metavar="DOMAIN_DECK_OR_FILE")
@click.option("--cells", metavar="NIxNJ", help="60x40 [default of a domain].")
@click.option(
    "--steps",
    type=click.IntRange(1, 100000),
    default=40,
    help="Steps of a domain's motion; on the sides in a file: passes at most [40].",
)
@click.option(
    "--family",
    "families",
    multiple=True,
    metavar="NAME[:KEY=VALUE...]",
    help="Compare these only, such as barrier:method=sweeps; can be repeated.",
)
@weight
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="KEY=VALUE",
    help="Change a key of a flow's deck, such as cells=32; can be repeated.",
)
@block
@click.option("--plot", "picture", metavar="FILE", help="Draw the last grids side by side.")
@force
def compare(source, cells, picture, force, **options) -> None:
    """Compare families of grids: a table, and a picture side by side.

    Of a named domain; of a deck of a flow, such as interface-instability-mushroom,
    which is then run with each family; of a file with boundary curves or a grid; or
    of several of these with commas between.  Figures are the worst of all steps
    survived, for a file those of the last grid: gap is the first line's distance
    from a deforming side (in a file: any side) over that of the quasi-1D grid,
    µs/node the median step.
    """
    from shockgrid.runs.grids.commands import Comparison, compare_families, parse_cells

    comparison = Comparison(cells=parse_cells(cells), **options)
    for line in compare_families(source, comparison, picture, force):
        echo(line)
