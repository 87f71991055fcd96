"""Decks of blocks: what they compute, where their files are looked for, what is refused and how."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shockgrid.runs.store.reader import RunData

STREAM = """
problem = "blocks"
mesh = "fixed"
run = {{ t_end = 2e-4, max_steps = 12 }}
[[block]]
name = "left"
rho = 1.2
u = 150.0
v = 20.0
material = {{ eos = "ideal-gas", gamma = 1.4 }}
{left}
side = [
    {{ side = "i_min", kind = "inflow", state = [1.2, 150.0, 20.0, 1e5] }},
    {{ side = "j_min", kind = "inflow", state = [1.2, 150.0, 20.0, 1e5] }},
    {{ side = "j_max", kind = "outflow" }},
]
[[block]]
name = "right"
rho = 1.2
u = 150.0
v = 20.0
material = {{ eos = "ideal-gas", gamma = 1.4 }}
cells = [6, 8]
curves.i_min = "cut.txt"
curves.i_max = {{ x = "0.2 + 0.01*sin(3*pi*s)", y = "0.1*s" }}
curves.j_min = [[0.0, 0.0], [0.2, 0.0]]
curves.j_max = [[0.2, 0.1], [0.0, 0.1]]
side = [
    {{ side = "i_max", kind = "outflow" }},
    {{ side = "j_min", kind = "inflow", state = [1.2, 150.0, 20.0, 1e5] }},
    {{ side = "j_max", kind = "outflow" }},
]
[[link]]
kind = "seam"
sides = ["left.i_max", "right.i_min"]
"""
CURVES = """
cells = [7, 8]
curves.i_min = [[-0.2, 0.0], [-0.2, 0.1]]
curves.i_max = "cut.txt"
curves.j_min = [[-0.2, 0.0], [0.0, 0.0]]
curves.j_max = [[-0.2, 0.1], [0.0, 0.1]]
"""


@pytest.fixture
def stream(tmp_path):
    """A folder with the deck of a uniform stream across a wavy seam, and the seam's curve."""
    folder = tmp_path / "decks"
    folder.mkdir()
    s = np.linspace(0.0, 1.0, 41)
    np.savetxt(folder / "cut.txt", np.transpose([0.02 * np.sin(2 * np.pi * s), 0.1 * s]))
    (folder / "stream.toml").write_text(STREAM.format(left=CURVES))
    return folder


def change(deck: Path, old: str, new: str) -> str:
    text = deck.read_text()
    assert old in text
    deck.write_text(text.replace(old, new))
    return str(deck)


def test_a_uniform_stream_stays_uniform_across_curves_from_files_and_formulas(stream, shockgrid):
    code, _, error = shockgrid("run", str(stream / "stream.toml"), "-o", "a", "-q")
    assert code == 0, error
    last = RunData("a").dumps[-1]
    assert last.step == 12
    for block in last.blocks:
        for name, value in (("rho", 1.2), ("u", 150.0), ("v", 20.0), ("p", 1e5)):
            assert np.abs(block.cell_fields[name] / value - 1.0).max() < 1e-12, (block, name)
    lines = last.blocks[0].nodes[:, -1], last.blocks[1].nodes[:, 0]
    assert np.array_equal(*lines) and np.ptp(lines[0][0]) > 0.03


REFUSED = [  # what the deck has, what stands there instead, what is said
    ('"cut.txt"\ncurves.i_max = {', '[[0.0, 0.0], [0.01, 0.05], [0.0, 0.1]]\ncurves.i_max = {',
     "do not match: the largest gap is 0.0"),
    ("cells = [6, 8]", "cells = [6, 9]", "side i_max, faces 0-8 has 8 faces"),
    ('{ side = "i_max", kind = "outflow" },', "",
     "'right', side i_max: no segment covers the faces 0 to 8"),
    ('sides = ["left.i_max"', 'sides = ["lift.i_max"',
     "there is no block 'lift'; did you mean 'left'?"),
    ('"right.i_min"]', '"right.i_mim"]', "has no side 'i_mim'; known are: i_min"),
    ('"right.i_min"]', '"right.i_min[4:12]"]', "the side has faces 0 to 8"),
    ('"right.i_min"]', '"right"]', 'write "block.i_max"'),
    ('"cut.txt"\ncurves.i_max = {', '"gone.txt"\ncurves.i_max = {', "gone.txt cannot be read"),
    ('kind = "outflow" },\n    { side = "j_min"', 'kind = "outfow" },\n    { side = "j_min"',
     "did you mean 'outflow'?"),
    ('{ side = "i_max", kind = "outflow" }', '{ side = "i_max", kind = "piston" }',
     "velocity=... is missing"),
    ('{ side = "i_max", kind = "outflow" }', '{ side = "i_max", kind = "seam" }',
     'is made by [[link]]'),
    ('{ side = "i_max", kind = "outflow" }', '{ side = "i_max", kind = "wall", pressure = 1.0 }',
     "wall segment: there is no option 'pressure'"),
    ('name = "right"', 'name = "left"', "2 blocks are called 'left'"),
    ('u = 150.0\nv = 20.0\nmaterial = { eos = "ideal-gas", gamma = 1.4 }\ncells',
     'u = "1/(x - x)"\nmaterial = "air"\ncells',
     "block 'right', u '1/(x - x)': it is not a finite number at x ="),
    ('{ eos = "ideal-gas", gamma = 1.4 }\ncells', '"unobtainium"\ncells',
     "block 'right': there is no material"),
    ('x = "0.2 + 0.01*sin(3*pi*s)"', 'x = "0.2 + 0.01*sin(3*pi*t)"', "there is no 't' here"),
    ("[[0.0, 0.0], [0.2, 0.0]]", "[[0.0, 0.0], [0.3, 0.0]]", "must have an end in common"),
    ("[[0.0, 0.0], [0.2, 0.0]]", "{ points = [[0.0, 0.0], [0.2, 0.0]], cells = [5] }",
     "curve j_min has 5 cells in all; the block has 6"),
    ('curves.i_min = "cut.txt"', 'grid = "cut.txt"\ncurves.i_min = "cut.txt"', "give either"),
    ("mesh = \"fixed\"", "mesh = \"frozen\"", 'it must be "fixed" or "regrid"'),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "words"), REFUSED, ids=[row[2][:30] for row in REFUSED])
def test_what_is_wrong_is_one_sentence_before_anything_is_written(
    stream, shockgrid, old, new, words
):
    deck = change(stream / "stream.toml", old, new)
    for command in (("run", deck, "-o", "a", "-q"), ("check", deck)):
        code, _, error = shockgrid(*command)
        assert code == 2 and words in error, error
    assert not Path("a").exists()


SLIP = """
problem = "blocks"
run = { t_end = 1e-3, max_steps = 10 }
[[block]]
name = "lower"
cells = [9, 6]
material = { eos = "ideal-gas", gamma = 1.4 }
rho = 1.0
curves.i_min = [[0.0, 0.0], [0.0, 0.1]]
curves.i_max = [[0.2, 0.0], [0.2, 0.1]]
curves.j_min = [[0.0, 0.0], [0.2, 0.0]]
curves.j_max = [[0.0, 0.1], [0.2, 0.1]]
side = [
    { side = "i_min", kind = "wall" },
    { side = "i_max", kind = "wall" },
    { side = "j_min", kind = "wall" },
]
[[block]]
name = "upper"
cells = [7, 5]
material = { eos = "ideal-gas", gamma = 1.667 }
rho = 5.0
u = 40.0
curves.i_min = [[0.0, 0.1], [0.0, 0.2]]
curves.i_max = [[0.2, 0.1], [0.2, 0.2]]
curves.j_min = [[0.0, 0.1], [0.2, 0.1]]
curves.j_max = [[0.0, 0.2], [0.2, 0.2]]
side = [
    { side = "i_min", kind = "inflow", state = [5.0, "40 + 0*t", 0.0, 1e5] },
    { side = "i_max", kind = "outflow" },
    { side = "j_max", kind = "wall" },
]
[[link]]
kind = "slide"
sides = ["lower.j_max", "upper.j_min"]
"""


def test_a_slip_line_between_blocks_of_unlike_cells_stays(shockgrid):
    Path("slip.toml").write_text(SLIP)
    code, _, error = shockgrid("run", "slip.toml", "-o", "a", "-q")
    assert code == 0, error
    for block, speed in zip(RunData("a").dumps[-1].blocks, (0.0, 40.0), strict=True):
        assert np.abs(block.cell_fields["p"] / 1e5 - 1.0).max() < 1e-11
        assert np.abs(block.cell_fields["u"] - speed).max() < 1e-8
    Path("slip.toml").write_text(SLIP.replace('kind = "slide"', 'kind = "interface"'))
    code, _, error = shockgrid("check", "slip.toml")
    assert code == 2 and "has 7; they must be as many, or be a sliding contact (slide)" in error


def test_the_mistakes_of_all_blocks_are_told_at_once(shockgrid):
    wrong = SLIP.replace('"lower"\ncells', '"lower"\nu = "1/(x - x)"\ncells')
    wrong = wrong.replace('material = { eos = "ideal-gas", gamma = 1.667 }', 'material = "coper"')
    Path("slip.toml").write_text(wrong)
    code, _, error = shockgrid("check", "slip.toml")
    assert code == 2 and "block 'upper': there is no material 'coper'" in error
    Path("slip.toml").write_text(wrong.replace('"coper"', '"copper"\nv = "y/(y - y)"'))
    code, _, error = shockgrid("check", "slip.toml")
    assert code == 2 and error.count("\n") == 2, error
    assert "block 'lower', u" in error and "block 'upper', v" in error


def test_check_prints_what_a_deck_sets(shockgrid):
    Path("slip.toml").write_text(SLIP)
    _, short, _ = shockgrid("check", "slip.toml")
    _, whole, _ = shockgrid("check", "slip.toml", "--all")
    assert "max_steps = 10" in short and "cfl" not in short and "cfl" in whole
