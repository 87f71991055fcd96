"""Kernels of two limiters, cached by two processes, stay apart when a third loads both."""

import os
import subprocess
import sys

import pytest

PROGRAM = """
import sys
import numpy as np
from hydro.block import Block
from hydro.eos import IdealGas
from hydro.simulation import Simulation

x, y = np.meshgrid(np.linspace(0, 1, 13), np.linspace(0, 1, 9), indexing="ij")
rho = 1.0 + 0.5 * np.sin(7.0 * x[1:, 1:])
for limiter in sys.argv[1:]:
    block = Block("gas", IdealGas(1.4), np.array([x, y]), rho, 0.3, 0.1, 1.0, limiter=limiter)
    for side in ("i_min", "i_max", "j_min", "j_max"):
        block.put(side, "wall")
    simulation = Simulation([block], [], t_end=1.0, mesh="fixed")
    for _ in range(8):
        simulation.advance()
    print(limiter, block.state[0, 1:-1, 1:-1].sum().hex(), block.state[3, 5, 5].hex())
"""


@pytest.mark.slow
def test_variants_of_a_kernel_are_not_mixed_up(tmp_path):
    def run(*limiters):
        done = subprocess.run(
            [sys.executable, "-W", "ignore", "-c", PROGRAM, *limiters],
            env={**os.environ, "SHOCKGRID_CACHE_DIR": str(tmp_path)},
            capture_output=True,
            text=True,
            check=True,
        )
        return done.stdout.splitlines()

    alone = run("minmod") + run("monotonised-central")
    assert run("minmod", "monotonised-central") == alone
    assert run("monotonised-central", "minmod") == alone[::-1]


def test_closures_are_named_by_what_they_hold():
    from hydro.eos import IdealGas
    from hydro.flow import make_flow_kernels

    names = {
        make_flow_kernels(IdealGas, limiter).advance.py_func.__qualname__
        for limiter in ("minmod", "monotonised-central", "van-leer")
    }
    assert len(names) == 3
