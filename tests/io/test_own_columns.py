"""History columns of a user's own: in a file named by the deck, or registered."""

from __future__ import annotations

import numpy as np
import pytest

import shockgrid as sg
from shockgrid.hydro.history import REGISTERED

COLUMNS = """
def compute_enthalpy(flow):
    total = 0.0
    for block in flow.blocks:
        fields = block.cell_fields
        energy = block.eos.energy(fields["rho"], fields["p"])
        total += float(((fields["rho"] * energy + fields["p"]) * block.volume).sum())
    return {"enthalpy": total}


compute_enthalpy.units = {"enthalpy": "J/m"}


def count(flow):
    return len(flow.blocks)
"""
DECK = {"cells": 10, "run": {"max_steps": 3}}


@pytest.fixture
def file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "enthalpy.py"
    path.write_text(COLUMNS)
    return path


def test_a_column_of_a_file_is_in_the_history_with_its_unit(file):
    run = sg.run("riemann", "run", output={"columns": ["enthalpy.py:compute_enthalpy"]}, **DECK)
    # at rest the enthalpy of a gas of gamma 1.4 is 1.4 times its energy
    energy = run.history.total_energy[0]
    assert run.history.enthalpy[0] == pytest.approx(1.4 * energy, rel=1e-12)
    assert np.isfinite(run.history.enthalpy).all() and run.history.units["enthalpy"] == "J/m"
    again = sg.restart("run", run={"max_steps": 5})
    assert again.history.enthalpy.size == 6


def test_a_restart_with_an_edited_file_is_refused(file):
    sg.run("riemann", "run", output={"columns": ["enthalpy.py:compute_enthalpy"]}, **DECK)
    file.write_text(COLUMNS + "# edited")
    with pytest.raises(sg.BadInput, match=r"enthalpy\.py has changed"):
        sg.restart("run", run={"max_steps": 5})


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("enthalpy.py:compute_entalpy", "did you mean 'compute_enthalpy'"),
        ("enthalpy.py:count", "count returned int; it must return a dict"),
        ("gone.py:compute", "gone.py does not exist"),
        ("entalpy", "no group of history columns 'entalpy'"),
    ],
)
def test_a_wrong_name_is_refused_before_the_run(file, name, sentence):
    with pytest.raises(sg.BadInput, match=sentence):
        sg.run("riemann", "run", output={"columns": [name]}, **DECK)


class Counter:
    """Something whose method is a group of history columns."""

    def count(self, flow):
        return {"blocks": len(flow.blocks)}


@pytest.mark.parametrize("units", [None, {"blocks": "1"}])
def test_a_bound_method_is_a_group_of_columns(file, monkeypatch, units):
    monkeypatch.setitem(REGISTERED, "method-count", None)  # taken away at the end
    sg.register("method-count", Counter().count, units=units)
    run = sg.run("riemann", "run", output={"columns": ["method-count"]}, **DECK)
    assert run.history.blocks.tolist() == [2] * 4


def test_one_function_under_two_names_has_units_of_its_own_under_each(monkeypatch):
    def measure(flow):
        return {"width": 1.0}

    for name, unit in (("in-metres", "m"), ("in-microns", "um")):
        monkeypatch.setitem(REGISTERED, name, None)
        sg.register(name, measure, units={"width": unit})
    assert REGISTERED["in-metres"].units == {"width": "m"}


def test_a_registered_function_is_a_group_of_columns(file, monkeypatch):
    monkeypatch.setitem(REGISTERED, "block-count", None)  # taken away at the end
    sg.register("block-count", lambda flow: {"blocks": len(flow.blocks)}, units={"blocks": "1"})
    run = sg.run("riemann", "run", output={"columns": ["block-count"]}, **DECK)
    assert run.history.blocks.tolist() == [2] * 4
