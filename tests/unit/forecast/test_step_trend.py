"""dt's fall: when it is noted, of which cell, and that its settings are said once."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from runs.forecast.step_trend import StepTrend


def make_block(name="a", ni=6, nj=8, squeezed=None, hot=None):
    """A block of squares; one cell thin, or one with fast waves."""
    x, y = np.meshgrid(np.arange(ni + 1.0), np.arange(nj + 1.0), indexing="ij")
    rates = np.ones((ni, nj))
    if squeezed:  # a node line brought near to the one before it
        i, j = squeezed
        y[i : i + 2, j + 1 :] = y[i : i + 2, j : j + 1] + 0.01 * np.arange(1, nj - j + 1)
        rates[squeezed] = 50.0
    if hot:
        rates[hot] = 1e2
    wall = SimpleNamespace(side="j_min", start=0, stop=ni, kind="wall", follows_flow=False)
    return SimpleNamespace(name=name, nodes=np.array([x, y]), rates=rates, segments=[wall])


def make_run(**options):
    first, second = make_block("a"), make_block("b")
    clock = SimpleNamespace(rate=1.0)
    flow = SimpleNamespace(blocks=[first, second], clock=clock)
    run = SimpleNamespace(flow=flow, step=0, t=0.0)
    noted, said = [], []
    trend = StepTrend(run, noted.append, said.append)
    flow.blocks[1] = make_block("b", **options)
    clock.rate = max(float(block.rates.max()) for block in flow.blocks)
    return run, trend, noted, said


def follow(run, trend, dts, limit="sound"):
    for dt in dts:
        run.step, run.t = run.step + 1, run.t + dt
        trend.follow({"dt": dt, "dt_limit": limit})


def test_a_line_for_every_factor_of_the_root_of_ten_and_settings_once():
    run, trend, noted, said = make_run(squeezed=(3, 4))
    follow(run, trend, np.geomspace(1.0, 1.01e-3, 400))
    assert len(noted) == len(trend.marks) == 5  # 3.2, 10, 32, 100, 316
    assert [round(np.log10(mark.shrunk), 1) for mark in trend.marks] == [0.5, 1.0, 1.5, 2.0, 2.5]
    assert len(said) == 1 and "what can be changed: run.small_cells=0.1" in said[0]
    assert "b i=3, j=4 at (3.5, 4.005) m" in noted[0] and "inside" in noted[0]


def test_a_hot_cell_is_not_called_thin():
    run, trend, noted, _ = make_run(hot=(2, 0))
    follow(run, trend, [1.0, 0.2])
    assert trend.marks[0].meaning == "hot" and "fast waves" in noted[0]
    run, trend, noted, _ = make_run(squeezed=(2, 0))
    follow(run, trend, [1.0, 0.2])
    assert trend.marks[0].meaning == "thin"


def test_a_larger_dt_is_a_new_start_and_a_fall_is_not_told_twice():
    run, trend, noted, _ = make_run()
    follow(run, trend, [1.0, 0.2, 1.0, 0.2, 0.31])
    assert len(noted) == 1
    follow(run, trend, [10.0, 2.0])
    assert len(noted) == 1, "a fifth of the largest was told of already"
    follow(run, trend, [0.9])
    assert len(noted) == 2
