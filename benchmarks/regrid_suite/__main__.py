"""`python -m benchmarks.regrid_suite`: see `commands`; on one thread, as costs are those of one."""

from __future__ import annotations

import os

os.environ["NUMBA_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["OMP_NUM_THREADS"] = "1"

from benchmarks.regrid_suite.commands import suite

suite(prog_name="python -m benchmarks.regrid_suite")
