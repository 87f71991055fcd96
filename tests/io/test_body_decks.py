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
CASES = {
    "bond below 0": (
        [make_bonded("bond = -1e8")],
        "side i_max.*bond = -100000000.0; the tension that a contact holds",
    ),
    "bond in words": (
        [make_bonded('bond = "strong"')],
        "bond = 'strong'; the tension that a contact",
    ),
    "friction below 0": (
        [make_bonded("friction = -0.2")],
        "friction = -0.2; Coulomb's coefficient",
    ),
    "friction on a wall": (
        [make_bonded("friction = 0.2", 'kind = "wall"')],
        "side i_max: wall segment: 'friction' is given, and it has no options",
    ),
    "weld in words": ([make_bonded('weld = "yes"')], "weld = 'yes'; it is true or false"),
    "weld on a piston": (
        [make_bonded("weld = true", PISTON.format(300.0))],
        "side i_max: piston segment: there is no option 'weld'",
    ),
    "gas in voids under tension": (
        [FILL + make_bonded("tension = 0.1")],
        "side i_max.*void_fill: gas in voids is not beside lines under surface tension",
    ),
    "gas without pressure": (
        [FILL.replace("1e5", "-1") + ONE],
        "void_fill.pressure = -1; it must be a number of at least 0",
    ),
    "misspelt": ([make_bonded("bnd = 1e8")], "no option 'bnd'; did you mean 'bond'"),
    "one in the other": (
        [ONE, make_body("two", 0.9, 1.9, 0.3, 0.7, i_min=FREE)],
        "'one', .* 'two', .* lie on each other at .*; block 'two' is up to 0.1 m inside block 'one",
    ),
    "a bar across": (
        [ONE, make_body("two", 0.45, 0.55, -1.0, 2.0, i_min=FREE)],
        "lie on each other at .*; block 'two' is up to 0.45 m inside block 'one'",
    ),
    "walls that close": (
        [
            make_body("one", 0.0, 1.0, 0.0, 1.0, i_max=PISTON.format(300.0)),
            make_body("two", 1.1, 1.6, 0.0, 1.0),
            make_body("three", 1.7, 2.7, 0.0, 1.0, i_min=PISTON.format(-300.0)),
        ],
        "block 'one', side i_max.* comes into block 'two' by t = 0.0003.* s: walls cannot meet",
    ),
    "a body of walls driven into one": (
        [
            make_body("one", 0.0, 1.0, 0.0, 1.0, **dict.fromkeys(WALLS, PISTON.format(500.0))),
            make_body("two", 1.1, 1.6, -1.0, 2.0),
        ],
        "block 'one', side i_max.* comes into block 'two' by t = .*'two' has no free surface",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_a_body_that_cannot_be_is_told_in_one_sentence(case, shockgrid, tmp_path):
    bodies, words = CASES[case]
    deck = tmp_path / "deck.toml"
    deck.write_text('problem = "blocks"\nrun = { t_end = 1e-3 }\n' + "".join(bodies))
    for command in ("check", "run"):
        code, _, error = shockgrid(command, str(deck))
        assert code == 2 and error.count("\n") == 1, error
        assert re.search(words, error), error


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (("plates.0.gap=1e-4",), "nothing is before the first plate"),
        (("plates.1.gap=-1e-4",), "plates.1.gap = -0.0001; it must be a number of at least 0"),
        (("void_fill.pressure=-1",), "void_fill.pressure = -1; it must be a number of at least 0"),
        (("bond=-1",), "bond = -1; it must be a number of at least 0"),
        (("plates=[{}]",), "plates"),
    ],
)
def test_plates_that_cannot_be(settings, words, shockgrid):
    code, _, error = shockgrid(
        "check", "flyer-target", *(w for s in settings for w in ("--set", s))
    )
    assert code == 2 and words in error and error.count("\n") == 1, error


@pytest.mark.parametrize(
    ("deck", "setting", "words"),
    [
        ("plate-on-wedge", "gap=-1e-3", "gap = -0.001; it must be a number of at least 0"),
        ("plate-on-wedge-apart", "refinement=2", "finer at A only where the plate lies"),
        (
            "cavity",
            "void_fill.gamma=1",
            "void_fill.gamma = 1; it must be a number greater than 1",
        ),
        ("cavity", "before=0.5", "before = 0.5; it must be a number greater than 1"),
        ("cavity", "material=air", "has no such shock"),
        ("cavity", "speed=1e6", "speed = 1000000.0; it must be a number"),
    ],
)
def test_plates_and_voids_that_cannot_be(deck, setting, words, shockgrid):
    code, _, error = shockgrid("check", deck, "--set", setting)
    assert code == 2 and words in error and error.count("\n") == 1, error
