"""The code of docs/notebook.md and of the notebooks runs as it stands."""

from __future__ import annotations

import json
import re
import sys
import types

import pytest

import shockgrid as sg
from builders import ROOT
from shockgrid.regrid.registry import REGRIDDERS

PAGE = ROOT / "docs" / "notebook.md"
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))


def read_cells(path) -> list[str]:
    """The code of a notebook, cell by cell."""
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    return ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A folder to run in, and a registry that forgets."""
    monkeypatch.chdir(tmp_path)
    for name in ("even", "averaged"):
        monkeypatch.setitem(REGRIDDERS, name, "")
        del REGRIDDERS[name]
    return tmp_path


def run_as_main(pieces: list[str], monkeypatch) -> dict:
    """Run pieces as a script or notebook is run: as the module `__main__`."""
    module = types.ModuleType("__main__")
    monkeypatch.setitem(sys.modules, "__main__", module)
    for number, piece in enumerate(pieces):
        exec(compile(piece, f"cell-{number}", "exec"), vars(module))
    return vars(module)


@pytest.mark.slow  # compiles kernels of its own
def test_the_page_runs(place, monkeypatch, capsys):
    pieces = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    found = run_as_main(pieces, monkeypatch)
    out = capsys.readouterr().out
    assert "wide enough" in out and "t_end reached" in out
    made = sorted(path.name for path in (place / "out").iterdir())
    assert made == ["impact", "linear", "tube", "watched"]
    x = found["run"].interface().x  # Sod's contact: 0.927 m/s from x = 0.5
    assert x.mean() == pytest.approx(0.5 + 0.9275 * 0.2, rel=2e-3)
    assert found["marches"]["Even"].done == found["marches"]["Even"].steps
    assert isinstance(found["case"], sg.Case)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=[path.stem for path in NOTEBOOKS])
def test_notebooks_keep_no_results(path):
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    assert not any(cell.get("outputs") for cell in cells)  # NOTEBOOKS=true make docs makes them


@pytest.mark.parametrize(
    "name",
    [
        "own-problem",
        "own-regridder",
        pytest.param("own-eos", marks=pytest.mark.slow),  # compiles kernels of its own
        pytest.param("mach-sweep", marks=pytest.mark.slow),
        pytest.param("convergence", marks=pytest.mark.slow),
        pytest.param("film", marks=pytest.mark.slow),
    ],
)
def test_notebooks_run(name, place, monkeypatch):
    if name == "film":
        pytest.importorskip("IPython", reason="the notebook shows the film by IPython")
    path = next(path for path in NOTEBOOKS if path.stem == name)
    run_as_main(read_cells(path), monkeypatch)  # they hold what they assert
