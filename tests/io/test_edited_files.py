"""Files that a deck names are edited: a run goes on with the same contents alone, and whatever is
begun after an edit, in a study or a session too, is computed from the new ones."""

from __future__ import annotations

import os
from pathlib import Path

import h5py
import numpy as np
import pytest

import shockgrid as sg
from shockgrid.runs.store.reader import RunData

MATERIALS = """
[gas]
eos = "ideal-gas"
gamma = {gamma}
rho0 = 1.0
source = "made here"
[table]
eos = "tabular"
path = "table.h5"
rho0 = 1.0
source = "made here"
"""
WALLS = "side = [{}]".format(
    ", ".join(
        f'{{ side = "{side}", kind = "wall" }}' for side in ("i_min", "i_max", "j_min", "j_max")
    )
)
SQUARE = """
cells = [8, 6]
curves = { i_min = [[0.0, 0.0], [0.0, 1.0]], i_max = [[1.0, 0.0], [1.0, 1.0]], j_min = [[0.0, 0.0],
[1.0, 0.0]], j_max = TOP }
"""


def write_materials(folder: Path, gamma: float) -> None:
    folder.joinpath("own.toml").write_text(MATERIALS.format(gamma=gamma))


def write_table(folder: Path, gamma: float) -> None:
    rho = np.linspace(0.05, 3.0, 60)
    e = np.linspace(0.5, 30.0, 60)
    with h5py.File(folder / "table.h5", "w") as file:
        file["rho"] = rho
        file["e"] = e
        file["p"] = (gamma - 1.0) * rho[:, None] * e


def write_line(folder: Path, height: float) -> None:
    folder.joinpath("top.txt").write_text(f"0 1\n0.5 {1.0 + 0.1 * height}\n1 1\n")


def write_grid(folder: Path, height: float) -> None:
    x, y = np.meshgrid(np.linspace(0.0, 1.0, 9), np.linspace(0.0, height, 7), indexing="ij")
    np.savez(folder / "grid.npz", x=x, y=y)


def write_wave(folder: Path, height: float) -> None:
    y = np.linspace(0.0, 0.5, 33)
    folder.joinpath("wave.txt").write_text(
        "\n".join(f"{0.01 * height * np.cos(2.0 * np.pi * one)} {one}" for one in y)
    )


def make_block(material: str, shape: str) -> str:
    return f"""
problem = "blocks"
run = {{ t_end = 1.0 }}
[[block]]
name = "a"
material = {material}
rho = 1.0
p = "1 + x"
{WALLS}
{shape}
"""


STRAIGHT = SQUARE.replace("TOP", "[[0.0, 1.0], [1.0, 1.0]]")
TUBE = 'problem = "riemann"\ncells = 20\n'
GAS = "{ gamma = 1.4, rho = 1.0, p = 2.0 }"
# a deck, the file that is edited, and what writes it
NAMED = {
    "material of a block": (make_block('"own.toml:gas"', STRAIGHT), write_materials),
    "table of a block": (make_block('"own.toml:table"', STRAIGHT), write_table),
    "table written in the deck": (
        make_block('{ eos = "tabular", path = "table.h5" }', STRAIGHT),
        write_table,
    ),
    "curve": (make_block('"own.toml:gas"', SQUARE.replace("TOP", '"top.txt"')), write_line),
    "grid": (make_block('"own.toml:gas"', 'grid = "grid.npz"'), write_grid),
    "material of a tube": (
        TUBE + f'left = {{ material = "own.toml:gas", p = 2.0 }}\nright = {GAS}\n',
        write_materials,
    ),
    "material of an interface": (
        'problem = "interface-instability"\ncells = 8\nfirst = { material = "own.toml:gas" }\n',
        write_materials,
    ),
    "line of an interface": (
        'problem = "interface-instability"\ncells = 16\nmodes = []\nline_file = "wave.txt"\n',
        write_wave,
    ),
}
BEFORE = 1.4
AFTER = 1.6


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with all the files; the work is done beside it, so that paths matter."""
    folder = tmp_path / "decks"
    folder.mkdir()
    for write in (write_materials, write_table, write_line, write_grid, write_wave):
        write(folder, BEFORE)
    beside = tmp_path / "beside"
    beside.mkdir()
    monkeypatch.chdir(beside)
    return folder


def compute_sum(run: RunData) -> float:
    """A number that knows all that a deck's files say: of nodes, energies and pressures."""
    blocks = run.dumps[-1].blocks
    return float(sum(block.nodes.sum() + block.e.sum() + block.p.sum() for block in blocks))


@pytest.mark.parametrize("what", NAMED)
def test_a_restart_goes_on_with_the_same_files_alone(folder, shockgrid, what):
    text, write = NAMED[what]
    deck = folder / "deck.toml"
    deck.write_text(text)
    code, _, error = shockgrid("run", str(deck), "-o", "a", "-q", "--set", "run.max_steps=2")
    assert code == 0, error
    kept = {path: path.read_bytes() for path in Path("a").rglob("*") if path.is_file()}
    write(folder, AFTER)
    commands = [("restart", "a"), ("restart", "a", "--cells", "10", "-o", "b")]
    for command in commands[: 1 if '"blocks"' in text else 2]:
        code, _, error = shockgrid(*command, "--set", "run.max_steps=4", "-q")
        assert code == 2 and "has changed" in error, error
    with pytest.raises(sg.BadInput, match="has changed"):
        sg.restart("a", run={"max_steps": 4})
    assert {path: path.read_bytes() for path in kept} == kept and not Path("b").exists()
    code, text, _ = shockgrid("info", "a")
    assert code == 0 and "has changed" in text
    write(folder, BEFORE)
    if what.startswith("material"):  # the same contents written anew
        code, _, error = shockgrid("restart", "a", "--set", "run.max_steps=4", "-q")
        assert code == 0, error
        assert RunData("a").dumps[-1].step == 4


@pytest.mark.parametrize("what", NAMED)
def test_what_begins_after_an_edit_is_of_the_new_contents(folder, shockgrid, what):
    text, write = NAMED[what]
    deck = folder / "deck.toml"
    deck.write_text(text)
    settings = {"run": {"max_steps": 2}}
    first = compute_sum(sg.run(deck, "a", **settings))
    write(folder, AFTER)
    second = compute_sum(sg.run(deck, "b", **settings))
    moved = folder.rename(folder.with_name("elsewhere"))  # a path that no cache has seen
    fresh = compute_sum(sg.run(moved / "deck.toml", "c", **settings))
    assert second == fresh != first


def test_a_study_computes_anew_what_an_edit_concerns(folder, shockgrid):
    deck = folder / "deck.toml"
    deck.write_text(NAMED["table of a block"][0])
    vary = ("--vary", "block.0.rho=1.0,1.1", "--set", "run.max_steps=2")
    study = ("study", str(deck), *vary, "-o", "s", "--jobs", "1")
    assert shockgrid(*study)[0] == 0
    before = {path: compute_sum(RunData(path)) for path in Path("s/runs").iterdir()}
    assert len(before) == 2 and "0 computed now" in shockgrid(*study)[1]
    write_table(folder, AFTER)
    assert "2 computed now" in shockgrid(*study)[1]
    for path, sum_before in before.items():
        assert compute_sum(RunData(path)) != sum_before


def test_a_material_s_file_beside_the_deck_goes_before_one_here(folder, shockgrid):
    deck = folder / "deck.toml"
    deck.write_text(NAMED["material of a tube"][0])
    write_materials(Path(), 1.9)
    run = sg.run(deck, "a", run={"max_steps": 1})
    assert run.deck.left.material == f"{folder / 'own.toml'}:gas"
    os.remove(folder / "own.toml")
    run = sg.run(deck, "b", run={"max_steps": 1})
    assert run.deck.left.material == f"{Path('own.toml').resolve()}:gas"


def test_two_tables_of_one_name_are_two_materials(folder):
    one = sg.Tabular(str(folder / "table.h5"))
    assert one == sg.Tabular(str(folder / "table.h5"))
    write_table(folder, AFTER)
    assert one != sg.Tabular(str(folder / "table.h5"))
