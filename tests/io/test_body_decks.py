"""Decks of bodies that cannot be: one sentence that names the sides, exit code 2."""

from __future__ import annotations

import re

import pytest

BODY = """[[block]]
name = "{name}"
material = "Al1100"
p = 0.0
cells = [4, 4]
curves.i_min = [[{0}, {2}], [{0}, {3}]]
curves.i_max = [[{1}, {2}], [{1}, {3}]]
curves.j_min = [[{0}, {2}], [{1}, {2}]]
curves.j_max = [[{0}, {3}], [{1}, {3}]]
side = [{sides}]
"""
WALLS = dict.fromkeys(("i_min", "i_max", "j_min", "j_max"), 'kind = "wall"')
FREE = 'kind = "free-surface", pressure = 0.0'
PISTON = 'kind = "piston", velocity = [{}, 0.0]'


def make_body(name, *extent, **sides):
    told = ", ".join(f'{{ side = "{side}", {kind} }}' for side, kind in {**WALLS, **sides}.items())
    return BODY.format(*extent, name=name, sides=told)


ONE = make_body("one", 0.0, 1.0, 0.0, 1.0, i_max=FREE)


def make_bonded(options, kind=FREE):
    return ONE.replace(FREE, f"{kind}, options = {{ {options} }}")


FILL = "[void_fill]\npressure = 1e5\n"
GAS = [FILL + make_bonded("tension = 0.1")]
TWO = make_body("two", 1.1, 1.6, 0.0, 1.0)
LEFT = make_body("one", 0.0, 1.0, 0.0, 1.0, i_max=PISTON.format(300.0))
RIGHT = make_body("three", 1.7, 2.7, 0.0, 1.0, i_min=PISTON.format(-300.0))
DRIVEN = make_body("one", 0.0, 1.0, 0.0, 1.0, **dict.fromkeys(WALLS, PISTON.format(500.0)))
CASES = {
    "side i_max.*bond = -100000000.0": [make_bonded("bond = -1e8")],
    "bond = 'strong'": [make_bonded('bond = "strong"')],
    "friction = -0.2": [make_bonded("friction = -0.2")],
    "i_max: wall segment: .* 'friction'": [make_bonded("friction = 0.2", 'kind = "wall"')],
    "weld = 'yes'": [make_bonded('weld = "yes"')],
    "piston segment: .* 'weld'": [make_bonded("weld = true", PISTON.format(300.0))],
    "side i_max.*void_fill: .* surface tension": GAS,
    "void_fill.pressure = -1; it must be": [FILL.replace("1e5", "-1") + ONE],
    "no option 'bnd'; did you mean 'bond'": [make_bonded("bnd = 1e8")],
    "'one', .* 'two', .* lie on each other at .*; block 'two' is up to 0.1 m inside": [
        ONE, make_body("two", 0.9, 1.9, 0.3, 0.7, i_min=FREE)
    ],
    "lie on each other at .*; block 'two' is up to 0.45 m inside block 'one'": [
        ONE, make_body("two", 0.45, 0.55, -1.0, 2.0, i_min=FREE)
    ],
    "'one', side i_max.* comes into block 'two' by t = 0.0003": [LEFT, TWO, RIGHT],
    "'one', side i_max.* comes into .*'two' has no free surface": [
        DRIVEN, make_body("two", 1.1, 1.6, -1.0, 2.0)
    ],
}  # fmt: skip


@pytest.mark.parametrize("words", CASES)
def test_a_body_that_cannot_be_is_told_in_one_sentence(words, shockgrid, tmp_path):
    deck = tmp_path / "deck.toml"
    deck.write_text('problem = "blocks"\nrun = { t_end = 1e-3 }\n' + "".join(CASES[words]))
    for command in ("check", "run"):
        code, _, error = shockgrid(command, str(deck))
        assert code == 2 and error.count("\n") == 1, error
        assert re.search(words, error), error
