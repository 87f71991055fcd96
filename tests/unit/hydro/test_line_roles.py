"""Roles of lines: what a line is beside decides how its nodes are spread."""

import numpy as np
import pytest

from builders import box, wall_off
from shockgrid.hydro import phases
from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import StiffenedGas
from shockgrid.hydro.motion.line import ROLES, FlowLine, LineRule, Role, StepTime, TrackLine

RULE = LineRule(relax=0.05)
ENDS = (0, -1)


def make_line(cls, kind):
    """A line of 8 faces whose nodes are to be closer at its start, and its block."""
    block = Block("body", StiffenedGas(4.0, 1.0), box((0.0, 0.0), (1.0, 1.0), (8, 3)), 1.0, 0, 0, 0)
    put(block, "j_max", kind)
    wall_off(block, "i_min", "i_max", "j_min")
    line = cls(next(s for s in block.segments if s.side == "j_max"), RULE)
    line.set_spacing(line.spacing**1.5)
    return line, block


def move(line, block):
    """How far its nodes have come to their spacing in a full step at rest, 0 to 1."""
    phases.gather(block)  # the faces' normals
    block.rim.c[:] = 1.0
    block.nodes_new[...] = block.nodes
    first = block.nodes[0, :, -1].copy()
    line.move(StepTime(0.0, 1e3, 1.0))
    if line.role is Role.AT_CONTACT:  # it may have been cut in between
        line.settle(1.0)
    moved = block.nodes_new[0, :, -1]
    assert np.array_equal(moved[[*ENDS]], first[[*ENDS]])
    return float(np.abs(moved - first).max() / np.abs(line.spacing - first).max())


def test_a_line_that_flows_goes_to_its_spacing_a_little():
    assert move(*make_line(FlowLine, "free-surface")) == pytest.approx(RULE.relax, rel=0.1)


def test_a_line_at_a_contact_point_goes_further():
    line, block = make_line(FlowLine, "free-surface")
    line.role = Role.AT_CONTACT
    assert move(line, block) == pytest.approx(ROLES[Role.AT_CONTACT].relax, rel=0.1)


def test_what_a_line_is_at_a_contact_point_stays():
    line, _ = make_line(FlowLine, "free-surface")
    assert line.may_lie_on_body
    line.lie_on_body()
    assert line.role is Role.ON_BODY
    line.role = Role.AT_CONTACT
    assert not line.may_lie_on_body
    line.lie_opposite()
    assert line.role is Role.AT_CONTACT
    wall, _ = make_line(TrackLine, "wall")
    assert not wall.may_lie_on_body
    wall.lie_opposite()
    assert wall.role is Role.OPPOSITE
