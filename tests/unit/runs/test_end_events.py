"""What happened where a run ended: films, necks and gaps, from the outlines of blocks."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from regrid.errors import Place
from runs.early_end.explain import describe_event


def lay(lower, upper, name="gas", count=9):
    """A block between two lines over x from 0 to 1."""
    x = np.linspace(0.0, 1.0, 41)
    part = np.linspace(0.0, 1.0, count)
    y = lower(x)[:, None] * (1.0 - part) + upper(x)[:, None] * part
    return SimpleNamespace(name=name, nodes=np.array([x[:, None] + 0.0 * y, y]))


def test_a_square_has_no_event():
    assert describe_event([lay(lambda x: 0.0 * x, lambda x: 1.0 + 0.0 * x)], None) == ""


@pytest.mark.parametrize("turn", [0.0, 1.0])
def test_a_line_that_meets_itself(turn):
    angle = np.linspace(0.003, 2.0 * np.pi - 0.003, 41)
    ring = np.array([1.0 - 0.2 * np.cos(angle), 0.2 * np.sin(angle)])
    ring[0] += turn
    outer = np.array([1.0 - 0.9 * np.cos(angle), 0.9 * np.sin(angle)])
    outer[0] += turn
    part = np.linspace(0.0, 1.0, 9)
    nodes = ring[:, :, None] * (1.0 - part) + outer[:, :, None] * part
    said = describe_event([SimpleNamespace(name="plate", nodes=nodes)], None)
    assert "i_m" in said and "of block 'plate'" in said


def test_a_neck_is_pinched_off():
    x = np.concatenate(
        (np.linspace(0, 0.499, 20), np.linspace(0.4995, 0.5005, 4), np.linspace(0.501, 1, 20))
    )
    y = np.where(np.abs(x - 0.5) < 0.001, 0.8, 0.0)
    line = np.array([x, -y])
    upper = np.array([np.linspace(0.0, 1.0, x.size), np.ones(x.size)])
    part = np.linspace(0.0, 1.0, 5)
    nodes = line[:, :, None] * (1.0 - part) + upper[:, :, None] * part
    said = describe_event([SimpleNamespace(name="gas", nodes=nodes)], None)
    assert said.startswith("between two parts of side j_min of block 'gas'")


def test_a_film_between_two_sides():
    film = lay(lambda x: 0.0 * x, lambda x: 0.001 + (x - 0.5) ** 2)
    told = describe_event([film], Place("gas", (20, 1)))
    assert told.startswith("between sides j_max and j_min of block 'gas' 0.001 m are left")
