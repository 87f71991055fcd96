"""Grid lines that come and go in a flow: totals, free streams, restarts, threads, mirror images."""

from typing import ClassVar

import numpy as np

from builders import beside_line, find_unexplained, get_bits, march
from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import IdealGas
from shockgrid.hydro.links import join
from shockgrid.hydro.remap.flow import STEPS_PER_LINE_CHECK, Refinement
from shockgrid.hydro.simulation import Simulation
from shockgrid.problems.deck import RunControl
from shockgrid.problems.interface_instability.deck import InterfaceDeck
from shockgrid.problems.interface_instability.line import Mode
from shockgrid.problems.interface_instability.problem import InterfaceInstability
from shockgrid.regrid.measure.quality import find_bad_cells

GASES = IdealGas(1.4), IdealGas(1.2)


class Planned(Refinement):
    """The changes of a test, by step: columns that are split and lines that go."""

    changes: ClassVar[dict] = {}

    def choose(self, step, lines):
        if step not in self.changes:
            return None
        split, removed = self.changes[step]
        count = next(line.segment.block.nj for line in lines)
        return np.sort(np.append(np.delete(np.arange(count + 1.0), removed), np.add(split, 0.5)))


def make_flow(
    states, changes, front=lambda y: 0.1 * np.cos(np.pi * y), sides="wall", line_rule=None
):
    """Two gases beside a line, walls around them; the changes come after the steps they name."""

    def assemble(grids, inside):
        parts = zip(("left", "right"), GASES, grids, inside, strict=True)
        left, right = blocks = [Block(name, eos, grid, *state) for name, eos, grid, state in parts]
        links = [join("interface", (left, "i_max"), (right, "i_min"))]
        put(left, "i_min", "wall")
        put(right, "i_max", "wall")
        for block in blocks:
            if sides == "wall":
                put(block, "j_min", "wall")
                put(block, "j_max", "wall")
            else:
                links.append(join("periodic", (block, "j_min"), (block, "j_max")))
        return blocks, links, None

    ends_y = (0.0, 1.0) if sides == "wall" else (0.0, 2.0)
    blocks, links, _ = assemble(beside_line(front, (10, 12), ends_y), states)
    refining = Planned(blocks, assemble)
    refining.changes = changes
    return Simulation(blocks, links, t_end=10.0, refining=refining, line_rule=line_rule)


CHANGES = {4: ([0, 5, 11], []), 9: (range(15), []), 14: ([], [1, 3, 8]), 19: ([], [2, 20])}


def test_totals_stay_while_lines_come_and_go():
    push = (1.0, 0.3, 0.1, 1.0), (3.0, -0.2, 0.0, 1.5)
    flow = make_flow(push, CHANGES)
    rows = [flow.start_row() | {"t": 0.0}]
    counts = []
    for _ in range(25):
        rows.append(flow.advance())
        counts.append(flow.blocks[0].nj)
        assert rows[-1]["cells"] == 20 * counts[-1]
        assert all(len(find_bad_cells(block.nodes)) == 0 for block in flow.blocks)
    assert sorted(set(counts)) == [12, 15, 25, 27, 30] and counts[-1] == 25
    for name in ("mass_left", "mass_right", "energy"):
        assert find_unexplained(rows, name) <= 1e-14 * rows[0][f"total_{name}"], name
    assert find_unexplained(rows, "momentum_x") <= 1e-14


def test_a_free_stream_passes():
    stream = (1.0, 0.0, 0.4, 1.0), (3.0, 0.0, 0.4, 1.0)
    flow = make_flow(stream, CHANGES, np.zeros_like, "periodic")
    march(flow, 30)
    for block, rho in zip(flow.blocks, (1.0, 3.0), strict=True):
        wanted = np.reshape([rho, 0.0, 0.4, 1.0], (4, 1, 1))
        assert np.abs(block.state[:, 1:-1, 1:-1] - wanted).max() <= 1e-12


def make_mushroom(sides="wall", threads=1, refine=True, **more):
    width = 0.5 if sides == "wall" else 1.0
    return InterfaceInstability(
        InterfaceDeck(
            run=RunControl(cfl=0.8, threads=threads),
            mach=2.0,
            cells=16,
            modes=[Mode(ka0=0.5)],
            lengths=(2.0, 2.0),
            stretch=1.1,
            sides=sides,
            width=width,
            refine=refine,
            **more,
        )
    ).build()


def march_until_split(flow, most=600):
    count = flow.blocks[0].nj
    while flow.blocks[0].nj == count and flow.step < most:
        flow.advance()
    assert flow.blocks[0].nj > count, "no line came"


def test_a_restart_before_at_and_after_new_lines_gives_the_same_bits():
    flow = make_mushroom()
    march_until_split(flow)
    at = flow.step
    assert at % STEPS_PER_LINE_CHECK == 0
    flow = make_mushroom()
    kept = {}
    while flow.step < at + STEPS_PER_LINE_CHECK + 5:
        flow.advance()
        if flow.step in (at - 3, at - 1, at, at + 1, at + 7):
            kept[flow.step] = flow.get_state()
    for state in kept.values():
        again = make_mushroom()
        again.set_state(state)
        while again.step < flow.step:
            again.advance()
        assert get_bits(flow) == get_bits(again)


def test_threads_do_not_change_a_bit():
    flows = make_mushroom(threads=1), make_mushroom(threads=2)
    for flow in flows:
        march_until_split(flow)
        march(flow, 10)
    assert get_bits(flows[0]) == get_bits(flows[1])


def test_mirror_images_are_split_together():
    flow = make_mushroom("periodic")
    march_until_split(flow)
    assert flow.blocks[0].nj % 2 == 0
    for block in flow.blocks:
        x, y = block.nodes
        assert np.abs(x - x[:, ::-1]).max() <= 1e-9 and np.abs(y + y[:, ::-1] - 1.0).max() <= 1e-9
