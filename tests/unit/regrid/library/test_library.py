"""`import regrid` by itself: its names, what it needs, and its use beside numpy and numba alone."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import llvmlite
import numba
import numpy as np
import pytest

import regrid
from builders import ROOT

PUBLIC = """
AlgebraicRegridder BadInput BarrierRegridder March Quality RegridFailure RegridReport RegridResult
Regridder arc_law choose_times clustered_law compute_corner_areas find_bad_cells find_start
geometric_law make_domain make_regridder march march_domain measure_first_line_gap measure_quality
redistribute repair_grid transfinite_grid uniform_law
"""
PAGE = ROOT / "docs" / "regrid-library.md"

# what a host does with the library, from a grid on plain arrays to a failure in words
USE = """
import regrid, sys
import numpy as np
for name in regrid.__all__:
    assert getattr(regrid, name).__doc__, name

def sides(t):
    nodes = np.empty((2, 13, 9))
    nodes[0], nodes[1] = np.linspace(0.0, 1.0, 13)[:, None], np.linspace(0.0, 1.0, 9)
    nodes[1, :, 0] -= 0.4 * t * np.sin(np.pi * nodes[0, :, 0])
    return nodes

start = regrid.transfinite_grid(sides(0.0))
found = regrid.march(regrid.BarrierRegridder(), start, sides, cells=0.5, gap_sides=["j_min"])
assert found.failure is None and found.done == found.steps and found.sine > 0.5, found
for name in ("transfinite", "winslow", "equidistribution", "ivanenko-charakhchyan"):
    assert regrid.march(regrid.make_regridder(name), start, sides, [0.1]).done == 1, name
assert regrid.redistribute(start[:, :, 0], regrid.clustered_law(13, 0.02)).shape == (2, 13)
try:
    regrid.make_domain("dome", 8, 8)
except regrid.BadInput as error:
    print(error)
loaded = {name.partition(".")[0] for name in sys.modules}
print(*sorted(loaded & {"scipy", "h5py", "click", "msgspec", "matplotlib", "hydro", "runs"}))
"""


def test_import_loads_nothing_but_python():
    code = "import sys, regrid; print(*({'numpy', 'numba', 'scipy'} & set(sys.modules)))"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True
    )
    assert done.stdout.split() == []


def test_public_names_are_these():
    assert sorted(regrid.__all__) == sorted(PUBLIC.split())
    assert set(regrid.MODULES) == set(regrid.__all__) <= set(dir(regrid))
    for name in regrid.__all__:
        thing = getattr(regrid, name)
        assert (thing.__module__, thing.__name__) == (regrid.MODULES[name], name)
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = regrid.no_such_name


def test_the_page_has_every_public_name():
    words = set(re.findall(r"\w+", PAGE.read_text(encoding="utf-8")))
    assert set(regrid.__all__) <= words


@pytest.mark.skipif(os.name == "nt", reason="links to folders need rights there")
def test_numpy_and_numba_are_enough(tmp_path):
    folders = [Path(module.__file__).parent for module in (np, numba, llvmlite, regrid)]
    for folder in [*folders, *(path.with_name(path.name + ".libs") for path in folders)]:
        if folder.is_dir():
            (tmp_path / folder.name).symlink_to(folder, target_is_directory=True)
    code = f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n{USE}"
    done = subprocess.run([sys.executable, "-I", "-S", "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == ["domain: named domains need scipy: pip install scipy", ""]
