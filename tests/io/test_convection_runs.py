"""heated-cavity and rayleigh-benard from the command line: run, restart, pictures, bad decks."""

from __future__ import annotations

import numpy as np
import pytest

from runs.pictures.fields import time_titles
from runs.store.reader import RunData

STEADY = (
    "heated-cavity",
    "--set=cells=14",
    "--set=rayleigh=1e5",
    "--set=grid.kind=polevikov",
    "--set=grid.every=2",
    "--set=output.dumps=8",
    "-q",
)
MOVING = (
    "heated-cavity",
    "--set=method=time",
    "--set=cells=12",
    "--set=grid.kind=combined",
    "--set=run.t_end=0.02",
    "--set=longest_step=4e-4",
    "--set=output.dumps=2",
    "-q",
)
RESTING = (
    "rayleigh-benard-layer",
    "--set=cells=12",
    "--set=cells_up=10",
    "--set=amplitude=0.3",
    "--set=run.t_end=0.1",
    "--set=output.dumps=2",
    "-q",
)


@pytest.mark.parametrize("words", [STEADY, MOVING, RESTING], ids=["steady", "moving", "resting"])
def test_a_restart_has_the_same_bits(shockgrid, words):
    assert shockgrid("run", *words, "-o", "whole")[0] == 0
    history = RunData("whole").history
    if words is not RESTING:
        assert np.nanmax(history["grid_shift"]) > 0.0, "the grid moves"
    middle = int(history["step"][-1]) // 2
    half = [f"--set=run.max_steps={middle}"]
    code = 3 if words is STEADY else 0  # half of the iterations are not steady
    assert shockgrid("run", *words, *half, "-o", "other")[0] == code
    code, _, error = shockgrid("restart", "other", "-q", "--set", "run.max_steps=99999")
    assert code == 0, error
    for name in ("whole", "other"):  # of the dump where one was told to stop
        RunData(name).directory.dump_path(middle).unlink(missing_ok=True)
    code, text, _ = shockgrid("compare", "whole", "other")
    assert (code, text.startswith("no difference")) == (0, True), text


def test_the_closing_screen_stands_beside_the_reference(shockgrid):
    code, text, _ = shockgrid("run", "heated-cavity", "--set=cells=20", "-o", "out", "-q")
    assert code == 0 and "steady" in text
    line = next(line for line in text.splitlines() if "Nu mean" in line)
    computed, reference, difference = line.split()[-3:]
    assert float(reference) == pytest.approx(4.521635, abs=1e-5)
    assert abs(float(computed) / float(reference) - 1.0) < 0.01
    assert float(difference.strip("%")) == pytest.approx(
        100.0 * (float(computed) / float(reference) - 1.0), abs=2e-3
    )
    code, text, _ = shockgrid("run", "heated-cavity-flux", "--set=cells=8", "-o", "flux", "-q")
    assert code == 0 and "no reference for this deck" in text


def test_a_run_that_is_not_steady_says_so(shockgrid):
    words = ("heated-cavity", "--set=cells=8", "--set=run.t_end=4", "-o", "out", "-q")
    code, text, _ = shockgrid("run", *words)
    assert code == 3 and text.startswith(
        "all 4 iterations made, not steady: 4 iterations, 64 cells"
    )
    assert "NOT STEADY: these are iterates at Ra = 1e+04" in text
    assert "step 4, 4 iterations of 4 (100%)" in shockgrid("info", "out")[1]
    again = ("--set=run.max_steps=6", "--set=run.t_end=200", "-q")
    code, text, _ = shockgrid("restart", "out", *again)
    assert code == 3 and text.startswith("max_steps = 6 reached, not steady: 6 iterations")
    code, text, _ = shockgrid("restart", "out", "--set=run.max_steps=200", "-q")
    assert code == 0 and text.startswith("steady: ")
    dump = RunData("out").dumps[-1]
    assert dump.t_unit == "iterations" and time_titles([dump]) == [f"{dump.step} iterations"]


def test_onset_and_growth_on_the_closing_screen(shockgrid):
    words = ("rayleigh-benard", "--set=cells=16", "--set=cells_up=16", "--set=run.t_end=1.0")
    code, text, _ = shockgrid("run", *words, "-o", "out", "-q")
    assert code == 0
    lines = text.splitlines()
    onset = next(line for line in lines if line.startswith("  onset, Ra")).split()
    assert float(onset[3]) == pytest.approx(2585.02)
    assert abs(float(onset[2]) / 2585.02 - 1.0) < 0.04
    grown = next(line for line in lines if line.startswith("  growth rate, in time")).split()
    assert float(grown[4]) == pytest.approx(float(grown[5]), rel=0.01)
    history = RunData("out").history
    assert history["nusselt"][-1] > 1.4
    assert history["nusselt"][-1] == pytest.approx(history["nusselt_top"][-1], rel=1e-5)
    drift = history["total_heat"] - history["boundary_heat"]
    assert np.ptp(drift[np.isfinite(drift)]) < 1e-13
    assert np.nanmax(history["mass_residual"]) < 1e-15


@pytest.mark.parametrize("words", [STEADY, RESTING], ids=["cavity", "layer"])
def test_pictures(shockgrid, words, toy):
    assert shockgrid("run", *words, "--plot", "-o", "out")[0] == 0
    names = {"flow", "nusselt", "grid"} | ({"growth"} if words is RESTING else set())
    for name in names:
        assert (toy / "out" / f"{name}.png").stat().st_size > 10_000
    code, text, _ = shockgrid("info", "out")
    assert code == 0 and "psi" not in text.split("block box")[0]


BAD = {
    "rayleigh": (["rayleigh=-5"], "Ra = -5 is negative; heat the other wall or turn gravity"),
    "cells": (["cells=2"], "cells"),
    "flat": (["cells_up=2"], "cells_up"),
    "prandtl": (["prandtl=0"], "Pr = 0 must be positive"),
    "no gravity": (["gravity=[0.0,0.0]"], "gravity is zero but Ra = 100000 asks for buoyancy"),
    "two gravities": (["gravity=[0.0,-1.0]", "tilt=10"], "are both given"),
    "adiabatic value": (["top.value=1"], "top.value = 1 contradicts top.heat = 'adiabatic'"),
    "no steady state": (
        ["left.heat=adiabatic", "left.value=0", "right.heat=flux", "right.value=1"],
        "which no steady state can",
    ),
    "all adiabatic": (
        [f"{side}.{key}" for side in ("left", "right") for key in ("heat=adiabatic", "value=0")],
        "no wall is isothermal",
    ),
    "grid": (["grid.kind=polevikof"], "polevikov"),
    "periodic side": (["left.flow=periodic"], "left.flow"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_decks_get_one_sentence(shockgrid, name):
    changes, words = BAD[name]
    sets = [f"--set={change}" for change in changes]
    code, _, error = shockgrid("run", "heated-cavity", *sets, "-o", "out", "-q")
    assert code == 2 and words in error
    assert len(error.strip().splitlines()) == 1


def test_bad_layers_get_one_sentence(shockgrid):
    code, _, error = shockgrid("run", "rayleigh-benard", "--set=rayleigh=-1", "-o", "out", "-q")
    assert code == 2 and "Ra = -1 is negative" in error
    code, _, error = shockgrid("run", "rayleigh-benard", "--set=cells_up=2", "-o", "out", "-q")
    assert code == 2 and "cells_up" in error
    words = ("--set=sides=conducting", "-o", "out", "-q")
    code, _, error = shockgrid("run", "rayleigh-benard-layer", *words)
    assert code == 2 and "contradicts shape = 'layer'" in error


def test_the_onset_of_a_narrow_box_is_found_however_far(shockgrid):
    words = ["--set=width=0.2", "--set=cells=6", "--set=cells_up=12", "--set=run.t_end=0.01"]
    code, text, _ = shockgrid("run", "rayleigh-benard", *words, "-o", "out", "-q")
    assert code == 0
    line = next(line for line in text.splitlines() if line.startswith("  onset, Ra")).split()
    assert float(line[2]) > 3.0 * 5000.0, "beyond the bracket that usual decks need"
    assert "nothing moves" in text and "growth rate, in time" not in text


def test_a_cavity_heated_from_below_has_no_side_to_compare(shockgrid):
    sets = [
        f"--set={side}.{key}" for side in ("left", "right") for key in ("heat=adiabatic", "value=0")
    ]
    sets += ["--set=bottom.heat=isothermal", "--set=bottom.value=1", "--set=top.heat=isothermal"]
    code, text, _ = shockgrid("run", "heated-cavity", *sets, "--set=cells=8", "-o", "out", "-q")
    assert code == 0 and "nan" not in text and "heat out" not in text
