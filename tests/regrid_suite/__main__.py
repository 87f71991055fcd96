"""`python tests/regrid_suite`: see `commands`; on one thread, as costs are those of one."""

from __future__ import annotations

import os
import sys
from pathlib import Path

os.environ["NUMBA_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["OMP_NUM_THREADS"] = "1"
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # the folder of this package

from regrid_suite.commands import suite

suite(prog_name="python tests/regrid_suite")
