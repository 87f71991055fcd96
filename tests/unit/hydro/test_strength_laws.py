"""Laws of strength: what they give, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hydro.eos.materials import make_material
from hydro.strength.laws import STRENGTH_LAWS, Perfect
from regrid.errors import BadInput

ALUMINIUM = {
    "eos": "mie-gruneisen", "source": "a test", "rho0": 2785.0, "c0": 5328.0, "s": 1.338,
    "gruneisen": 2.0, "strength": 1e9,
}  # fmt: skip
PERFECT = {"law": "perfect", "shear_modulus": 27.6e9, "yield_strength": 0.3e9}


def make(**changes):
    return make_material("a material", ALUMINIUM | changes, Path())


def test_perfect_plasticity_is_constant():
    law = make(strength_law=PERFECT).strength
    assert law == Perfect(27.6e9, 0.3e9)
    ones = np.ones((2, 3))
    assert np.all(law.shear_modulus(ones, ones, None) == 27.6e9)
    assert np.all(law.flow_stress(ones, ones, ones, ones, None) == 0.3e9)
    assert np.all(law.hardening(ones, ones, ones, ones, None) == 0.0)
    assert make().strength is None


@pytest.mark.parametrize(
    ("table", "word"),
    [
        (PERFECT | {"yield_strength": -1.0}, "yield_strength is -1.0"),
        (PERFECT | {"shear_modulus": 0.0}, "shear_modulus is 0.0"),
        (PERFECT | {"shear_modulus": "much"}, "shear_modulus is 'much'"),
        (PERFECT | {"hardness": 1.0}, "no parameter 'hardness'"),
        ({"law": "perfect", "shear_modulus": 1e9}, "needs yield_strength"),
        ({"law": "rubber"}, "law is 'rubber'"),
        ("perfect", "a table with law"),
    ],
)
def test_what_makes_no_law_is_refused(table, word):
    with pytest.raises(BadInput, match=word):
        make(strength_law=table)


def test_a_gas_has_no_strength():
    air = {"eos": "ideal-gas", "source": "a test", "rho0": 1.2, "gamma": 1.4}
    with pytest.raises(BadInput, match="is a gas"):
        make_material("air", air | {"strength_law": PERFECT}, Path())


def test_laws_are_registered_by_kind():
    assert all(law.kind == kind for kind, law in STRENGTH_LAWS.items())
