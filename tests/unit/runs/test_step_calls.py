"""A step is arrays and kernels: how often Python calls something in one is counted, not timed."""

from __future__ import annotations

from runs.bench.steps import count_calls, make_step

# calls in a step of two blocks; among them the test for crossings of each, the flux along the
# contact in its thickness for each, the contact's decay of short waves and its spacing by turning
MOST_KERNELS = 72
# Python functions and builtins; among them those of the contact's thickness, and the columns of its
# roughness and turns
MOST_OTHERS = 625


def test_a_step_of_two_blocks_makes_few_calls():
    calls = count_calls(make_step(("cells=16",)))
    assert 0 < calls.kernels <= MOST_KERNELS
    assert 0 < calls.others <= MOST_OTHERS
    assert 0.0 < calls.seconds < 1.0


def test_calls_do_not_grow_with_cells():
    few, many = (count_calls(make_step((f"cells={n}",))) for n in (16, 32))
    assert (few.kernels, few.others) == (many.kernels, many.others)
