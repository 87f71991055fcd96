"""How far the pressure behind a running contact point is from the shock polars, over the angle.

    python benchmarks/polars_over_angle.py --speeds 2000 3000 --cells 160 48
    python benchmarks/polars_over_angle.py --plate Cu --below .1 .5 1 2 --json polars.json

One line an angle.  A page reads the JSON: a list of the dictionaries of
`problems.plate_on_wedge.polars.measure_polar_point`, and the command that made it.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import msgspec

from problems.plate_on_wedge.deck import PlateOnWedgeDeck
from problems.plate_on_wedge.polars import make_angles, measure_polar_point

BELOW = (-1.0, -0.1, 0.1, 0.25, 0.5, 1.0, 2.0, 3.0, 5.0)


def print_point(point: dict) -> None:
    """One line a run."""
    start = (
        f"{point['plate']:>7} on {point['wedge']:<7} {point['speed']:6.0f} m/s "
        f"{point['angle']:7.3f} of {point['critical angle']:6.2f} degrees, "
        f"{point['refinement']:4.2f} times finer, {point['steps']:5d} steps: "
    )
    if not point["attached"]:
        words = f"jet by theory, {point['lead, mm']} mm ahead of A"
    elif point["p"] is None:
        words = "no plateau seen"
    else:
        kind = "plateau" if point["plateau"] else "fall continued to A"
        words = f"p {point['p off, %']:+.2f} %, scatter {point['scatter, %']:.2f} %, {kind}"
    print(start + words + (f"; {point['failure']}" if point["failure"] else ""), flush=True)


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--plate", default="Al1100")
    parser.add_argument("--wedge", default="SS304")
    parser.add_argument("--speeds", type=float, nargs="+", default=[3000.0], help="V [m/s]")
    parser.add_argument("--cells", type=int, nargs=2, default=[80, 24])
    parser.add_argument(
        "--below", type=float, nargs="+", default=BELOW, help="degrees below the critical angle"
    )
    parser.add_argument("--json", type=Path, help="file to write")
    options = parser.parse_args(arguments)
    points = []
    for speed in options.speeds:
        deck = {
            "plate": options.plate,
            "wedge": options.wedge,
            "cells": options.cells,
            "angle": 5.0,
            "drive": {"kind": "moving", "speed": speed},
        }
        for case in make_angles(msgspec.convert(deck, PlateOnWedgeDeck), options.below):
            points.append(measure_polar_point(case))
            print_point(points[-1])
    if options.json:
        words = ["python benchmarks/polars_over_angle.py", *(arguments or sys.argv[1:])]
        result = {"command": " ".join(words), "points": points}
        options.json.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
