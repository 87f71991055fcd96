"""All regridders on all marches: a line each on the screen, and the whole as JSON."""

from __future__ import annotations

import importlib.metadata
import json
import math
import os
import platform
from collections.abc import Callable, Iterable
from pathlib import Path

from regrid_suite.catalogue import load_march
from regrid_suite.harness import LAG_CALLS, MOST_PARTS, Outcome, run_march
from regrid_suite.marches import March
from regrid_suite.regridders import Entry

WARM_UPS = {2: ("five-cells-a-step", "mushroom-roll"), 3: ("wavy-block-3d",)}
WARM_STEPS = 6
DIGITS = 4
PACKAGES = ("numpy", "scipy", "numba", "mfem")


def warm_up(entry: Entry, dims: Iterable[int]) -> None:
    """A few steps of other marches, so that compiling is not measured."""
    for dim in dims:
        for name in WARM_UPS[dim]:
            march = load_march(name)
            few = {side: line[: WARM_STEPS + 1] for side, line in march.sides.items()}
            short = March(
                march.name,
                march.about,
                march.formula,
                march.start,
                few,
                march.parameter[: WARM_STEPS + 1],
                march.deforming,
                march.sound,
            )
            run_march(short, entry.make(short))


def run_all(
    marches: list[March],
    entries: dict[str, Entry],
    lag: bool,
    page: Path | None,
    echo: Callable[[str], None],
    add: bool = False,
) -> list[dict]:
    """Outcomes of every regridder on every march that it takes; written to `page` after each.

    With `add` the rows of other regridders and marches that `page` has stay in it.
    """
    known = json.loads(page.read_text("utf-8")) if add and page and page.exists() else None
    rows: list[dict] = known["rows"] if known else []
    for name, entry in entries.items():
        taken = [march for march in marches if march.dim in entry.dims]
        warm_up(entry, sorted({march.dim for march in taken}))
        for march in taken:
            outcome = run_march(march, entry.make(march), lag)
            echo(describe(name, outcome))
            rows = [r for r in rows if (r["regridder"], r["march"]) != (name, march.name)]
            rows.append({"regridder": name, "dim": march.dim, **tidy(outcome)})
            if page is not None:
                write_page(page, marches, entries, rows, known)
    return rows


def tidy(outcome: Outcome) -> dict:
    """An outcome for a file: few digits, no numbers that JSON does not have."""

    def shorten(value):
        if isinstance(value, float):
            return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None
        return value

    return {name: shorten(value) for name, value in outcome.describe().items()}


def describe(name: str, found: Outcome) -> str:
    """One line of the screen."""
    words = [
        f"{found.march:24} {name:20} {found.done:4}/{found.steps:<4}",
        f"sub-moves {found.sub_moves:3}  us {found.cost:6.2f}",
        f"gap {found.gap:6.2f}" if found.gap is not None else " " * 10,
        f"sine {found.sine:6.3f}  aspect {found.aspect:6.1f}  rate {found.mean_rate:8.1f}",
    ]
    if found.lag is not None:
        words.append(f"lag {found.lag:5.2f}")
    if found.failure:
        words.append(found.failure)
    return "  ".join(words)


def write_page(
    page: Path,
    marches: list[March],
    entries: dict[str, Entry],
    rows: list[dict],
    known: dict | None = None,
) -> None:
    """The results as JSON, whole or not at all; marches and regridders of `known` stay."""
    told = {march["name"]: march for march in (known or {}).get("marches", ())}
    told |= {march.name: describe_march(march) for march in marches}
    kept = (known or {}).get("packages", {})  # of peers that are not installed here
    document = {
        "command": "python tests/regrid_suite run --json docs/results/regrid_suite.json",
        "rule": {"most parts of a step": MOST_PARTS, "calls for the lag": LAG_CALLS},
        "machine": {"processor": platform.machine(), "python": platform.python_version()},
        "packages": {name: find_version(name) or kept.get(name) for name in PACKAGES},
        "marches": list(told.values()),
        "regridders": (known or {}).get("regridders", {})
        | {
            name: {"about": entry.about, "source": entry.source, "version": entry.version}
            for name, entry in entries.items()
        },
        "rows": rows,
    }
    unfinished = page.with_name(f".{page.name}.unfinished")
    unfinished.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    os.replace(unfinished, page)


def describe_march(march: March) -> dict:
    """Name, words, cells and steps of a march."""
    cells = [n - 1 for n in march.start.shape[1:]]
    words = {"name": march.name, "about": march.about, "formula": march.formula}
    return {**words, "cells": cells, "steps": march.steps}


def find_version(name: str) -> str | None:
    """Version of an installed package, or None."""
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None
