"""Every family of grids by one word in a deck, with weights, in a march and in a flow."""

import msgspec
import numpy as np
import pytest

from builders import march
from problems.grid_march import GridMarch, GridMarchDeck
from problems.interface_instability.deck import InterfaceDeck
from problems.interface_instability.problem import InterfaceInstability
from regrid.errors import BadInput
from regrid.measure.quality import find_bad_cells
from regrid.registry import REGRIDDERS

WEIGHTED = ("brackbill-saltzman", "equidistribution", "node-speed")


def make_march(**regrid):
    table = {"domain": "dome", "ni": 12, "nj": 10, "regrid": regrid}
    return GridMarch(msgspec.convert(table, GridMarchDeck))


def make_flow(**regrid):
    table = {"cells": 8, "lengths": (1.0, 1.0), "modes": [{"ka0": 0.3}], "regrid": regrid}
    return InterfaceInstability(msgspec.convert(table, InterfaceDeck))


@pytest.mark.parametrize("make", [make_march, make_flow])
@pytest.mark.parametrize("name", sorted(REGRIDDERS))
def test_each_family_runs_by_its_name(name, make):
    evolution = make(name=name).build()
    row = march(evolution, 6)[-1]
    assert row["t"] > 0.0 and row["regrid_least_corner_ratio"] > 0.0
    for block in evolution.blocks:
        assert len(find_bad_cells(block.nodes)) == 0


@pytest.mark.parametrize("boundary", ["given", "equidistributed"])
@pytest.mark.parametrize("name", WEIGHTED)
def test_weights_of_position_and_of_the_flow(name, boundary):
    options = {"boundary": boundary}
    grids = make_march(name=name, weight="1 + 5*y", options=options).build()
    flow = make_flow(
        name=name, weight="sides*(1 + 3*|grad(p)|/max + 0.2*tanh(x))", options=options
    ).build()
    for evolution in (grids, flow):
        plain = (make_march if evolution is grids else make_flow)(name=name).build()
        march(evolution, 4)
        march(plain, 4)
        moved = evolution.blocks[0].nodes - plain.blocks[0].nodes
        assert np.abs(moved[:, 1:-1, 1:-1]).max() > 1e-4, "the weight is felt"
        assert len(find_bad_cells(evolution.blocks[0].nodes)) == 0


@pytest.mark.parametrize(
    ("make", "regrid", "words"),
    [
        (make_march, {"name": "node-speed", "weight": "1 + rho"}, "no 'rho' here"),
        (make_flow, {"name": "node-speed", "weight": "1 + roh"}, "did you mean 'rho'"),
        (make_flow, {"name": "node-speed", "weight": "1 +"}, "can be read"),
        (make_flow, {"name": "winslow", "weight": "1 + x"}, "takes no weight"),
        (make_flow, {"name": "winslo"}, "did you mean 'winslow'"),
        (make_flow, {"name": "node-speed", "options": {"tua": 1.0}}, "did you mean 'tau'"),
        (make_flow, {"name": "node-speed", "options": {"tau": -1.0}}, "positive"),
        (make_march, {"name": "node-speed", "weight": "y - 5"}, r"cell \(0, 0\)"),
    ],
)
def test_mistakes_are_one_sentence(make, regrid, words):
    with pytest.raises(BadInput, match=words) as caught:
        make(**regrid).build().advance()
    assert "\n" not in str(caught.value)
