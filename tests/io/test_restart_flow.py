"""The main job through its files: `interface-instability` broken off in the middle or killed.

A steep interface, so that the regridder works; the end must have the same bits as that of a run
that nothing disturbed.
"""

from __future__ import annotations

import numpy as np
import pytest

from runs.store.reader import RunData

GAS = (
    "interface-instability",
    "--set=mach=2",
    "--set=lengths=[2,2]",
    "--set=modes=[{ka0=0.5}]",
    "--set=cells=16",
    "--set=run.t_end=0.6",
    "--set=regrid.options.family=auto",  # more work for the regridder than "i"
    "-q",
)
METAL = (
    "interface-instability-al-ss304",
    "--set=limiter=monotonised-central",  # whose kernels other tests have compiled
    "--set=lengths=[1e-3,1e-3]",
    "--set=modes=[{ka0=0.5}]",
    "--set=cells=12",
    "--set=run.t_end=4e-7",
    "--set=regrid.options.family=auto",
    "-q",
)


def assert_same_end(shockgrid, steps_apart=()):
    """Runs `whole` and `other` have the same dumps, fields and history, to the last bit."""
    for step in steps_apart:  # where one was told to stop it left a dump of its own
        for name in ("whole", "other"):
            RunData(name).directory.dump_path(step).unlink(missing_ok=True)
    code, text, _ = shockgrid("compare", "whole", "other")
    assert (code, text.startswith("no difference")) == (0, True), text


@pytest.mark.parametrize("words", [GAS, METAL], ids=["gas", "metal"])
def test_a_restart_in_the_middle_has_the_same_end(shockgrid, words):
    assert shockgrid("run", *words, "-o", "whole")[0] == 0
    history = RunData("whole").history
    middle = len(history["step"]) // 2
    assert np.ptp(history["dt"][8:]) > 0.0, "dt adapts"
    assert history["regrid_iterations"][1:middle].sum() > 0, "grids are rebuilt"
    assert history["regrid_iterations"][middle:].sum() > 0
    assert shockgrid("run", *words, "-o", "other", f"--set=run.max_steps={middle}")[0] == 0
    assert RunData("other").history["step"][-1] == middle
    code, _, error = shockgrid("restart", "other", "-q", "--set", "run.max_steps=99999")
    assert code == 0, error
    assert_same_end(shockgrid, [middle])
