"""`import shockgrid`: its names, its version, and what its parts load and need."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import shockgrid
from builders import INSIDE, ROOT


def run_python(*arguments, within=ROOT):
    """Python that looks for packages in the folder `within` first, then in the checkout."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(within), str(ROOT)])}
    return subprocess.run(
        [sys.executable, *arguments], capture_output=True, text=True, cwd=within, env=environment
    )


@pytest.mark.parametrize("start", ["import shockgrid", "import shockgrid.regrid", "runs --help"])
def test_a_start_loads_nothing_heavy(start):
    heavy = {"numpy", "numba", "scipy", "h5py", "matplotlib", "msgspec"}
    if start == "import shockgrid":
        heavy |= {"click", "shockgrid.regrid", "shockgrid.runs", "importlib.metadata"}
    code = (
        start if "--" not in start else "from shockgrid.runs.cli.main import main; main(['--help'])"
    )
    done = run_python("-c", f"import sys\n{code}\nsys.exit(str({heavy!r} & set(sys.modules)))")
    assert done.stderr.strip() == "set()"
    assert ("interface-instability" in done.stdout) == (start == "runs --help")


PUBLIC = """
AlgebraicRegridder BadInput BarrierRegridder Block CarriedField Case Deck DeckTable
EquationOfState Hook IdealGas JWL MieGruneisen OpenRun Output PhaseTransition Problem Regrid
RegridFailure Report Row RunControl RunFailure Segment Simulation StiffenedGas StrengthLaw Study
Tabular
__version__ compare draw_field film find_material gravity grid inlined inspect join
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


def make_package(folder: Path, name: str) -> None:
    """A package that ends whatever imports it."""
    (folder / name).mkdir(parents=True)
    (folder / name / "__init__.py").write_text("raise SystemExit('a stranger was imported')")


@pytest.mark.parametrize("command", [["list"], ["--help"], ["check", "riemann"]])
def test_packages_of_a_user_may_be_called_like_ours(tmp_path, command):
    for name in INSIDE:
        make_package(tmp_path, name)
    done = run_python("-m", "shockgrid", *command, within=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")


ALONE = """
import sys
for name in ("h5py", "matplotlib", "click", "tqdm", "msgspec", "tomli_w", "jinja2"):
    sys.modules[name] = None
import numpy as np
from shockgrid import regrid
for name in regrid.__all__:
    getattr(regrid, name)
regrid.make_domain("horseshoe", 4, 4)
nodes = np.array(np.meshgrid(np.linspace(0, 1, 4), np.linspace(0, 1, 4), indexing="ij"))
print(regrid.measure_quality(regrid.transfinite_grid(nodes)).least_corner_area > 0)
print({"shockgrid.hydro", "shockgrid.problems", "shockgrid.runs"} & set(sys.modules))
"""


def test_the_regridder_needs_numpy_numba_and_scipy_only():
    done = run_python("-c", ALONE)
    assert (done.stdout.split(), done.stderr) == (["True", "set()"], "")
