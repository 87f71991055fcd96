"""The generated regions of the pages are those that docs/results and the docstrings make."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from builders import ROOT


def generate(*words: str, root: Path = ROOT) -> subprocess.CompletedProcess:
    """docs/generate.py in a process of its own."""
    command = [sys.executable, str(root / "docs" / "generate.py"), *words]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True)


def test_every_region_is_up_to_date():
    done = generate("--check")
    assert done.returncode == 0, done.stdout + done.stderr


def test_every_result_is_of_a_run_that_figures_toml_has():
    import tomllib

    figures = tomllib.loads((ROOT / "docs" / "figures.toml").read_text(encoding="utf-8"))
    results = {path.stem for path in (ROOT / "docs" / "results").glob("*.json")}
    made = {"verify", "bench", "regrid_suite", "memory", "mpi", "race"}
    made |= {"shock-tube", "vortex-sheet", "convection-1d"}
    assert results == {*figures, *made}
