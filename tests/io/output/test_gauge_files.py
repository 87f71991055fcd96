"""gauges.csv: written at every step, the same bits after a restart or a kill, and what refuses."""

from __future__ import annotations

import signal
import time
from pathlib import Path

import numpy as np
import pytest

from shockgrid.runs.store.reader import RunData

DECK = """
problem = "interface-instability"
mach = 2
lengths = [2, 2]
cells = 16
gap = 0.8
modes = [{ka0 = 0.5}]
[run]
t_end = 0.6
[regrid]
options = {family = "auto"}
[output]
dumps = 10
[[gauge]]
name = "wall"
at = [0.3, 0.0]
fields = ["p", "e", "c"]
[[gauge]]
name = "line"
at = [-0.55, 0.25]
to = [0.3, 0.2]
count = 4
moves = true
[[gauge]]
name = "far"
at = [9.0, 0.0]
"""


@pytest.fixture
def deck(toy) -> str:
    (toy / "gauges.toml").write_text(DECK)
    return "gauges.toml"


def read_table(name: str) -> bytes:
    return Path(name, "gauges.csv").read_bytes()


def test_a_restart_writes_the_same_bits(shockgrid, deck):
    code, text, error = shockgrid("run", deck, "-o", "whole")
    assert code == 0, error
    rows = len(RunData("whole").history["step"])
    assert f"6 gauges in gauges.csv; outside of all blocks: far in {rows} of {rows} rows" in text
    middle = rows // 2
    shockgrid("run", deck, "-o", "halves", "-q", "--set", f"run.max_steps={middle}")
    assert len(RunData("halves").gauges["step"]) == middle + 1
    with open("halves/gauges.csv", "a") as file:
        file.write("99,1.0,torn")
    code, _, error = shockgrid("restart", "halves", "-q", "--set", "run.max_steps=9999")
    assert code == 0, error
    assert read_table("halves") == read_table("whole")


def test_gauges_leave_the_flow_as_it_is_and_feel_its_shock(shockgrid, deck, toy):
    shockgrid("run", deck, "-o", "with", "-q")
    Path("without.toml").write_text(DECK.partition("[[gauge]]")[0])
    shockgrid("run", "without.toml", "-o", "without", "-q")
    code, text, _ = shockgrid("compare", "with", "without")
    assert code == 0, text
    assert not Path("without/gauges.csv").exists()
    table = RunData("with").gauges
    problem = RunData("with").problem
    # the shock passes line_1 with its own pressure, and carries it at the speed of the material
    behind = (table["line_1_p"] > 0.99 * problem.shock.p) & (table["t"] < problem.arrival)
    assert behind.sum() > 5 and table["line_1_p"][0] == pytest.approx(1.0, rel=1e-3)
    speed = np.diff(table["line_1_x"][behind]) / np.diff(table["t"][behind])
    assert speed == pytest.approx(problem.shock.particle_speed, rel=0.02)
    # a gauge that stays sees the interface come past, one that moves stays with its material
    assert table["wall_block"][0] == "second" and set(table["line_4_block"]) == {"second"}
    assert set(table["line_1_block"]) == {"first"}


def test_killed_it_goes_on_to_the_same_table(shockgrid, spawn, deck, toy):
    shockgrid("run", deck, "-o", "whole", "-q")
    process = spawn("run", deck, "-o", "killed", "-q", "--set=output.restart_every=0.02")
    while process.poll() is None and len(list(toy.glob("killed/dumps/dump_*.h5"))) < 4:
        time.sleep(0.002)
    process.kill()
    assert process.wait() in (0, -signal.SIGKILL)  # 0: it was through before it was killed
    assert shockgrid("restart", "killed", "-q")[0] == 0
    assert read_table("killed") == read_table("whole")
