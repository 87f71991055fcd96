"""Kernels' entries get what they were compiled for: numba does not look at their arguments."""

import gc

import numba
import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

from builders import two_blocks, wall_off
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import IdealGas, MieGruneisen
from shockgrid.hydro.motion.line import LineRule
from shockgrid.hydro.simulation import Simulation
from shockgrid.regrid.registry import make_regridder


def check_entries(monkeypatch) -> set[str]:
    """From now on every entry compares the types of its arguments with those of its kernel."""
    seen: set[str] = set()

    def check(kernel):
        signature = kernel.signatures[0]
        entry = kernel.entry

        def checked(*arguments):
            given = tuple(numba.typeof(value) for value in arguments)
            for wanted, found in zip(signature, given, strict=True):
                same = wanted == found or (str(wanted), str(found)) == ("float64", "int64")
                assert same, f"{kernel.__name__}: {found} for {wanted}"
            seen.add(kernel.__name__)
            return entry(*arguments)

        monkeypatch.setattr(kernel, "entry", checked)

    # by `type`, since some objects cannot say what they are an instance of
    kernels = [one for one in gc.get_objects() if issubclass(type(one), Dispatcher)]
    for kernel in kernels:
        if getattr(kernel, "entry", kernel) is not kernel:
            check(kernel)
    return seen


def make_flow(eos, rho, p, speed, **options):
    """Two blocks whose interface moves; a grid that has to be rebuilt, lines j = const first."""
    states = 2 * [(rho, 0.0, 0.0, p)]
    blocks, links = two_blocks(lambda y: 0.1 * np.sin(6.28 * y), (6, 12), (eos, eos), states)
    put(blocks[0], "i_min", "piston", velocity=(speed, 0.0))
    for block in blocks:
        wall_off(block)
    return Simulation(blocks, links, t_end=1e9, **options)


@pytest.mark.kernels
def test_entries_get_the_types_they_were_compiled_for(monkeypatch):
    whole = MieGruneisen(2707, 5000, 2, 2)  # numbers without a point, as in a deck
    for eos, rho, p, speed in ((IdealGas(1.4), 1.0, 1.0, 0.5), (whole, 2707.0, 1e9, 300.0)):
        make_flow(eos, rho, p, speed).advance()
    seen = check_entries(monkeypatch)
    rough = {"tolerance": 0, "floor": 0}  # every step is solved
    for eos, rho, p, speed in (
        (whole, 2707, 1_000_000_000, 300),
        (MieGruneisen(), 2707.0, 1e9, 300.0),
        (IdealGas(2), 1, 1, 1),
    ):
        flow = make_flow(
            eos, rho, p, speed, line_rule=LineRule(thickness=0),
            make_regridder=lambda: make_regridder("barrier", **rough),
        )  # fmt: skip
        for _ in range(4):
            flow.advance()
    assert {"advance", "check_residual", "prepare", "solve_link", "predict_sides"} <= seen


def test_a_limiting_rate_is_that_of_any_layout():
    regridder = make_regridder("barrier")
    x, y = np.meshgrid(np.linspace(0, 1, 9), np.linspace(0, 2, 6), indexing="ij")
    boundary = np.array([x, y])
    sound = 1.0 + np.add.outer(np.arange(8.0), np.arange(5.0))
    rate = regridder.compute_limiting_rate(boundary, sound)
    strided = np.repeat(boundary, 2, axis=2)[:, :, ::2]
    assert regridder.compute_limiting_rate(strided, np.asfortranarray(sound)) == rate
    assert regridder.compute_limiting_rate(boundary, sound.astype(np.int64)) == rate
