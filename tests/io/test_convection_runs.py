"""heated-cavity and rayleigh-benard from the command line: run, restart."""

from __future__ import annotations

import numpy as np
import pytest

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
    computed, reference, difference = line.split()[-4:-1]
    assert float(reference) == pytest.approx(4.521635, abs=1e-5)
    assert abs(float(computed) / float(reference) - 1.0) < 0.01
    assert float(difference) == pytest.approx(
        100.0 * (float(computed) / float(reference) - 1.0), abs=2e-3
    )
    code, text, _ = shockgrid("run", "heated-cavity-flux", "--set=cells=8", "-o", "flux", "-q")
    assert code == 0 and "no reference for this deck" in text
