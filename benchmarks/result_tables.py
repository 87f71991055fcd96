"""Tables of the benchmarks: those of `runs.bench`, kept as JSON by `--json FILE`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from runs import bench as tables


class Tables(tables.Tables):
    """Tables of a script; `options` are what its `parser` has read."""

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
        command = " ".join([*words, *given])
        super().__init__(self.options.json, command, lambda line: print(line, flush=True))
