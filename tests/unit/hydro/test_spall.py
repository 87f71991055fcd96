"""Laws of spall: what they give, against numbers evaluated apart from the code."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest

from builders import box, march, wall_off
from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import MieGruneisen
from shockgrid.hydro.simulation import Simulation
from shockgrid.hydro.strength.laws import Perfect
from shockgrid.hydro.strength.spall import (
    SPALL_LAWS,
    CochranBanner,
    ConstantSpall,
    DuctileVoids,
    JohnsonCookDamage,
    SolidCells,
)
from shockgrid.hydro.strength.spall.base import compute_greatest_tension
from shockgrid.regrid.errors import BadInput
from shockgrid.testing import check_spall

COPPER = MieGruneisen(8930.0, 3940.0, 1.489, 1.99, 1e10)
LAWS = {
    "constant": ConstantSpall(1.2e9),
    "cochran-banner": CochranBanner(1.2e9, 2e-5),
    "johnson-1981": DuctileVoids(0.16e9, 1.0),
    "johnson-cook": JohnsonCookDamage(0.54, 4.89, -3.03, 0.014, 1.12, 1356.0),
}


def make_cells(pressures, stress=(0.0, 0.0, 0.0), strained=0.0, extent=1e-5):
    """Copper at these whole pressures [Pa], of the density where e = 0."""
    p = np.asarray(pressures, float)
    rho = COPPER.rho0 / (1.0 - p / (COPPER.rho0 * COPPER.c0**2))
    e = COPPER.energy(rho, p)
    full = np.ones(p.shape)
    return SolidCells(
        COPPER,
        rho,
        p,
        e,
        COPPER.c0 * full,
        np.array([one * full for one in stress]),
        strained * full,
        1e4 * full,
        600.0 * full,
        extent * full,
    )


def make_values(law, cells):
    return np.zeros((len(law.fields), *cells.density.shape))


@pytest.mark.parametrize("kind", SPALL_LAWS)
def test_compression_is_left_alone_and_tension_is_never_raised(kind):
    law = LAWS[kind]
    assert pickle.loads(pickle.dumps(law)) == law
    cells = make_cells([1e9, 1e6, -1e7, -5e8, -3e9])
    values = make_values(law, cells)
    found = law.relax(values, cells, 1e-9)
    assert np.array_equal(found[:2], cells.pressure[:2])
    assert np.all(found >= cells.pressure)
    assert np.all(found[2:] <= 0.0)
    assert not law.find_broken(values)[0]


@pytest.mark.parametrize("kind", SPALL_LAWS)
def test_laws_pass_their_checks(kind):
    check_spall(LAWS[kind])


class Spoiled(ConstantSpall):
    """A law with a mistake."""

    broken = ""

    def relax(self, values, cells, dt):
        if self.broken == "writes":
            cells.strained[:] += 1.0
        found = super().relax(values, cells, dt)
        if self.broken == "shape":
            return found[:1]
        if self.broken == "pulls":
            return np.where(cells.pressure < -1e9, cells.pressure, found)
        if self.broken == "presses":
            return found + 1.0
        if self.broken == "stretches":
            return found - 1.0
        if self.broken == "neighbours":
            places = np.arange(values[0].size).reshape(values[0].shape)
            values[0] += 0.1 * places / places.size
        if self.broken == "heat":
            values[0] += 0.0 if cells.temperature is None else 0.1
        return found


@pytest.mark.parametrize(
    ("broken", "words"),
    [
        ("writes", "relax writes its cells"),
        ("shape", r"relax gives the shape \(1,\) for"),
        ("pulls", "a broken cell bears tension at"),
        ("presses", "relax changes a pressure at a whole pressure of"),
        ("stretches", "relax gives more tension than whole material has at"),
        ("neighbours", "what it does to a cell depends on other cells"),
        ("heat", "it depends on the temperature"),
    ],
)
def test_mistakes_of_laws_are_found(broken, words):
    law = type("Broken", (Spoiled,), {"broken": broken})(1.2e9)
    globals()["Broken"] = type(law)
    type(law).__module__ = __name__
    with pytest.raises(AssertionError, match=f"law of spall constant: {words}"):
        check_spall(law)


def test_constant_counts_the_deviator():
    cells = make_cells([-1.0e9, -1.0e9, -1.3e9], (0.3e9, -0.15e9, 0.0))
    assert compute_greatest_tension(cells) == pytest.approx([1.3e9, 1.3e9, 1.6e9])
    law = ConstantSpall(1.4e9)
    values = make_values(law, cells)
    assert list(law.relax(values, cells, 1e-9)) == [-1.0e9, -1.0e9, 0.0]
    # shear on its own: the principal stresses are +-s_xy
    sheared = make_cells([0.0], (0.0, 0.0, 0.2e9))
    assert compute_greatest_tension(sheared) == pytest.approx([0.2e9])


def test_cochran_and_banner_lose_tension_with_the_width_of_voids():
    law = LAWS["cochran-banner"]
    assert law.find_tension(np.array([0.0, 0.125, 1.0])) == pytest.approx([1.2e9, 0.9e9, 0.0])
    cells = make_cells([-2e9], extent=1e-4)
    values = make_values(law, cells)
    found = law.relax(values, cells, 1e-9)
    opening = 1e-4 * 0.8e9 / (float(cells.density[0]) * 3940.0**2)
    assert values[0, 0] == pytest.approx(opening / 2e-5, rel=1e-12)
    assert found[0] == pytest.approx(-1.2e9 * (1.0 - (opening / 2e-5) ** (2.0 / 3.0)))
    # damage stays when the void has closed
    law.relax(values, make_cells([1e9]), 1e-9)
    assert values[0, 0] == pytest.approx(opening / 2e-5)


def test_ductile_voids_grow_to_the_threshold():
    law = LAWS["johnson-1981"]
    cells = make_cells([-3e9])
    values = make_values(law, cells)
    # first rate: (a0 - 1)^(2/3) a0 (a0 - 1)^(1/3) |F|/viscosity, in a step too short to relax
    law.relax(values, cells, 1e-14)
    threshold = 0.16e9 / 1.0003 * math.log(1.0003 / 0.0003)
    rate = 0.0003 * 1.0003 * (3e9 - threshold)
    assert values[0, 0] == pytest.approx(1e-14 * rate, rel=1e-3)
    # after a long time F is zero
    for _ in range(200):
        p = law.relax(values, cells, 1e-7)
    a = 1.0003 + float(values[0, 0])
    assert -float(p[0]) == pytest.approx(0.16e9 / a * math.log(a / (a - 1.0)), rel=1e-6)
    # under pressure the voids have closed
    law.relax(values, make_cells([1e8]), 1e-9)
    assert values[0, 0] == 0.0


def test_johnson_cook_damage_is_strain_over_strain_at_failure():
    law = LAWS["johnson-cook"]
    # sigma_m/J = 0.5, 1e4 1/s, 600 K, evaluated apart from the code
    hotness = (600.0 - 293.0) / (1356.0 - 293.0)
    allowed = (0.54 + 4.89 * math.exp(-3.03 * 0.5)) * (1.0 + 0.014 * math.log(1e4))
    allowed *= 1.0 + 1.12 * hotness
    s = 0.2e9
    cells = make_cells([-0.5 * math.sqrt(3.0) * s], (0.0, 0.0, s), strained=0.3)
    values = make_values(law, cells)
    law.relax(values, cells, 1e-9)
    assert values[0, 0] == pytest.approx(0.3 / allowed, rel=1e-12)
    for _ in range(20):
        found = law.relax(values, cells, 1e-9)
    assert law.find_broken(values)[0] and found[0] == 0.0


def test_what_makes_no_law_is_refused():
    with pytest.raises(BadInput, match=r"spall law 'johnson-cook': melting_temperature is 200 K"):
        JohnsonCookDamage(0.54, 4.89, -3.03, 0.014, 1.12, 200.0)
    with pytest.raises(BadInput, match=r"stress is -1\.0; it must be positive"):
        ConstantSpall(-1.0)
    with pytest.raises(BadInput, match="width is 'thin'; a number"):
        CochranBanner(1e9, "thin")
    with pytest.raises(BadInput, match="distension0 is 1; it must be above 1"):
        DuctileVoids(1e8, 1.0, 1.0)
    with pytest.raises(BadInput, match="wants a law of strength"):
        Block(
            "bar",
            COPPER,
            box((0, 0), (1, 1), (4, 4)),
            8930.0,
            0.0,
            0.0,
            0.0,
            spall=LAWS["constant"],
        )


@pytest.mark.parametrize("kind", ["constant", "cochran-banner"])
def test_a_bar_that_is_pulled_apart_breaks_and_keeps_its_totals(kind):
    # halves that fly apart at 200 m/s: tension of 3.5 GPa in between
    cells = 48
    u = np.where(np.arange(cells) < cells // 2, -100.0, 100.0)[:, None] * np.ones((1, 2))
    nodes = box((0.0, 0.0), (4.8e-3, 2e-4), (cells, 2))
    law = Perfect(47.7e9, 0.12e9)
    options = {"strength": law, "spall": LAWS[kind]}
    eos = MieGruneisen(8930.0, 3940.0, 1.489, 1.99, 2e9)
    bar = Block("bar", eos, nodes, 8930.0, u, 0.0, 0.0, **options)
    put(bar, "i_min", "free-surface")
    put(bar, "i_max", "free-surface")
    wall_off(bar)
    flow = Simulation([bar], [], t_end=1.5e-6, cfl=0.6)
    first = flow.start_row()
    rows = march(flow)
    last = rows[-1]
    for name in ("total_mass_bar", "total_energy"):
        assert last[name] == pytest.approx(first[name], rel=1e-12)
    assert 1 <= last["broken_cells"] <= 12
    # both halves keep most of their momentum, and the gap bears nothing
    fields = bar.cell_fields
    broken = fields["damage"] >= 0.99
    assert np.all(fields["p"][broken] >= -1.0)
    assert np.all(fields["s_xx"][broken] == 0.0)
    half = (fields["rho"] * bar.volume)[: cells // 2]
    speed = float((half * fields["u"][: cells // 2]).sum() / half.sum())
    assert speed < -45.0
