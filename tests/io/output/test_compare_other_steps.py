"""`compare` of runs with the same cells: other steps by time, the same steps bit for bit."""

from __future__ import annotations

import pytest

DECK = ("interface-instability", "--set", "cells=16", "--set", "lengths=[2, 2]", "--set", "mach=2")


@pytest.fixture
def runs(shockgrid):
    for name, cfl in (("a", 0.5), ("b", 0.4)):
        more = ("--set", f"run.cfl={cfl}", "--set", "run.t_end=0.2", "--set", "output.dumps=4")
        assert shockgrid("run", *DECK, *more, "-q", "-o", name)[0] == 0


def test_other_steps_are_compared_by_time(shockgrid, runs):
    code, out, error = shockgrid("compare", "a", "b")
    assert code == 1 and error == ""
    head = out.splitlines()[0]
    assert head.startswith("other steps: step 1 is at t = ")
    assert "dumps of about the same time, 0 within the tolerances" in head
    assert "history" in out and "rows" not in out and "  L1 " in out
    code, out, _ = shockgrid("compare", "a", "b", "--rtol", "0.5")
    assert code == 0 and "5 dumps of about the same time, 5 within" in out


def test_the_same_steps_are_compared_bit_for_bit(shockgrid, runs):
    assert shockgrid("compare", "a", "a")[:2] == (0, "no difference between a and a\n")
    more = ("--set", "run.cfl=0.5", "--set", "run.t_end=0.2", "--set", "run.max_steps=5")
    assert shockgrid("run", *DECK, *more, "-q", "-o", "short")[0] == 0
    code, out, _ = shockgrid("compare", "a", "short")
    assert code == 1 and "rows in a, 6 in short" in out and "other steps" not in out
