"""The code of docs/regrid-library.md runs as it stands, and its C callback by the ABI of C."""

from __future__ import annotations

import ctypes
import re

import numpy as np

from builders import ROOT
from shockgrid.regrid.measure.quality import find_bad_cells

PAGE = ROOT / "docs" / "regrid-library.md"


def test_the_page_runs(capsys):
    pieces = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    names: dict = {}
    for number, piece in enumerate(pieces):
        exec(compile(piece, f"piece-{number}", "exec"), names)
    out = capsys.readouterr().out
    assert len(find_bad_cells(names["nodes"])) == 0
    assert np.array_equal(names["nodes"][1, :, 0], names["boundary"][1, :, 0])
    assert "displacement" in out and "side j_m" in out and "crosses" in out
    assert "without failure" in out and names["found"].gap < 1.2

    # a host's memory, through the function pointer alone
    start = names["start"]
    boundary = names["boundary_at"](0.1)
    memory = (ctypes.c_double * start.size)(*start.ravel())
    sides = (ctypes.c_double * start.size)(*boundary.ravel())
    pointer = ctypes.cast(names["regrid_nodes"], ctypes.c_void_p).value
    call = ctypes.CFUNCTYPE(ctypes.c_int, names["Doubles"], names["Doubles"], *[ctypes.c_int] * 2)(
        pointer
    )
    assert call(memory, sides, 40, 30) == 0
    expected = names["regridder"].regrid(start, boundary).nodes
    assert np.array_equal(np.array(memory).reshape(start.shape), expected)
    sides[0] = np.nan
    assert call(memory, sides, 40, 30) == 1
    assert np.array_equal(np.array(memory).reshape(start.shape), expected)
