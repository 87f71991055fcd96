"""What installed packages bring by entry points: found, listed with their origin, run, refused."""

import numpy as np
import pytest

from shockgrid.hydro.boundary import make_segment
from shockgrid.hydro.eos import EQUATIONS_OF_STATE
from shockgrid.problems.registry import PROBLEMS
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.plug_ins import find_plug_ins
from shockgrid.regrid.registry import make_regridder
from shockgrid.runs.store.reader import RunData

MODULE = '''
"""A gas, a regridder, an outlet and a column of somebody else."""

from shockgrid.hydro.boundary import Outflow
from shockgrid.hydro.eos.gases import IdealGas
from shockgrid.regrid.algebraic import TransfiniteRegridder
from toy_problem import Toy


class Helium(IdealGas):
    kind = "helium"


class Straight(TransfiniteRegridder):
    """Transfinite interpolation under another name."""


class Outlet(Outflow):
    kind = "outlet"


class FarToy(Toy):
    pass


def compute_cells(flow):
    return {"cells": sum(block.ni * block.nj for block in flow.blocks)}


number = 3
'''
ENTRIES = """
[shockgrid.problems]
far-toy = somebody:FarToy
riemann = somebody:FarToy
[shockgrid.eos]
helium = somebody:Helium
[shockgrid.regridders]
straight = somebody:Straight
lost = nobody_has_this:Thing
number = somebody:number
[shockgrid.boundaries]
outlet = somebody:Outlet
[shockgrid.columns]
cells = somebody:compute_cells
"""


def install(folder, name, version, entries):
    info = folder / f"{name}-{version}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
    (info / "entry_points.txt").write_text(entries)


@pytest.fixture
def somebody(tmp_path_factory, monkeypatch):
    """The distribution somebody 1.2 on Python's path; nothing of it stays."""
    folder = tmp_path_factory.mktemp("site")
    (folder / "somebody.py").write_text(MODULE)
    install(folder, "somebody", "1.2", ENTRIES)
    monkeypatch.syspath_prepend(folder)
    find_plug_ins.cache_clear()
    yield folder
    find_plug_ins.cache_clear()


def test_list_names_them_with_their_origin(somebody, shockgrid):
    code, text, _ = shockgrid("list")
    assert code == 0
    lines = {line.split()[0]: line for line in text.partition("from other packages")[2].split("\n")
             if line.strip()}  # fmt: skip
    assert "problem of somebody 1.2" in lines["far-toy"]
    assert "not used: shockgrid has this name" in lines["riemann"]
    assert "regridder of somebody 1.2" in lines["straight"]
    assert "group of history columns of somebody 1.2" in lines["cells"]
    assert "boundary kind of somebody 1.2" in lines["outlet"]
    assert shockgrid("list", "far-toy")[1].rstrip().endswith("of the package somebody 1.2")


def test_a_deck_runs_a_problem_of_somebody_else(somebody, shockgrid):
    assert "far-toy" in PROBLEMS
    code, text, _ = shockgrid("run", "far-toy", "--set", "run.max_steps=3", "-o", "far", "-q")
    assert code == 0, text
    assert RunData("far").problem_name == "far-toy"
    code, text, _ = shockgrid("schema", "far-toy")
    assert code == 0 and '"const": "far-toy"' in text


def test_materials_regridders_and_sides_take_their_names(somebody, tmp_path):
    from shockgrid.hydro.block import Block
    from shockgrid.hydro.eos.materials import find_material

    (tmp_path / "own.toml").write_text(
        '[he]\neos = "helium"\ngamma = 1.67\nrho0 = 0.17\nsource = "a table"\n'
    )
    helium = find_material(f"{tmp_path / 'own.toml'}:he").eos
    assert (type(helium).__name__, helium.gamma) == ("Helium", 1.67)
    nodes = np.array(np.meshgrid(np.arange(5.0), np.arange(4.0), indexing="ij"))
    assert np.array_equal(make_regridder("straight").regrid(nodes, nodes).nodes, nodes)
    gas = Block("gas", EQUATIONS_OF_STATE["ideal-gas"](1.4), nodes, 1.0, 0.0, 0.0, 1.0)
    assert make_segment("outlet", gas, "i_min", 0, 3, {}).kind == "outlet"


def test_one_that_cannot_be_imported_is_a_sentence_and_the_others_work(somebody, shockgrid):
    with pytest.raises(BadInput, match=r"'lost' of the package somebody 1.2 cannot be imported"):
        make_regridder("lost")
    with pytest.raises(BadInput, match="neither a class nor a function"):
        make_regridder("number")
    assert make_regridder("straight")
    code, text, _ = shockgrid("grid", "list")
    assert code == 0 and "  straight" in text and "lost" not in text
