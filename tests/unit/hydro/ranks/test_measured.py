"""Numbers of each whole block for the history: its owner finds them, the block stays."""

from __future__ import annotations

import pytest
from test_ranks import build_two

from hydro.rows import RHO
from thread_ranks import march_on_ranks

STEPS = 4


def find_densest(block) -> list[float]:
    rho = block.state[RHO, 1:-1, 1:-1]
    return [float(rho.max()), float(rho.argmax())]


def build():
    return build_two(measure_block=find_densest, measured_numbers=2)


def march_alone() -> list[list[list[float]]]:
    simulation, found = build(), []
    for _ in range(STEPS):
        simulation.advance()
        found.append(simulation.measured)
    return found


@pytest.mark.parametrize("size", [2, 3])
def test_owners_find_what_one_process_finds_and_keep_their_blocks(size):
    found, whole = [], []

    def look(simulation):
        found.append(simulation.measured)
        whole.append(simulation.motion.blocks.whole)

    march_on_ranks(size, build, STEPS, look)
    assert found == march_alone()
    assert not any(whole), "blocks travelled"


def test_before_the_first_step_and_after_another_state_it_is_of_the_state_at_hand():
    simulation = build()
    start = simulation.get_state()
    assert [densest for densest, _ in simulation.measured] == [1.0, 3.0]
    simulation.advance()
    changed = simulation.measured
    assert changed[0][0] != 1.0 and changed == [find_densest(b) for b in simulation.blocks]
    simulation.set_state(start)
    assert [densest for densest, _ in simulation.measured] == [1.0, 3.0]


def test_without_a_measure_there_is_none():
    assert build_two().measured == []
