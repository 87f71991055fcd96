"""Contacts on several ranks of MPI have the bits of one process, through the touch and after it."""

import numpy as np
from plates import make_plate, make_stack

from builders import march
from thread_ranks import march_on_ranks


def build():
    blocks = [
        make_plate("flyer", "Al1100", (0.0, 5e-4), 16, 1000.0, 3),
        make_plate("target", "SS304", (5.1e-4, 2e-3), 24),
    ]
    return make_stack(blocks, 4e-7)


def test_ranks_have_the_same_bits():
    alone = build()
    rows = march(alone, 30)
    assert any(row["dt_limit"] == "touch" for row in rows) and rows[-1]["contact_length"] > 0.0
    found, there = march_on_ranks(2, build, 30)
    for one, other in zip(rows, found, strict=True):
        for name in ("t", "dt_limit", "total_energy", "contacts_made", "contact_length"):
            assert one[name] == other[name]
    state = alone.get_state()
    assert there.keys() == state.keys()
    for name, value in state.items():
        assert np.asarray(value).tobytes() == np.asarray(there[name]).tobytes(), name
