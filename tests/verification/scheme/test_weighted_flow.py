"""Grids that follow the flow: sharper shocks, nothing lost, one-dimensional flow stays so."""

import msgspec
import numpy as np
import pytest

from builders import check_restarts, march
from shockgrid.problems.interface_instability.deck import InterfaceDeck
from shockgrid.problems.interface_instability.problem import InterfaceInstability

WEIGHTED = ("brackbill-saltzman", "equidistribution", "node-speed")
WEIGHT = "sides*(1 + 5*|grad(rho)|/max)"


def build(name, ka0=0.0, boundary="equidistributed", weight=WEIGHT, sides="wall", threads=1):
    table = {
        "cells": 16,
        "start": "incident",
        "gap": 0.25,
        "lengths": (1.0, 1.0),
        "modes": [{"ka0": ka0}],
        "sides": sides,
        "width": 1.0 if sides == "periodic" else 0.5,
        "run": {"t_end": 0.5, "threads": threads},
        "regrid": {"name": name, "weight": weight, "options": {"boundary": boundary}},
    }
    return InterfaceInstability(msgspec.convert(table, InterfaceDeck)).build()


def measure_transverse(simulation):
    return max(float(np.abs(block.cell_fields["v"]).max()) for block in simulation.blocks)


@pytest.mark.parametrize("name", ["brackbill-saltzman", "node-speed"])
def test_cells_gather_at_the_shock_and_sides_that_follow_keep_it_plane(name):
    """A flat interface: all but the grid is one-dimensional."""
    transverse = []
    for boundary in ("given", "equidistributed"):
        simulation = build(name, boundary=boundary)
        while simulation.t < 0.35:
            simulation.advance()
        block = simulation.blocks[1]
        steps = np.diff(block.nodes[0], axis=0)[:, 4]
        shock = int(np.abs(np.diff(block.cell_fields["rho"][:, 4])).argmax())
        assert steps[shock : shock + 2].mean() < 0.6 / 16 and steps.max() > 0.8 / 16
        transverse.append(measure_transverse(simulation))
    speed = np.abs(simulation.blocks[1].cell_fields["u"]).max()
    assert transverse[1] < 0.02 * speed and transverse[1] < 0.15 * transverse[0], transverse


@pytest.mark.parametrize("name", WEIGHTED)
def test_nothing_is_lost_on_grids_that_follow_the_flow(name):
    """Masses to round-off while the sides' nodes are placed anew in each step."""
    simulation = build(name, ka0=0.2)
    rows = march(simulation, 40)
    for material in ("first", "second"):
        mass = np.array([row[f"total_mass_{material}"] for row in rows])
        assert np.ptp(mass) < 2e-15 * 40**0.5 * mass[0]
    for block in simulation.blocks:
        walls = block.nodes[1][:, [0, -1]]
        assert np.ptp(walls, axis=0).max() == 0.0, "nodes stay on the walls"


@pytest.mark.parametrize("name", WEIGHTED)
def test_a_restart_has_the_same_bits(name):
    check_restarts(lambda: build(name, ka0=0.2), [12], steps=12)
