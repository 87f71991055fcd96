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
    assert "i_m" in said and "have met outside of 'plate'" in said


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
    assert "block 'gas' is pinched off" in said and "j_min" in said


@pytest.mark.parametrize(
    "material, said", [("gas", "come to its seam"), ("air", "is a thin layer")]
)
def test_a_line_that_comes_to_a_seam_cuts_no_material(material, said):
    film = lay(lambda x: 0.0 * x, lambda x: 0.001 + (x - 0.5) ** 2)
    below = lay(lambda x: -1.0 + 0.0 * x, lambda x: 0.0 * x, name="below")
    film.material, below.material = "gas", material
    told = describe_event([film, below], Place("gas", (20, 1)))
    assert said in told
    if material == "gas":
        assert told.startswith("side j_max of block 'gas' has come to its seam with 'below'")
