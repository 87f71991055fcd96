"""Fills the generated regions of the pages from docs/results, and makes these results.

    python docs/generate.py                  fill the regions of README.md and all pages
    python docs/generate.py --check          exit code 1 where a region is out of date
    python docs/generate.py --run [NAME...]  first run all of docs/figures.toml, or what is named

A region stands between `<!-- generated: KIND ARGUMENTS -->` and `<!-- end generated -->`; `KINDS`
has the kinds, whose functions say what the arguments are.  Names of runs may have wildcards.
Note: a result is as old as its last run; after a change of the scheme run all again.
"""

from __future__ import annotations

import argparse
import fnmatch
import json
import math
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
RESULTS = DOCS / "results"
sys.path.insert(0, str(ROOT))

from benchmarks.result_tables import make_table  # noqa: E402
from shockgrid.problems.registry import read_docstring  # noqa: E402
from shockgrid.runs.early_end.causes import ENDS  # noqa: E402
from shockgrid.runs.inspection.account import RULES, measure_drifts  # noqa: E402
from shockgrid.runs.store.reader import RunData  # noqa: E402
from shockgrid.runs.verify import HEADS, format_record  # noqa: E402

REGION = re.compile(
    r"(<!-- generated: (?P<kind>\w+) (?P<arguments>.*?) -->\n)(.*?)(<!-- end generated -->)",
    re.DOTALL,
)
SHOCKGRID = [sys.executable, "-m", "shockgrid"]
FIGURES = tomllib.loads((DOCS / "figures.toml").read_text(encoding="utf-8"))


def read_result(name: str) -> dict[str, Any]:
    """One file of docs/results."""
    return json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))


def choose(patterns: Iterable[str]) -> list[str]:
    """Names of figures.toml that the patterns mean, in the order of the patterns."""
    chosen: list[str] = []
    for pattern in patterns:
        found = fnmatch.filter(FIGURES, pattern)
        if not found:
            raise SystemExit(f"docs/figures.toml has no run {pattern!r}")
        chosen += [name for name in found if name not in chosen]
    return chosen


def join_command(figure: dict[str, Any]) -> str:
    """What a person types for a figure."""
    if "study" in figure:
        return f"shockgrid study {figure['study']} -o DIR"
    if "command" in figure:
        return f"shockgrid {figure['command']}"
    words = [f"--set {shlex.quote(setting)}" for setting in figure.get("settings", ())]
    return " ".join(["shockgrid run", figure["deck"], *words])


def make_result(name: str, figure: dict[str, Any]) -> dict[str, Any]:
    """Run a figure in a process of its own; exit codes 0 and 3 (it ended by a sentence) count."""
    command = join_command(figure)
    print(f"{name}: {command}", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        words = shlex.split(command)[1:]
        directory = Path(folder, "run")
        if "study" in figure:
            words[words.index("DIR")] = str(directory)
        if "deck" in figure:
            words += ["-o", str(directory), "--quiet"]
        done = subprocess.run([*SHOCKGRID, *words], cwd=ROOT, capture_output=True, text=True)
        if done.returncode not in (0, 3):
            raise SystemExit(f"{name}: exit code {done.returncode}\n{done.stderr}")
        result = {"command": command, "label": figure.get("label", name)}
        if "study" in figure:
            shutil.copy(directory / "study.png", DOCS / "pictures" / f"{name}.png")
            return result
        if "deck" not in figure:
            return {**result, "output": [line.rstrip() for line in done.stdout.splitlines()]}
        result |= read_run(directory, done.stderr)
        if figure.get("early_end"):
            shutil.copy(directory / "early-end.png", DOCS / "pictures" / f"{name}.png")
            words = (directory / "early-end.txt").read_text(encoding="utf-8")
            result["output"] = words.replace(str(directory), "DIR").splitlines()
        return result


def read_run(directory: Path, said: str) -> dict[str, Any]:
    """The closing summary of a run directory as numbers and words; `said` tells why it failed."""
    data = RunData(directory)
    history = data.history
    screen = directory / "summary.txt"
    if screen.exists():
        first, *rest = screen.read_text(encoding="utf-8").split("\n\n")
        reason = first.split(":")[0]
        own = "\n\n".join(rest[:-1]).splitlines()
    else:
        reason = said.strip().splitlines()[0].partition("; last restart point")[0]
        own = [reason, *data.problem.summary(history, None).strip("\n").splitlines()]

    def reduce(column: str, how) -> float | None:
        known = [v for v in history.get(column, ()) if math.isfinite(v)]
        return how(known) if known else None

    return {
        "reason": reason,
        "steps": data.dumps[-1].step,
        "sub-moves": reduce("regrid_sub_moves", sum),
        "untangling events": reduce("regrid_rescues", sum),
        "minimum scaled Jacobian": reduce("least_scaled_jacobian", min),
        "worst aspect": reduce("worst_aspect", max),
        "drifts": {name: float(f"{drift:.2g}") for name, drift in measure_drifts(history).items()},
        "values": list(read_values(own)),
        "output": own,
    }


def read_values(lines: list[str]) -> Iterable[dict[str, str]]:
    """Lines below a head `computed  theory  difference` of a problem's summary."""
    below = False
    for line in lines:
        name, *rest = re.split(r"\s{2,}(?=[-+]?\.?\d)", line.strip())
        if "computed" in line and not re.search(r"\d", line):
            below = True
        elif below and rest:
            numbers = [re.split(r"\s{2,}", word)[0] for word in rest]
            keys = ("theory",) if len(numbers) == 1 else ("computed", "theory", "difference")
            yield {"name": " ".join(name.split()), **dict(zip(keys, numbers, strict=False))}


def find_cell(result: dict[str, Any], column: str) -> str:
    """What a run has for a column.

    A key of the result; "largest drift"; "computed|theory|difference NAME", the first value of the
    summary whose name begins so; "found REGULAR EXPRESSION", the first group in the output.
    """
    kind, _, rest = column.partition(" ")
    if kind in ("computed", "theory", "difference"):
        for value in result["values"]:
            if value["name"].startswith(rest):
                return value.get(kind, "")
        return ""
    if kind == "found":
        match = re.search(rest, "\n".join(result["output"]))
        return match.group(1) if match else ""
    if column == "largest drift":
        return f"{max(result['drifts'].values()):.1e}" if result["drifts"] else ""
    value = result.get(column)
    if isinstance(value, float):
        return f"{value:.0f}" if value == round(value) and abs(value) < 1e6 else f"{value:.3g}"
    return "" if value is None else str(value)


def split_columns(words: str) -> dict[str, str]:
    """`COLUMN; HEAD=COLUMN; ...` as columns by their heads."""
    columns = (word.strip() for word in words.split(";") if word.strip())
    return {head: column or head for head, _, column in (one.partition("=") for one in columns)}


def fill_runs(arguments: str) -> list[str]:
    """`NAME... | COLUMN; HEAD=COLUMN; ...`, a run a row, named by its label or by its command."""
    names, _, words = arguments.partition("|")
    columns = split_columns(words)
    name = "command" if columns.pop("command", None) else "run"
    rows = []
    for result in map(read_result, choose(names.split())):
        first = result["label"] if name == "run" else f"`{result['command']}`"
        rows.append([first, *(find_cell(result, column) for column in columns.values())])
    return make_table([name, *columns], rows)


def fill_sizes(arguments: str) -> list[str]:
    """`NAME... | SIZE... | HEAD=COLUMN; ... | ERROR`: runs NAME-SIZE; COLUMNs of the finest."""
    names, words, columns, error = (part.strip() for part in arguments.split("|"))
    sizes = words.split()
    shown = split_columns(columns)
    rows = []
    for name in names.split():
        results = [read_result(f"{name}-{size}") for size in sizes]
        label = results[-1]["label"].partition(f", {sizes[-1]} cells")[0]
        known = [find_cell(results[-1], column) for column in shown.values()]
        errors = [float(find_cell(result, error).rstrip(" %")) for result in results]
        rows.append([label, *known, *(f"{one:+.2f} %" for one in errors)])
    return make_table(["run", *shown, *(f"error at {size} cells" for size in sizes)], rows)


def fill_verify(arguments: str) -> list[str]:
    """Quantities of the named problems on their finest grids; `first` of each problem only."""
    names = arguments.split()
    first = names == ["first"]
    finest = {}  # by problem and quantity, or by problem
    for record in read_result("verify")["rows"]:
        problem, what = record["problem"], record["what"]
        lead = finest.get(problem, record) if first else record
        if what == lead["what"] and (first or problem in names):
            finest[problem if first else (problem, what)] = record
    hidden = ("met", "CPU s", "threshold", "other results") if first else ("met", "CPU s")
    shown = [head for head in HEADS if head not in hidden]
    if len(names) == 1 and not first:
        shown.remove("problem")
    rows = [dict(zip(HEADS, format_record(one), strict=True)) for one in finest.values()]
    return make_table(shown, [[row[head] for head in shown] for row in rows])


def fill_output(arguments: str) -> list[str]:
    """The command and its output as a block of code."""
    (name,) = choose([arguments.strip()])
    result = read_result(name)
    return ["```", f"$ {result['command']}", *result["output"], "```"]


def fill_bench(arguments: str) -> list[str]:
    """A table of the benchmarks, with its command; with a condition its rows."""
    name, _, condition = arguments.strip().partition(" | ")
    file, _, table = name.rpartition(": ")
    found = read_result(file or "bench")[table]
    column, _, value = condition.partition("=")
    rows = [row for row in found["rows"] if not column or str(row[column]) == value]
    table = make_table(rows[0], [map(str, row.values()) for row in rows])
    return [f"`{found['command']}`.", "", *table]


def fill_result(name: str) -> list[str]:
    """A table as its benchmark has written it."""
    return (RESULTS / f"{name.strip()}.txt").read_text(encoding="utf-8").splitlines()


def fill_rules(_: str) -> list[str]:
    """What the verdict of a run measures, and from where on it reports it."""
    rows = [[rule.name, rule.meaning, f"above {rule.limit:g}"] for rule in RULES]
    rows.append(["cautions", "sentences of the problem on this deck and run", "above 0"])
    return make_table(["rule", "what is measured", "reported"], rows)


def fill_causes(_: str) -> list[str]:
    """Causes of early ends; the run that ends prints what has helped."""
    rows = [[cause.name, cause.means] for cause in ENDS.values()]
    return make_table(["ended early", "cause"], rows)


KINDS = {
    "head": lambda name: read_docstring(name.strip()).splitlines(),
    "verify": fill_verify,
    "runs": fill_runs,
    "sizes": fill_sizes,
    "output": fill_output,
    "bench": fill_bench,
    "result": fill_result,
    "causes": fill_causes,
    "rules": fill_rules,
}


def fill(text: str) -> str:
    """A page with all its regions filled."""

    def make(match: re.Match) -> str:
        body = "\n".join(KINDS[match["kind"]](match["arguments"]))
        return f"{match[1]}\n{body}\n\n{match[5]}"

    return REGION.sub(make, text)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="write nothing, exit code 1 if stale")
    parser.add_argument("--run", nargs="*", metavar="NAME", help="run docs/figures.toml first")
    options = parser.parse_args()
    if options.run is not None:
        for name in choose(options.run or ["*"]):
            text = json.dumps(make_result(name, FIGURES[name]), indent=1, ensure_ascii=False)
            (RESULTS / f"{name}.json").write_text(text + "\n", encoding="utf-8")
    stale = []
    for page in [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]:
        old = page.read_text(encoding="utf-8")
        if (new := fill(old)) != old:
            stale.append(page.relative_to(ROOT))
            if not options.check:
                page.write_text(new, encoding="utf-8")
    for page in stale:
        print(f"{page}: {'out of date' if options.check else 'written'}")
    return 1 if stale and options.check else 0


if __name__ == "__main__":
    raise SystemExit(main())
