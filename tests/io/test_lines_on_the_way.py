"""A run whose cells become more on the way, through its files: restarts, gauges, pictures."""

from __future__ import annotations

import numpy as np
import pytest

from runs.store.reader import RunData

WORDS = (
    "interface-instability",
    "--set=mach=2",
    "--set=lengths=[2.5,2.5]",
    "--set=modes=[{ka0=0.5}]",
    "--set=cells=16",
    "--set=refine=true",
    "--set=stretch=1.1",
    "--set=kct_end=6",
    "--set=output.dumps=6",
    "--set=gauge=[{name='lump',at=[0.3,0.2],moves=true},{name='wall',at=[1.0,0.3]}]",
    "-q",
)


@pytest.fixture
def whole(shockgrid):
    """A finished run in ./whole, to whose flow lines were added."""
    code, _, error = shockgrid("run", *WORDS, "-o", "whole")
    assert code == 0, error
    return RunData("whole")


def test_a_run_that_gets_lines_restarts_and_shows_itself(shockgrid, whole):
    cells = whole.history["cells"]
    assert cells[-1] > cells[0] and (whole.history["cells_not_convex"] == 0).all()
    for dump in whole.dumps:
        row = np.flatnonzero(whole.history["step"] == dump.step)[0]
        sizes = [np.prod(np.array(block.nodes.shape[1:]) - 1) for block in dump.blocks]
        assert sum(sizes) == cells[row]
    came = int(whole.history["step"][np.flatnonzero(np.diff(cells))[0] + 1])
    # broken off just after lines came, and gone on with
    assert shockgrid("run", *WORDS, "-o", "other", f"--set=run.max_steps={came}")[0] == 0
    assert shockgrid("restart", "other", "-q", "--set", "run.max_steps=99999")[0] == 0
    if came not in [dump.step for dump in whole.dumps]:
        RunData("other").directory.dump_path(came).unlink()
    code, text, _ = shockgrid("compare", "whole", "other")
    assert (code, text.startswith("no difference")) == (0, True), text
    rows = np.array([list(RunData(name).gauges.values())[1] for name in ("whole", "other")])
    assert (rows[0] == rows[1]).all()
    for command in (
        ("info", "whole"),
        ("plot", "whole", "-o", "fields.png"),
        ("plot", "whole", "--what", "growth", "-o", "growth.png"),
        ("plot", "whole", "--what", "interface", "-o", "lines.png"),
        ("film", "whole", "-o", "film.gif", "--dpi", "40"),
    ):
        code, _, error = shockgrid(*command)
        assert code == 0, (command, error)
