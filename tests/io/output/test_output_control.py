"""Which dumps a run leaves, what is in them, and that no array is stored twice."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from shockgrid.runs.store.dumps import read_state
from shockgrid.runs.store.reader import RunData

GAS = ("interface-instability", "--set=mach=2", "--set=lengths=[2,2]", "--set=cells=16", "-q",
       "--set=modes=[{ka0=0.5}]", "--set=run.t_end=0.3",
       "--set=regrid.options.family=auto")  # fmt: skip


def set_all(*settings: str) -> tuple[str, ...]:
    return tuple(word for setting in settings for word in ("--set", setting))


def find_first_past(history, time):
    return int(history["step"][np.flatnonzero(history["t"] >= time)[0]])


def test_dumps_at_chosen_times_and_intervals(shockgrid):
    shockgrid(
        "run", "toy", "-o", "times", "-q", *set_all("output.dumps=0", "output.times=[0.2,0.07]")
    )
    run = RunData("times")
    wanted = [0, *(find_first_past(run.history, t) for t in (0.07, 0.2)), run.history["step"][-1]]
    assert [dump.step for dump in run.outputs] == wanted
    shockgrid("run", "toy", "-o", "every", "-q", *set_all("output.every=0.11"))
    run = RunData("every")
    wanted = [find_first_past(run.history, 0.11 * k) for k in range(5)]
    assert [dump.step for dump in run.outputs] == [*wanted, run.history["step"][-1]]


def test_light_dumps_hold_what_was_asked_for_and_the_last_one_all(shockgrid):
    assert shockgrid("run", *GAS, "-o", "full")[0] == 0
    light = set_all("output.fields=['p','rho']", "output.precision=single", "output.compression=4")
    assert shockgrid("run", *GAS, "-o", "light", *light)[0] == 0
    full = RunData("full").outputs
    small = RunData("light").outputs
    assert [dump.step for dump in small] == [dump.step for dump in full]
    for one, other in zip(full[:-1], small[:-1], strict=True):
        assert one.has_state and not other.has_state
        assert list(other.blocks[0].cell_fields) == ["rho", "p"]
        assert (one.blocks[1].nodes == other.blocks[1].nodes).all()
        values = other.blocks[1].cell_fields["rho"]
        assert values.dtype == np.float32
        assert (values == one.blocks[1].cell_fields["rho"].astype(np.float32)).all()
        assert other.path.stat().st_size < 0.7 * one.path.stat().st_size
    assert small[-1].path.read_bytes()[:8] == full[-1].path.read_bytes()[:8]
    state = read_state(full[-1].path)
    other = read_state(small[-1].path)
    assert all(np.array_equal(state[key], other[key]) for key in state)
    assert shockgrid("plot", "light")[0] == 0
    code, _, error = shockgrid("plot", "light", "u")
    assert code == 2 and "'u'" in error
    code, _, error = shockgrid("restart", "light", "--at", str(small[3].step))
    steps = f"there are: {small[-1].step}"
    assert code == 2 and f"no restart point of step {small[3].step}; {steps}" in error


def test_a_run_with_light_dumps_goes_on_from_its_restart_points(shockgrid):
    light = set_all("output.precision=single", "output.restart_every=1e-9", "run.t_end=0.1")
    shockgrid("run", "toy", "-o", "whole", "-q", *light)
    shockgrid("run", "toy", "-o", "other", "-q", *light, "--set", "fail_at=9")
    assert "last restart point: step 9 (shockgrid restart other)" in shockgrid("info", "other")[1]
    points = [path.name for _, path in RunData("other").directory.list_points()]
    assert "restart_000009.h5" in points
    deck = Path("other/deck.toml")
    deck.write_text(deck.read_text().replace("fail_at = 9", "fail_at = -1"))
    Path("other/run.log").unlink()  # which knows the deck
    assert shockgrid("restart", "other", "-q")[0] == 0
    code, text, _ = shockgrid("compare", "whole", "other")
    assert code == 0, text
