"""The first call of the library: a person is told that it compiles, and can end it."""

import io
import os
import signal
import subprocess
import sys
import time

import pytest

from shockgrid.regrid.compilation import first_calls

CALL = """
import numpy as np
from shockgrid import regrid
line = np.linspace(0.0, 1.0, 13)
nodes = np.array(np.meshgrid(line, line, indexing="ij"))
print("begins", flush=True)
regrid.BarrierRegridder().regrid(nodes, nodes.copy())
"""


@pytest.mark.parametrize("seconds", [0.2, 1.5, 3.0])
def test_an_interrupt_while_compiling_is_one(tmp_path, seconds):
    words = {**os.environ, "SHOCKGRID_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-c", CALL]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, env=words, stdout=pipe, stderr=pipe, text=True) as process:
        assert process.stdout.readline() == "begins\n"
        time.sleep(seconds)
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=120)
    assert said.rstrip().splitlines()[-1] == "KeyboardInterrupt"
    assert process.returncode == -signal.SIGINT


def test_an_interrupt_that_numba_turns_into_an_error_stays_one():
    with pytest.raises(KeyboardInterrupt), first_calls.interrupts_kept():
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            raise RuntimeError("no compiled object yet") from None
    with pytest.raises(KeyboardInterrupt), first_calls.interrupts_kept():
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            pass
    with pytest.raises(RuntimeError, match="its own"), first_calls.interrupts_kept():
        raise RuntimeError("its own")
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.parametrize("terminal", [False, True])
def test_a_terminal_is_told_once_that_kernels_are_compiled(monkeypatch, terminal):
    stream = io.StringIO()
    stream.isatty = lambda: terminal
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(first_calls._compiling, "told", False)
    monkeypatch.setattr(first_calls._compiling, "begun", time.perf_counter() - 1.0)
    monkeypatch.setattr(first_calls._compiling, "seconds", 0.0)
    first_calls._tell()
    assert stream.getvalue() == ""
    monkeypatch.setattr(first_calls._compiling, "seconds", 2.5)
    first_calls._tell()
    first_calls._tell()
    assert stream.getvalue().count("\n") == (1 if terminal else 0)
