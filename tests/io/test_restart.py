"""A run broken off in any way goes on to the same end, bit for bit."""

from __future__ import annotations

import contextlib
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import toy_problem
from processes import wait_for

from shockgrid.runs.store.reader import RunData


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_killed_at_a_random_moment(shockgrid, spawn, toy, seed):
    assert shockgrid("run", "toy", "-o", "whole", "-q", "--set", "pause=0.004")[0] == 0
    process = spawn("run", "toy", "-o", "killed", "-q", "--set", "pause=0.004")
    wait_for(toy / "killed/dumps/dump_000000.h5", process)
    time.sleep(random.Random(seed).uniform(0.0, 0.3))
    process.kill()
    process.wait()
    run = RunData("killed")
    assert all(dump.blocks for dump in run.dumps) and not run.skipped
    for extra in ("info", "restart"):
        code, _, error = shockgrid(extra, "killed", *(["-q"] if extra == "restart" else []))
        assert code == 0, error
    code, text, _ = shockgrid("compare", "whole", "killed")
    assert code == 0, text


STOPPING = {"SIGINT": 130, "SIGTERM": 143, "SIGHUP": 129, "SIGXCPU": 152}
SIGNALS = [
    (getattr(signal, name), code) for name, code in STOPPING.items() if hasattr(signal, name)
]


@pytest.mark.parametrize(("number", "code"), SIGNALS)
def test_signal_leaves_a_restart_point(shockgrid, spawn, toy, number, code):
    words = ("--set", "output.dumps=1")
    process = spawn("run", "toy", "-o", "stopped", *words, "--set", "holds=[4]")
    wait_for(toy / "held-4", process)
    process.send_signal(number)
    Path("go-4").touch()
    output, error = process.communicate()
    assert process.returncode == code, error
    assert "stopped by" in output and "shockgrid restart stopped" in output
    assert RunData("stopped").history["step"][-1] == 5
    assert RunData("stopped").directory.list_points()[-1][0] == 5
    assert shockgrid("restart", "stopped", "-q", *words)[0] == 0
    shockgrid("run", "toy", "-o", "whole", "-q", *words)
    code, text, _ = shockgrid("compare", "whole", "stopped")
    assert code == 0, text
    assert not RunData("stopped").directory.list_points("restart")


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="this system has no SIGHUP")
@pytest.mark.parametrize("ignored", [False, True], ids=["a lost terminal", "nohup"])
def test_a_run_whose_terminal_is_gone(shockgrid, toy, ignored):
    ours, theirs = os.openpty()
    handling = signal.SIG_IGN if ignored else signal.SIG_DFL  # whatever the tests run under
    process = subprocess.Popen(
        [sys.executable, toy_problem.__file__, "run", "toy", "-o", "run", "--set", "holds=[4]"],
        stdin=theirs, stdout=theirs, stderr=theirs,
        preexec_fn=lambda: signal.signal(signal.SIGHUP, handling),
    )  # fmt: skip
    os.close(theirs)
    wait_for(toy / "held-4", process)
    if not ignored:
        os.close(ours)  # whatever is written to the terminal from now on is an error
    process.send_signal(signal.SIGHUP)
    Path("go-4").touch()
    if ignored:
        while process.poll() is None:
            with contextlib.suppress(OSError):
                os.read(ours, 1000)
        os.close(ours)
    assert process.wait() == (0 if ignored else 129)
    stopped = RunData("run").directory.list_points()[-1][0]
    assert stopped > 5 if ignored else stopped == 5
    assert "SIGHUP" in Path("run/run.log").read_text() or ignored


def test_damaged_last_dump_is_skipped(shockgrid):
    shockgrid("run", "toy", "-o", "run", "-q")
    shockgrid("run", "toy", "-o", "whole", "-q")
    points = RunData("run").directory.list_points()
    path = points[-1][1]
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    code, text, _ = shockgrid("info", "run")
    assert code == 2 and f"damaged: {path} is truncated" in text
    code, _, error = shockgrid("restart", "run", "-q")
    assert code == 0 and f"skipped: {path}" in error and "truncated" in error
    assert shockgrid("compare", "whole", "run")[0] == 0


def test_flipped_bits_in_the_state_are_seen(shockgrid):
    shockgrid("run", "toy", "-o", "run", "-q", "--set", "run.max_steps=5")
    path = RunData("run").directory.list_points()[-1][1]
    heat = RunData("run").dumps[-1].state()["left/heat"].tobytes()
    content = path.read_bytes()
    place = content.rindex(heat)  # the state lies behind the blocks
    path.write_bytes(content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :])
    code, _, error = shockgrid("restart", "run", "--at", "5")
    assert code == 2 and f"{path} is truncated or damaged: its checksum is wrong" in error


def test_restart_from_an_earlier_step(shockgrid):
    shockgrid("run", "toy", "-o", "whole", "-q")
    shockgrid("run", "toy", "-o", "back", "-q")
    step = RunData("back").dumps[7].step
    code, _, error = shockgrid("restart", "back", "-q", "--at", str(step))
    assert code == 0 and "superseded" in error
    assert shockgrid("compare", "whole", "back")[0] == 0
    code, _, error = shockgrid("restart", "back", "--at", "1")
    assert code == 2 and "no restart point of step 1; there are: 0, 5" in error
