"""A regridder of a user's own is held to its word: the sides, the shape, what it returns."""

from dataclasses import replace

import pytest

from builders import box, wall_off
from hydro.block import Block
from hydro.boundary import put
from hydro.eos import IdealGas
from hydro.simulation import Simulation
from regrid.algebraic import TransfiniteRegridder
from regrid.errors import BadInput


class Changed(TransfiniteRegridder):
    """Transfinite interpolation; `change` then changes what it returns, or its boundary."""

    def __init__(self, change):
        super().__init__()
        self.change = change

    def regrid(self, previous, boundary):
        return self.change(super().regrid(previous, boundary), boundary)


def stretch(result, boundary):
    result.nodes[0] *= 1.05
    return result


def move_one(result, boundary):
    result.nodes[1, 3, -1] += 2.0**-40
    return result


def write_boundary(result, boundary):
    for nodes in (result.nodes, boundary):
        nodes[1, :, -1] += 0.25
    return result


CHANGES = {
    stretch: "side i_max: it returned other nodes than it was given, up to 0.05 m away",
    move_one: "side j_max: it returned other nodes than it was given, up to 9.09e-13 m away",
    write_boundary: "side i_min: it returned other nodes than it was given, up to 0.25 m away",
    lambda result, _: result.nodes: "it returned ndarray; a RegridResult of nodes and a report",
    lambda result, _: None: "it returned NoneType; a RegridResult",
    lambda result, _: replace(result, nodes=result.nodes[:, 1:]): r"it returned nodes \(2, 6, 5\)",
}


def make_flow(regridder):
    block = Block("gas", IdealGas(1.4), box((0, 0), (1, 1), (6, 4)), 1.0, 0.0, 0.0, 1.0)
    put(block, "i_min", "piston", velocity=(0.1, 0.0))
    wall_off(block, "i_max", "j_min", "j_max")
    return Simulation([block], [], t_end=1.0, make_regridder=regridder)


@pytest.mark.parametrize("change", CHANGES)
def test_a_flow_does_not_believe_other_sides(change):
    flow = make_flow(lambda: Changed(change))
    with pytest.raises(BadInput, match=f"regridder Changed: block 'gas'[,:] {CHANGES[change]}"):
        flow.advance()
