"""Laws of strength: what they give, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shockgrid.hydro.eos.materials import LIBRARY, choose_strength, make_material, read_materials
from shockgrid.hydro.strength.laws import (
    STRENGTH_LAWS,
    JohnsonCook,
    LinearHardening,
    Perfect,
    SteinbergCochranGuinan,
    ZerilliArmstrongBCC,
    ZerilliArmstrongFCC,
)
from shockgrid.regrid.errors import BadInput
from shockgrid.testing import check_strength

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


LAWS = {
    "perfect": Perfect(27.6e9, 0.3e9),
    "linear-hardening": LinearHardening(43.3e9, 0.4e9, 0.1e9),
    "johnson-cook": JohnsonCook(80e9, 792e6, 510e6, 0.26, 0.014, 1.03, 1793.0),
    "steinberg-cochran-guinan": SteinbergCochranGuinan(
        27.6e9, 0.29e9, 0.68e9, 125.0, 0.1, 65.2e-12, 6.16e-4, 1220.0, 1.5, 1.97, 2703.0
    ),
    "zerilli-armstrong-fcc": ZerilliArmstrongFCC(47.7e9, 65e6, 890e6, 2.8e-3, 1.15e-4),
    "zerilli-armstrong-bcc": ZerilliArmstrongBCC(80e9, 50e6, 1.8e9, 1.5e-3, 4.5e-5, 1.2e9, 0.62),
}


def evaluate(law, strain, rate, density, pressure, temperature):
    """Flow stress of one state, as of an array of one cell."""
    state = (np.array([one]) for one in (strain, rate, density, pressure, temperature))
    return float(law.flow_stress(*state)[0])


def test_all_laws_are_tried_here_and_keep_the_promises():
    assert set(LAWS) == set(STRENGTH_LAWS)
    for law in LAWS.values():
        check_strength(law)


def test_linear_hardening():
    law = LAWS["linear-hardening"]
    assert evaluate(law, 0.5, 0.0, 8930.0, 0.0, 300.0) == pytest.approx(0.45e9)
    assert (
        law
        == make(
            strength_law={
                "law": "linear-hardening",
                "shear_modulus": 43.3e9,
                "yield_strength": 0.4e9,
                "hardening": 0.1e9,
            }
        ).strength
    )


def test_johnson_cook_of_4340():
    law = LAWS["johnson-cook"]
    # evaluated apart from the code, at 1e4 1/s and 600 K
    assert evaluate(law, 0.3, 1e4, 7830.0, 0.0, 600.0) == pytest.approx(1058481458.7, rel=1e-10)
    # slow loading at the reference temperature, molten
    assert evaluate(law, 0.0, 1e-6, 7830.0, 0.0, 293.0) == pytest.approx(792e6)
    assert evaluate(law, 1.0, 1.0, 7830.0, 0.0, 200.0) == pytest.approx(1302e6)
    assert evaluate(law, 1.0, 1e6, 7830.0, 0.0, 1793.0) == 0.0
    with pytest.raises(BadInput, match="must be above reference_temperature"):
        JohnsonCook(80e9, 792e6, 510e6, 0.26, 0.014, 1.03, 293.0)


@pytest.mark.parametrize(
    "density, pressure, temperature, strain, shear_modulus, flow_stress",
    [
        (3000.0, 15e9, 700.0, 0.2, 46.87027060726262e9, 0.6821560128645598e9),
        (2703.0, 0.0, 300.0, 0.0, 27.6e9, 0.29e9),
        (2703.0, 0.0, 300.0, 30.0, 27.6e9, 0.6604085759722659e9),
        (2703.0, 0.0, 300.0, 60.0, 27.6e9, 0.68e9),  # the greatest
        (2703.0, 0.0, 1221.0, 0.1, 0.0, 0.0),  # molten
        (3000.0, 15e9, 1300.0, 0.1, 36.66931060726261e9, 0.4998331290396886e9),
    ],
)
def test_steinberg_of_aluminium(density, pressure, temperature, strain, shear_modulus, flow_stress):
    # evaluated apart from the code; the melting temperature at 3000 kg/m3 is 1689.35 K
    law = LAWS["steinberg-cochran-guinan"]
    state = (np.array([one]) for one in (density, pressure, temperature))
    assert float(law.shear_modulus(*state)[0]) == pytest.approx(shear_modulus, rel=1e-12)
    found = evaluate(law, strain, 1e6, density, pressure, temperature)
    assert found == pytest.approx(flow_stress, rel=1e-12)
    assert float(law.melting_point(3000.0)) == pytest.approx(1689.3534209717404, rel=1e-12)


def test_zerilli_armstrong():
    # evaluated apart from the code: copper at 5000 1/s and 350 K, a steel at 1000 1/s and 300 K
    found = evaluate(LAWS["zerilli-armstrong-fcc"], 0.25, 5e3, 8930.0, 0.0, 350.0)
    assert found == pytest.approx(300307062.02, rel=1e-10)
    found = evaluate(LAWS["zerilli-armstrong-bcc"], 0.1, 1e3, 7830.0, 0.0, 300.0)
    assert found == pytest.approx(1597771300.06, rel=1e-10)
    # without thermal activation
    cold = evaluate(LAWS["zerilli-armstrong-bcc"], 0.0, 1e3, 7830.0, 0.0, 0.0)
    assert cold == pytest.approx(1.85e9)


def test_a_material_may_have_several_laws():
    two = make(
        strength_law=[
            PERFECT,
            {"law": "linear-hardening", "hardening": 1e8}
            | {key: value for key, value in PERFECT.items() if key != "law"},
        ]
    )
    assert [law.kind for law in two.strengths] == ["perfect", "linear-hardening"]
    assert choose_strength("a deck", two, True) is two.strength is two.strengths[0]
    assert choose_strength("a deck", two, "linear-hardening") is two.strengths[1]
    assert choose_strength("a deck", two, None) is choose_strength("a deck", two, False) is None
    assert choose_strength("a deck", make(), PERFECT) == Perfect(27.6e9, 0.3e9)
    with pytest.raises(BadInput, match=r"a deck: .* \(it has perfect, linear-hardening\)"):
        choose_strength("a deck", two, "johnson-cook")
    with pytest.raises(BadInput, match=r"a deck: .* \(it has none\)"):
        choose_strength("a deck", make(), True)


def test_laws_of_the_library_keep_the_promises_and_say_their_source():
    materials = read_materials(LIBRARY)
    for material in materials.values():
        for law, source in zip(material.strengths, material.strength_sources, strict=True):
            check_strength(law, material.rho0)
            assert len(source) > 40
    solids = {name for name, material in materials.items() if material.strength}
    asked = "Al1100 Al2024 Al6061 Al7075 Cu steel-4340 SS304 Ta W Be Pb Ti Ni Sn U"
    assert solids >= set(asked.split())
    # misprints of public libraries
    assert materials["Al1100"].strength.yield_strength == 0.04e9
    assert materials["Be"].strength.melting_temperature == 1820.0
    assert materials["Ti"].strength.modulus == 43.4e9
    assert materials["Al6061"].strength.pressure_slope == 65.2e-12
