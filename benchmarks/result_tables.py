"""Tables of the benchmarks: printed as they come, and kept as JSON by `--json FILE`.

A table has a name; its rows are flat dicts, the heads of the columns their keys, with units.  A
benchmark replaces its own tables in the file and leaves those of others.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any


def describe_machine() -> str:
    """Kind of processor, its threads, the load and the versions that decide speed."""
    words = [f"{platform.machine()}, {os.cpu_count()} hardware threads"]
    if hasattr(os, "getloadavg"):
        words.append(f"load {os.getloadavg()[0]:.1f} at the end")
    words += [f"Python {platform.python_version()}"]
    words += [f"{name} {version(name)}" for name in ("numpy", "numba", "scipy")]
    return ", ".join(words)


class Tables:
    """Rows by table; `add` prints each one at once."""

    def __init__(self, parser: argparse.ArgumentParser):
        parser.add_argument("--json", metavar="FILE", help="keep the tables in this file, too")
        self.options = parser.parse_args()
        self.rows: dict[str, list[dict[str, Any]]] = {}

    def add(self, table: str, **row: str | int | float) -> None:
        """One more row; numbers are rounded to three digits."""
        kept = {k: float(f"{v:.3g}") if isinstance(v, float) else v for k, v in row.items()}
        self.rows.setdefault(table, []).append(kept)
        print(f"{table}:", "  ".join(f"{head} {value}" for head, value in kept.items()), flush=True)

    def write(self) -> None:
        """Put the tables into the file of `--json`, if one is named."""
        if not self.options.json:
            return
        path = Path(self.options.json)
        known = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
        given = [word for word in sys.argv[1:] if not word.startswith("--json=")]
        if "--json" in given:
            at = given.index("--json")
            del given[at : at + 2]
        command = " ".join(["python", f"benchmarks/{Path(sys.argv[0]).name}", *given])
        for table, rows in self.rows.items():
            known[table] = {"command": command, "machine": describe_machine(), "rows": rows}
        path.write_text(json.dumps(known, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
