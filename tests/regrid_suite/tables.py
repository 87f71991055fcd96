"""Tables of docs/regrid-suite.md, as Markdown in docs/results, from the JSON of a run.

regrid-suite-regridders   what was run, of which version, how far it came
regrid-suite-common       the marches to whose end several came: medians and worst values
regrid-suite-space        every march in space: smallest sine and cost
regrid-suite-cost         what the mushroom's roll costs a flow, with the term of the time step
"""

from __future__ import annotations

import json
from pathlib import Path
from statistics import median

from benchmarks.result_tables import make_table, write_result

COMMON = ("barrier", "brackbill-saltzman", "tmop-size")


def write_tables(page: Path) -> None:
    """Write the tables of the results in the file `page`."""
    document = json.loads(page.read_text(encoding="utf-8"))
    rows = {(row["regridder"], row["march"]): row for row in document["rows"]}
    for name, tabulate in (
        ("regridders", _list_regridders),
        ("common", _compare_common),
        ("space", _list_space),
        ("cost", _tell_cost),
    ):
        write_result(f"regrid-suite-{name}", tabulate(document, rows))


def _is_whole(row: dict | None) -> bool:
    return row is not None and row["done"] == row["steps"]


def _list_regridders(document: dict, rows: dict) -> list[str]:
    heads = ["regridder", "what", "source", "plane marches", "to the end", "sub-moves", "cost [µs]"]
    heads += ["lag, median", "worst"]
    table = []
    for name, entry in document["regridders"].items():
        own = [row for (who, _), row in rows.items() if who == name and row["dim"] == 2]
        if not own:
            continue
        whole = [row for row in own if _is_whole(row)]
        cost = f"{median(row['cost'] for row in whole):.2g}" if whole else "-"
        lags = [row["lag"] for row in whole if row["lag"] is not None]
        told = [f"{median(lags):.2f}", f"{max(lags):.2f}"] if lags else ["-", "-"]
        table.append(
            [f"`{name}`", entry["about"], f"{entry['source']} {entry['version']}", str(len(own))]
            + [str(len(whole)), str(sum(row["sub_moves"] for row in whole)), cost, *told]
        )
    packages = document["packages"].items()
    told = ", ".join(f"{name} {version}" for name, version in packages if version)
    return [f"`{document['command']}`; {told}.", "", *make_table(heads, table)]


def _compare_common(document: dict, rows: dict) -> list[str]:
    names = [march["name"] for march in document["marches"] if len(march["cells"]) == 2]
    common = [n for n in names if all(_is_whole(rows.get((who, n))) for who in COMMON)]
    heads = ["regridder", "gap", "worst", "sine", "worst", "sine, 1 %", "aspect", "smoothness"]
    heads += ["node speed", "rate over least", "cost [µs]"]
    least = {name: min(rows[(who, name)]["mean_rate"] for who in COMMON) for name in common}
    table = []
    for who in COMMON:
        own = [rows[(who, name)] for name in common]
        values = [f"{median(r['gap'] for r in own):.2f}", f"{max(r['gap'] for r in own):.1f}"]
        values += [f"{median(r['sine'] for r in own):.3f}", f"{min(r['sine'] for r in own):.3f}"]
        values += [f"{median(r['sine_1'] for r in own):.3f}"]
        values += [f"{median(r['aspect'] for r in own):.1f}"]
        values += [f"{median(r['smoothness'] for r in own):.2f}"]
        values += [f"{median(r['node_speed'] for r in own):.2f}"]
        values += [f"{median(r['mean_rate'] / least[r['march']] for r in own):.2f}"]
        values += [f"{median(r['cost'] for r in own):.2g}"]
        table.append([f"`{who}`", *values])
    words = f"Medians and worst over the {len(common)} plane marches that all of these completed:"
    return [words, "", *make_table(heads, table)]


def _tell(row: dict | None) -> str:
    if row is None:
        return "-"
    if not _is_whole(row):
        return f"ends at {row['done'] + 1} of {row['steps']}"
    cut = f", {row['sub_moves']} sub-moves" if row["sub_moves"] else ""
    gap = f"{row['gap']:.2f} / " if row["gap"] is not None else ""
    return f"{gap}{row['sine']:.3f}{cut}"


def _round(cost: float) -> str:
    return f"{cost:.0f}" if cost >= 10.0 else f"{cost:.2g}"


def _list_space(document: dict, rows: dict) -> list[str]:
    names = [march["name"] for march in document["marches"] if len(march["cells"]) == 3]
    able = [who for who in document["regridders"] if any((who, name) in rows for name in names)]
    table = []
    for name in names:
        found = [rows.get((who, name)) for who in able]
        told = [
            _tell(row) + (f" ({_round(row['cost'])} µs)" if _is_whole(row) else "") for row in found
        ]
        table.append([f"`{name}`", *told])
    return make_table(["march", *(f"`{who}`" for who in able)], table)


def _tell_cost(document: dict, rows: dict) -> list[str]:
    heads = [
        "march",
        "regridder",
        "largest rate",
        "mean of the largest",
        "gap",
        "minimum scaled Jacobian",
    ]
    table = []
    for name in ("mushroom-roll", "mushroom-roll-heavy"):
        for who in ("barrier-no-cost", "barrier"):
            row = rows[(who, name)]
            numbers = [f"{row['rate']:.0f}", f"{row['mean_rate']:.0f}"]
            numbers += [f"{row['gap']:.2f}", f"{row['sine']:.3f}"]
            table.append([f"`{name}`", f"`{who}`", *numbers])
    return make_table(heads, table)
