"""Tables of measured speeds: printed as they come, and kept as JSON.

A table has a name; its rows are flat dicts, the heads of the columns their keys, with units.  A
file keeps many tables: those measured anew are replaced, the others left.
"""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

from regrid.errors import BadInput


def describe_machine() -> str:
    """Kind of processor, its threads, the load and the versions that decide speed."""
    words = [f"{platform.machine()}, {os.cpu_count()} hardware threads"]
    if hasattr(os, "getloadavg"):
        words.append(f"load {os.getloadavg()[0]:.1f} at the end")
    words += [f"Python {platform.python_version()}"]
    words += [f"{name} {version(name)}" for name in ("numpy", "numba", "scipy")]
    return ", ".join(words)


class Tables:
    """Rows by table; `path`: of the JSON file, or None; `say` is told each row at once."""

    def __init__(self, path: str | None, command: str, say: Callable[[str], None]):
        self.path, self.command, self.say = Path(path) if path else None, command, say
        self.rows: dict[str, list[dict[str, Any]]] = {}
        if self.path and not self.path.parent.is_dir():
            raise BadInput(f"{self.path}: there is no directory {self.path.parent}")
        self.known = self._read()

    def _read(self) -> dict[str, Any]:
        if self.path is None or not self.path.exists():
            return {}
        try:
            known = json.loads(self.path.read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError) as error:
            raise BadInput(f"{self.path} is not a JSON file of measurements: {error}") from None
        if not isinstance(known, dict):
            raise BadInput(f"{self.path} is not a JSON file of measurements")
        return known

    def add(self, table: str, **row: str | int | float) -> None:
        """One more row; numbers are rounded to three digits."""
        kept = {k: float(f"{v:.3g}") if isinstance(v, float) else v for k, v in row.items()}
        self.rows.setdefault(table, []).append(kept)
        self.say(f"{table}: " + "  ".join(f"{head} {value}" for head, value in kept.items()))

    def write(self) -> None:
        """Put the tables into the file, if one is named."""
        if self.path is None:
            return
        for table, rows in self.rows.items():
            self.known[table] = {
                "command": self.command,
                "machine": describe_machine(),
                "rows": rows,
            }
        text = json.dumps(self.known, indent=1, ensure_ascii=False) + "\n"
        self.path.write_text(text, encoding="utf-8")
