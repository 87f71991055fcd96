"""Tables of the benchmarks, kept as JSON by `--json FILE`, or as Markdown for the pages of docs/.

Also the machine that measured, and the processor time of commands that have ended.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import msgspec

from shockgrid.regrid.errors import BadInput

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

RESULTS = Path(__file__).resolve().parents[1] / "docs" / "results"

# commands that are timed start from bytecode on the disk, as installed ones do: where a machine's
# environment forbids to write it, each start would compile all sources anew
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)


def make_table(heads: Iterable[str], rows: Iterable[Iterable[str]]) -> list[str]:
    """The lines of a Markdown table."""
    heads = list(heads)
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    for row in rows:
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |")
    return lines


def write_result(name: str, lines: Iterable[str]) -> None:
    """Write docs/results/NAME.txt, which `docs/generate.py` pastes into its page."""
    (RESULTS / f"{name}.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


def read_child_time() -> Any:
    """Use of ended child processes (`ru_utime`, `ru_stime` [s]); BadInput if it is not counted."""
    if resource is None:
        raise BadInput(
            "bench: this system does not tell the CPU time of a command that has ended; "
            "flow_speed.py can with --runs none and without --peer"
        )
    return resource.getrusage(resource.RUSAGE_CHILDREN)


def describe_machine() -> str:
    """Kind of processor, its threads, the load and the versions that decide speed."""
    words = [f"{platform.machine()}, {os.cpu_count()} hardware threads"]
    if hasattr(os, "getloadavg"):
        words.append(f"load {os.getloadavg()[0]:.1f} at the end")
    words += [f"Python {platform.python_version()}"]
    words += [f"{name} {version(name)}" for name in ("numpy", "numba", "scipy")]
    return ", ".join(words)


class Tables:
    """Rows by table, of a script; `options` are what its `parser` has read.

    Each row is printed at once; `write` puts all into the file of --json, if one is named.
    """

    def __init__(self, parser: argparse.ArgumentParser):
        parser.add_argument("--json", metavar="FILE", help="keep the tables in this file, too")
        self.options = parser.parse_args()
        given = [word for word in sys.argv[1:] if not word.startswith("--json=")]
        if "--json" in given:
            at = given.index("--json")
            del given[at : at + 2]
        script = Path(sys.argv[0]).resolve()
        here = script.relative_to(Path(__file__).resolve().parents[1])
        words = [f"python {here.as_posix()}"]
        if getattr(sys.modules["__main__"], "__spec__", None) is not None:
            words = ["python -m", ".".join(here.with_suffix("").parts)]
        self.command = " ".join([*words, *given])
        self.path = Path(self.options.json) if self.options.json else None
        self.rows: dict[str, list[dict[str, Any]]] = {}
        if self.path and not self.path.parent.is_dir():
            raise BadInput(f"{self.path}: there is no directory {self.path.parent}")
        self.known = self._read()

    def _read(self) -> dict[str, Any]:
        if self.path is None or not self.path.exists():
            return {}
        try:
            return msgspec.json.decode(self.path.read_bytes(), type=dict[str, Any])
        except (OSError, msgspec.MsgspecError, RecursionError) as error:
            raise BadInput(f"{self.path} is not a JSON file of measurements: {error}") from None

    def add(self, table: str, **row: str | int | float) -> None:
        """One more row; numbers are rounded to three digits."""
        kept = {k: float(f"{v:.3g}") if isinstance(v, float) else v for k, v in row.items()}
        self.rows.setdefault(table, []).append(kept)
        words = "  ".join(f"{head} {value}" for head, value in kept.items())
        print(f"{table}: {words}", flush=True)

    def write(self) -> None:
        """Put the tables into the file, if one is named."""
        if self.path is None:
            return
        for table, rows in self.rows.items():
            made = {"command": self.command, "machine": describe_machine()}
            self.known[table] = {**made, "rows": rows}
        text = json.dumps(self.known, indent=1, ensure_ascii=False) + "\n"
        self.path.write_text(text, encoding="utf-8")
