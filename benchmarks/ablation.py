"""What each mechanism and each number of the barrier regridder earns.

    python -m benchmarks.ablation [--full] [--numbers] [NAME ...] [--json FILE]

Every mechanism of `regrid.barrier.tuning.Tuning` is switched off, with `--numbers` every number
halved and doubled, one at a time, and the same work is done: all plane marches of the suite, the
kept motions of tests/property, and random motions of one seed (500; `--full`: 20 000 and flows of
packaged decks).  A row has what came of it beside the regridder as it is, in "as it is": sines and
gaps are ratios to that one, over all marches in the mean (geometric) and at the worst march.
"""

from __future__ import annotations

import argparse
import csv
import tempfile
import time
from dataclasses import fields, replace
from pathlib import Path
from unittest.mock import patch

import numpy as np

from benchmarks.random_motions import OUTCOMES, judge, make_motions
from benchmarks.regrid_suite.catalogue import NAMES, load_march
from benchmarks.regrid_suite.harness import run_march
from benchmarks.result_tables import Tables
from shockgrid.regrid.barrier.regridder import BarrierRegridder
from shockgrid.regrid.barrier.tuning import DEFAULT, Tuning
from shockgrid.regrid.errors import RegridFailure

KEPT = Path(__file__).resolve().parents[1] / "tests" / "property" / "motions.npz"
SEED = 20
OFF = {
    "strengthening": {"strengthening": 1.0},
    "area term": {"area_weight": 0.0},
    "cost": {"cost_weight": 0.0},
    "bound of four bent sides": {"curved_barrier": 0.0},
    "stiffness of sharp cells": {"stiffness": 1.0},
    "coarse nodes": {"coarse_from": np.inf},
    "prediction": {"predict_iterations": 0},
    "more Newton steps": {"more_steps": 0},
    "straight-line start": {"lost": np.inf},
    "untangling": {"untangle_steps": 0},
    "opening steps": {"last_spreads": ()},
    "polish": {"most_polish": 0},
    "halving": {"most_halvings": 0},
    "maps without folds": {"free_steps": 0},
}
DECKS = (
    ("interface-instability-mushroom", "cells=64"),
    ("triple-point", "cells=20"),
    ("shock-bubble-r22", "cells=20"),
    ("plate-on-wedge", "cells=160"),
    ("conical-target", "cells=32"),
)


class Counted:
    """The regridder as the harness takes it, with the sums of its reports."""

    sees_cost = True

    def __init__(self, tuning: Tuning, **options):
        self.regridder = BarrierRegridder(**vars(tuning), **options)
        self.sub_moves = self.rescues = self.iterations = 0

    def __call__(self, previous, boundary, *sound):
        result = self.regridder.regrid(previous, boundary, *sound)
        self.sub_moves += result.report.sub_moves
        self.rescues += result.report.rescues
        self.iterations += result.report.iterations
        return result.nodes


def measure_marches(tuning: Tuning, marches, **options) -> dict:
    """Sums over all marches; `sine`, `gap`, `lag` are arrays, one number a march."""
    found = []
    sums = np.zeros(3)
    seconds = 0.0
    for march in marches:
        counted = Counted(tuning, **options)
        outcome = run_march(march, counted, lag=True)
        found.append(outcome)
        sums += counted.sub_moves, counted.rescues, counted.iterations
        seconds += 1e-6 * outcome.cost * march.inner_nodes * max(outcome.done, 1)
    return {
        "ended": sum(not one.whole for one in found),
        **dict(zip(("sub_moves", "rescues", "iterations"), map(int, sums), strict=True)),
        "seconds": seconds,
        "sine": np.array([max(one.sine, 1e-9) for one in found]),
        "gap": np.array([one.gap or 1.0 for one in found]),
        "lag": np.array([9.9 if one.lag is None else one.lag for one in found]),
    }


def measure_motions(tuning: Tuning, count: int, **options) -> dict:
    """Outcomes of random motions and of the kept ones."""
    counted = Counted(tuning, **options)
    outcomes = []
    kept = np.load(KEPT)
    begin = time.process_time()
    motions = [(nodes, boundary) for _, nodes, boundary in make_motions(SEED, count)]
    number = range(kept["outcome"].size)
    for nodes, boundary in motions + [(kept[f"nodes_{n}"], kept[f"boundary_{n}"]) for n in number]:
        try:
            answer = counted(nodes, boundary)
        except RegridFailure as failure:
            answer = failure
        outcomes.append(judge(nodes, boundary, answer))
    wanted = [OUTCOMES[1 if kept["outcome"][n] == "crosses" else 0] for n in number]
    return {
        "none": outcomes[:count].count(OUTCOMES[3]),
        "wrong": sum(outcome.startswith("wrong") for outcome in outcomes),
        "kept": sum(a != b for a, b in zip(outcomes[count:], wanted, strict=True)),
        "sub_moves": counted.sub_moves,
        "rescues": counted.rescues,
        "seconds": time.process_time() - begin,
    }


def measure_deck(tuning: Tuning, name: str, *settings: str) -> str:
    """Steps, sub-moves, rescues and least sine of a flow whose blocks are all tuned so."""
    from shockgrid.runs.cli.main import cli

    *given, _ = BarrierRegridder.__init__.__defaults__ or ()
    words = [word for setting in settings for word in ("--set", setting)]
    with (
        tempfile.TemporaryDirectory() as folder,
        patch.object(BarrierRegridder.__init__, "__defaults__", (*given, tuning)),
    ):
        out = Path(folder) / "run"
        try:
            cli(["run", name, "-q", "-o", str(out), *words], standalone_mode=False)
            ended = ""
        except Exception as failure:
            ended = f", {type(failure).__name__}"
        with open(out / "history.csv", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    sums = [
        int(sum(float(row[f"regrid_{column}"] or 0) for row in rows))
        for column in ("sub_moves", "rescues")
    ]
    sine = min(float(row["least_scaled_jacobian"] or 1) for row in rows)
    return f"{rows[-1]['step']} / {sums[0]} / {sums[1]} / {sine:.2g}{ended}"


def make_variants(numbers: bool) -> dict[str, tuple[Tuning, dict]]:
    """Name: the tuning, and options of the regridder."""
    variants: dict[str, tuple[Tuning, dict]] = {"as it is": (DEFAULT, {})}
    if not numbers:
        for name, change in OFF.items():
            variants[f"no {name}"] = replace(DEFAULT, **change), {}
        variants["no curved lines"] = DEFAULT, {"curves": False}
        return variants
    for field in fields(Tuning):
        value = getattr(DEFAULT, field.name)
        for factor in (0.5, 2.0):
            if isinstance(value, tuple):
                changed = tuple(type(one)(max(1 if one >= 1 else 0, factor * one)) for one in value)
            elif isinstance(value, int):
                changed = max(1, round(factor * value))
            else:
                changed = factor * value
            if changed != value:
                name = f"{field.name} = {changed:g}" if np.isscalar(changed) else field.name
                variants[name if np.isscalar(changed) else f"{name} x {factor:g}"] = (
                    replace(DEFAULT, **{field.name: changed}), {},
                )  # fmt: skip
    return variants


def compare(found: dict, base: dict, names: list[str]) -> dict:
    """The columns of ratios: in the mean, and the worst march with its name."""
    sine = found["sine"] / base["sine"]
    gap = found["gap"] / base["gap"]
    lag = found["lag"] - base["lag"]
    return {
        "sine": f"{np.exp(np.log(sine).mean()):.3f}; {sine.min():.2f} {names[sine.argmin()]}",
        "gap": f"{np.exp(np.log(gap).mean()):.3f}; {gap.max():.2f} {names[gap.argmax()]}",
        "lag": f"{lag.max():+.2f} {names[lag.argmax()]}",
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="of variants; all without")
    parser.add_argument("--numbers", action="store_true", help="numbers instead of mechanisms")
    parser.add_argument("--full", action="store_true", help="20 000 motions, and flows")
    tables = Tables(parser)
    options = tables.options
    marches = [march for march in map(load_march, NAMES) if march.dim == 2]
    names = [march.name for march in marches]
    base = None
    measure_marches(DEFAULT, marches[:3])  # compiles
    for name, (tuning, more) in make_variants(options.numbers).items():
        if base is not None and options.names and name not in options.names:
            continue
        found = measure_marches(tuning, marches, **more)
        base = base or found
        motions = measure_motions(tuning, 20_000 if options.full else 500, **more)
        row = {
            "variant": name,
            "ended": found["ended"],
            "sub-moves": found["sub_moves"],
            "untangling events": found["rescues"],
            "iterations": found["iterations"],
            "cost, s": round(found["seconds"], 2),
            **compare(found, base, names),
            "motions: none found": motions["none"],
            "wrong": motions["wrong"] + motions["kept"],
            "cut or untangled": motions["sub_moves"] + motions["rescues"],
            "time, s": round(motions["seconds"], 1),
        }
        for deck in DECKS if options.full else ():
            row[deck[0]] = measure_deck(tuning, *deck)
        tables.add("ablation-numbers" if options.numbers else "ablation", **row)
    tables.write()


if __name__ == "__main__":
    main()
