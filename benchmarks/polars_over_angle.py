"""How far the pressure behind a running contact point is from the shock polars, over the angle.

    python benchmarks/polars_over_angle.py --speeds 2000 3000 --cells 160 48
    python benchmarks/polars_over_angle.py --pairs Cu-SS304 Pb-SS304 --below .1 .5 1 2

One row an angle, so many degrees below the critical one (negative: past it).  For pictures take
`benchmarks.wedge_polars.measure_polar_point`, which returns all numbers of a run.
"""

from __future__ import annotations

import argparse

import msgspec
from result_tables import Tables
from wedge_polars import make_angles, measure_polar_point

from shockgrid.problems.plate_on_wedge.problem import PlateOnWedgeDeck

BELOW = (-1.0, -0.1, 0.1, 0.25, 0.5, 1.0, 2.0, 3.0, 5.0)
TABLE = "polars over the angle"


def describe_point(point: dict) -> dict[str, str | int]:
    """A row of the table."""
    row = {
        "plate on wedge": f"{point['plate']} on {point['wedge']}",
        "V, km/s": f"{1e-3 * point['speed']:g}",
        "cells": " x ".join(map(str, point["cells"])),
        "angle, degrees": f"{point['angle']:.2f}",
        "below critical": f"{point['critical angle'] - point['angle']:.2f}",
        "finer at A": f"{point['refinement']:.2g}",
        "steps": point["steps"],
    }
    row |= {"error in p, %": "", "scatter, %": "", "behind A": "jet by theory"}
    if point["attached"] and point["p"] is None:
        row["behind A"] = "too few cells"
    elif point["attached"]:
        row["error in p, %"] = f"{point['error in p, %']:+.2f}"
        row["scatter, %"] = f"{point['scatter, %']:.2f}"
        row["behind A"] = "plateau" if point["plateau"] else "fall"
    if point["failure"]:
        row["behind A"] = "died"
    return row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pairs", nargs="+", default=["Al1100-SS304"], help="plate-wedge")
    parser.add_argument("--speeds", type=float, nargs="+", default=[3000.0], help="V [m/s]")
    parser.add_argument("--cells", type=int, nargs=2, default=[80, 24])
    parser.add_argument(
        "--below", type=float, nargs="+", default=BELOW, help="degrees below the critical angle"
    )
    tables = Tables(parser)
    options = tables.options
    for pair in options.pairs:
        plate, _, wedge = pair.partition("-")
        for speed in options.speeds:
            deck = {"plate": plate, "wedge": wedge, "cells": options.cells, "angle": 5.0}
            deck |= {"drive": {"kind": "moving", "speed": speed}}
            for case in make_angles(msgspec.convert(deck, PlateOnWedgeDeck), options.below):
                tables.add(TABLE, **describe_point(measure_polar_point(case)))
    tables.write()


if __name__ == "__main__":
    main()
