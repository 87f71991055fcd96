"""Runs broken off in the middle, of every kind: the end has the bits of the run left alone."""

from __future__ import annotations

import numpy as np
import pytest

from shockgrid.runs.store.reader import RunData

STEEP = "lengths=[2,2] modes=[{ka0=0.5}] regrid.options.family=auto"  # the regridder has work
CASES = {
    "toy": "toy",
    "gas": f"interface-instability mach=2 cells=16 run.t_end=0.6 {STEEP}",
    # a limiter whose kernels other tests have compiled
    "metal": "interface-instability-al-ss304 limiter=monotonised-central cells=12 run.t_end=4e-7"
    " lengths=[1e-3,1e-3] modes=[{ka0=0.5}] regrid.options.family=auto",
    "steady": "heated-cavity cells=14 rayleigh=1e5 grid.kind=polevikov grid.every=2 output.dumps=8",
    "moving": "heated-cavity method=time cells=12 grid.kind=combined run.t_end=0.02"
    " longest_step=4e-4 output.dumps=2",
    "resting": "rayleigh-benard-layer cells=12 cells_up=10 amplitude=0.3 run.t_end=0.1"
    " output.dumps=2",
}


@pytest.mark.parametrize("case", CASES)
def test_a_restart_in_the_middle_has_the_same_end(shockgrid, case):
    name, *settings = CASES[case].split()
    words = ("run", name, *(f"--set={setting}" for setting in settings), "-q")
    assert shockgrid(*words, "-o", "whole")[0] == 0
    history = RunData("whole").history
    middle = int(history["step"][-1]) // 2
    if case in ("gas", "metal"):
        assert np.ptp(history["dt"][8:]) > 0.0, "dt adapts"
        assert history["regrid_iterations"][1:middle].sum() > 0, "grids are rebuilt"
        assert history["regrid_iterations"][middle:].sum() > 0
    if case in ("steady", "moving"):
        assert np.nanmax(history["grid_shift"]) > 0.0, "the grid moves"
    code = 3 if case == "steady" else 0  # half of the iterations are not steady
    assert shockgrid(*words, "-o", "other", f"--set=run.max_steps={middle}")[0] == code
    assert RunData("other").history["step"][-1] == middle
    code, _, error = shockgrid("restart", "other", "-q", "--set", "run.max_steps=99999")
    assert code == 0, error
    for run in ("whole", "other"):  # of the dump where one was told to stop
        RunData(run).directory.dump_path(middle).unlink(missing_ok=True)
    code, text, _ = shockgrid("compare", "whole", "other")
    assert (code, text.splitlines()[-1]) == (0, "no difference between whole and other"), text
