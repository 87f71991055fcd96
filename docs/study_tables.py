"""Tables and sentences of docs/studies.md, from docs/results/study-*.json.

    study NAME map QUANTITY     a quantity of two varied keys in per cent, with colours
    study NAME counts QUANTITY  how many runs are within 1, 2, 5 per cent, and the worst
    study NAME orders QUANTITY  orders, extrapolated values and uncertainties over the cells
    study NAME command          the command that makes it

Quantities are relative errors but for `orders`.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from accuracy_tables import LEVELS, make_table, say_error

RESULTS = Path(__file__).resolve().parent / "results"
DIGITS = 6
WORST = 6  # runs named in a sentence
KEPT = ("series", "quantity", "cells", "values", "orders", "kind", "order", "extrapolated",
        "uncertainty")  # fmt: skip
Rows = Sequence[dict[str, Any]]


def read_study(directory: Path, columns: Sequence[str]) -> dict[str, Any]:
    """What pages need of a study's folder: varied keys, rows with these columns, orders."""
    table = list(csv.DictReader((directory / "study.csv").read_text("utf-8").splitlines()))
    keys = list(table[0])[: list(table[0]).index("run")]
    rows = [{name: _read(row[name]) for name in (*keys, "state", *columns)} for row in table]
    found: dict[str, Any] = {"keys": keys, "rows": rows}
    orders = directory / "orders.csv"
    if orders.exists():
        lines = csv.DictReader(orders.read_text("utf-8").splitlines())
        found["orders"] = [
            {name: line[name] for name in KEPT} for line in lines if line["quantity"] in columns
        ]
    return found


def _read(text: str) -> float | int | str | None:
    """A number, rounded; None for an empty field; words as they are."""
    if not text:
        return None
    try:
        number = float(text)
    except ValueError:
        return text
    rounded = float(f"{number:.{DIGITS}g}")
    return int(rounded) if rounded == int(rounded) and "." not in text else rounded


def table_map(rows: Rows, keys: Sequence[str], quantity: str) -> list[str]:
    """One row a value of the first key, one column a value of the second."""
    first, second = keys
    heads, sides = (sorted({row[key] for row in rows}) for key in (second, first))
    found = {(row[first], row[second]): row[quantity] for row in rows}
    body = [[f"{side:.4g}", *(_say(found.get((side, head))) for head in heads)] for side in sides]
    return make_table([f"{first} \\ {second}", *(f"{head:.4g}" for head in heads)], body)


def _say(error: float | None) -> str:
    return "-" if error is None else say_error(100.0 * error, 1)


def describe_counts(rows: Rows, keys: Sequence[str], quantity: str) -> list[str]:
    """Within which bars how many runs are; the worst by name."""
    errors = [abs(row[quantity]) for row in rows if row[quantity] is not None]
    counts = ", ".join(
        f"{sum(error <= most for error in errors)} within {100.0 * most:g} %" for most in LEVELS
    )
    middle = sorted(errors)[len(errors) // 2]
    known = [row for row in rows if row[quantity] is not None]
    known.sort(key=lambda row: -abs(row[quantity]))
    worst = "; ".join(
        ", ".join(f"{key} {row[key]:.4g}" for key in keys) + f" ({100.0 * row[quantity]:+.1f} %)"
        for row in known[:WORST]
    )
    failed = sum(str(row["state"]).startswith("failed") for row in rows)
    silent = len(rows) - failed - len(errors)
    lost = f"Of {len(rows)} runs {failed} failed and {silent} gave no value."
    return [
        f"{lost if failed + silent else f'All {len(rows)} runs gave a value.'} Errors: {counts}; "
        f"half are within {100.0 * middle:.1f} %. The largest errors are those at {worst}."
    ]


def table_orders(orders: Rows, quantity: str) -> list[str]:
    """A line a series: values, orders, what the grids say of the finest."""
    heads = ["", "cells", "values", "order", "for h = 0", "uncertainty"]
    body = []
    for line in orders:
        if line["quantity"] == quantity:
            order = line["orders"] or line["order"] or line["kind"]
            order = " ".join(_shorten(word, 2) for word in order.split(" ")) if order else ""
            values = " ".join(write_apart([float(word) for word in line["values"].split()]))
            rest = [_shorten(line[name], 3) for name in ("extrapolated", "uncertainty")]
            body.append([line["series"], line["cells"], values, order, *rest])
    return make_table(heads, body)


def write_apart(values: Sequence[float]) -> list[str]:
    """Numbers with four digits, or as many more, up to ten, as tell them apart."""
    different = len(set(values))
    for digits in range(4, 11):
        texts = [f"{value:.{digits}g}" for value in values]
        if len(set(texts)) == different:
            return texts
    return [f"{value:.4g}" for value in values]


def _shorten(text: str, digits: int) -> str:
    try:
        number = float(text)
    except ValueError:
        return text
    return "" if math.isnan(number) else f"{number:.{digits}g}" if digits > 2 else f"{number:.2f}"


def fill_study(arguments: str) -> list[str]:
    """`NAME PART QUANTITY`, as the module says."""
    name, part, *rest = arguments.split()
    document = json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))
    if part == "map":
        return table_map(document["rows"], document["keys"], *rest)
    if part == "counts":
        return describe_counts(document["rows"], document["keys"], *rest)
    if part == "orders":
        return table_orders(document["orders"], *rest)
    if part == "command":
        return ["```", f"$ {document['command']}", "```"]
    raise SystemExit(f"docs/study_tables.py has no part {part!r}")
