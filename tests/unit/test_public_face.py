"""`import shockgrid`: its names, its version, and what it says where another package hides ours."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import shockgrid
from builders import ROOT


def run_python(*arguments, within=ROOT):
    """Python that looks for packages in the folder `within` first, then in the checkout."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(within), str(ROOT)])}
    return subprocess.run(
        [sys.executable, *arguments], capture_output=True, text=True, cwd=within, env=environment
    )


def make_package(folder: Path, name: str) -> Path:
    """A package that says, if it is run, that it should not have been."""
    (folder / name).mkdir(parents=True)
    (folder / name / "__init__.py").write_text("raise SystemExit('a stranger was imported')")
    return folder / name / "__init__.py"


@pytest.mark.parametrize("start", ["import shockgrid", "import regrid", "runs --help"])
def test_a_start_loads_nothing_heavy(start):
    heavy = {"numpy", "numba", "scipy", "h5py", "matplotlib", "msgspec"}
    if start == "import shockgrid":
        heavy |= {"click", "regrid", "runs", "importlib.metadata"}
    code = start if "--" not in start else "from runs.cli.main import main; main(['--help'])"
    done = run_python("-c", f"import sys\n{code}\nsys.exit(str({heavy!r} & set(sys.modules)))")
    assert done.stderr.strip() == "set()"
    assert ("interface-instability" in done.stdout) == (start == "runs --help")


PUBLIC = """
AlgebraicRegridder BadInput BarrierRegridder Block CarriedField Case Deck DeckTable
EquationOfState Hook IdealGas JWL MieGruneisen OpenRun Output PhaseTransition Problem Regrid
RegridFailure Report Row RunControl RunFailure Segment Simulation StiffenedGas StrengthLaw Study
Tabular
__version__ compare compare_column draw_field film find_material gravity grid inlined inspect join
key load make_plane_grid make_regridder open plot put put_walls register report restart run shock
slide study testing transfinite_grid verify
"""


def test_public_names_are_these_and_each_is_there():
    assert sorted(shockgrid.__all__) == sorted(PUBLIC.split())
    assert set(shockgrid.MODULES) == set(shockgrid.__all__) - {"__version__"}
    for name in shockgrid.__all__:
        thing = getattr(shockgrid, name)
        assert thing.__doc__, name
        if name != "__version__" and name not in shockgrid.SUBMODULES:
            wanted = shockgrid.ELSEWHERE.get(name, name)
            assert (thing.__module__, thing.__name__) == (shockgrid.MODULES[name], wanted)


@pytest.mark.parametrize("command", [["list"], ["run", "riemann"], ["--help"], ["info", "x"]])
def test_a_stranger_called_runs_is_named(tmp_path, command):
    stranger = make_package(tmp_path, "runs")
    done = run_python("-m", "shockgrid", *command, within=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"shockgrid: {stranger} hides shockgrid's own package 'runs'")
    assert "separate environment" in line


def test_public_names_say_it_too(tmp_path):
    make_package(tmp_path, "runs")
    done = run_python("-c", "from shockgrid import BadInput", within=tmp_path)
    assert "ImportError" in done.stderr and "separate environment" in done.stderr
