"""Decks that are allowed and hardly meant get a caution with the number; usual ones get none."""

import re

import numpy as np
import pytest

from shockgrid.problems.blocks import Blocks, BlocksDeck, BlockSide, BlockTable, Curves, LinkTable
from shockgrid.problems.deck import RunControl
from shockgrid.problems.interface_instability.deck import Fluid, InterfaceDeck
from shockgrid.problems.interface_instability.line import Mode
from shockgrid.problems.interface_instability.problem import InterfaceInstability
from shockgrid.problems.riemann import Riemann, RiemannDeck
from shockgrid.problems.standard.cavity import Cavity, CavityDeck
from shockgrid.problems.standard.flyer_target import FlyerTarget, FlyerTargetDeck, PlateTable


def make_interface(**deck):
    return InterfaceInstability(InterfaceDeck(**{"cells": 128, **deck}))


def make_bodies(ends="wall", strength=False, **options):
    """Two squares of copper with a gap between them; `ends` are the sides along it."""
    tables = []
    for name, x, inner, outer in (("one", 0.0, "i_max", "i_min"), ("two", 1.1, "i_min", "i_max")):
        curves = Curves(
            i_min=((x, 0.0), (x, 1.0)),
            i_max=((x + 1.0, 0.0), (x + 1.0, 1.0)),
            j_min=((x, 0.0), (x + 1.0, 0.0)),
            j_max=((x, 1.0), (x + 1.0, 1.0)),
        )
        kinds = {inner: "free-surface", outer: "wall"}
        if ends == "wall":
            kinds |= {"j_min": "wall", "j_max": "wall"}
        sides = [
            BlockSide(side=side, kind=kind, options=options if kind == "free-surface" else {})
            for side, kind in kinds.items()
        ]
        table = BlockTable(
            name=name,
            curves=curves,
            material="Cu",
            strength=strength,
            cells=(4, 4),
            side=tuple(sides),
        )
        tables.append(table)
    links = (
        ()
        if ends == "wall"
        else tuple(
            LinkTable(kind="periodic", sides=(f"{name}.j_min", f"{name}.j_max"))
            for name in ("one", "two")
        )
    )
    return Blocks(BlocksDeck(block=tuple(tables), link=links))


METRES = PlateTable(material="Al1100", thickness=1.0, cells=20), PlateTable(gap=1e-4)
STRANGE = {
    "no interface": (lambda: make_interface(second=Fluid(rho=1.0)), "density 1: there is no int"),
    "flat": (lambda: make_interface(modes=[Mode(ka0=0.0)]), "flat"),
    "steep": (lambda: make_interface(modes=[Mode(ka0=5.0)]), "k a0 = 5"),
    "mm": (lambda: FlyerTarget(FlyerTargetDeck(plates=METRES)), r"plates\.0\.thickness is 1 m"),
    "early end": (
        lambda: FlyerTarget(FlyerTargetDeck(run=RunControl(t_end=5e-8))), "before the impact at 1e",
    ),
    "fast flyer": (lambda: FlyerTarget(FlyerTargetDeck(speed=2e4)), r"Al1100 at 13\.3 km/s"),
    "contacts beside periodic sides": (
        lambda: make_bodies("periodic"), "do not go on across periodic sides",
    ),
    "friction": (lambda: make_bodies(friction=0.2), "falls with the size of cells"),
    "weld": (lambda: make_bodies(weld=True), "falls with the size of cells"),
    "fast piston": (lambda: Cavity(CavityDeck(speed=2e4)), "20 km/s"),
}  # fmt: skip
USUAL = {
    "interface": make_interface,
    "same gas, other density": lambda: make_interface(second=Fluid(rho=3.0)),
    "rather steep": lambda: make_interface(modes=[Mode(ka0=1.0)]),
    "flyer": lambda: FlyerTarget(FlyerTargetDeck(speed=3e3)),
    "cavity": lambda: Cavity(CavityDeck()),
    "bodies": make_bodies,
    "friction of solids": lambda: make_bodies(strength=True, friction=0.2),
    "impact at 4 km/s": lambda: Riemann(RiemannDeck(case="al-ss304-4")),
}


@pytest.mark.parametrize("name", STRANGE)
def test_what_is_hardly_meant(name):
    make, words = STRANGE[name]
    assert re.search(words, "\n".join(make().cautions_on()))


@pytest.mark.parametrize("name", USUAL)
def test_usual_decks(name):
    assert USUAL[name]().cautions_on() == []


@pytest.mark.parametrize(
    ("mach", "limiter", "told"),
    [(1.05, "smooth-shear", 1), (1.05, "smooth-low-mach", 0), (1.5, "smooth-shear", 0)],
)
def test_a_wave_that_rolls_up_slowly(mach, limiter, told):
    """At the speed of linear theory, k a0 = 0.5."""
    problem = make_interface(mach=mach, modes=[Mode(ka0=0.5)], limiter=limiter)
    start = 0.5 / problem.k
    speed = abs(problem.linear_growth.get_asymptotic_rate()) * problem.k * start
    t = np.linspace(0.0, 0.4 / speed, 50)
    history = {"t": t, "amplitude": start + speed * t}
    history["amplitude_mode_1"] = history["amplitude"]
    found = [one for one in problem.cautions_on(history) if "slow vort" in one]
    assert len(found) == told


@pytest.mark.parametrize(("cells", "told"), [(48, 1), (128, 0)])
def test_a_mushroom_on_few_cells(cells, told):
    problem = make_interface(cells=cells, modes=[Mode(ka0=0.2)])
    t = np.linspace(0.0, problem.t_end, 50)
    history = {"t": t, "amplitude": np.linspace(0.03, 0.5, 50)}
    history["amplitude_mode_1"] = history["amplitude"]
    found = [one for one in problem.cautions_on(history) if "mushroom" in one]
    assert len(found) == told
    assert all("24 along the line" in one for one in found)
