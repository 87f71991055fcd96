"""No number in a deck makes arrays of its size before the size has been judged."""

from __future__ import annotations

import tracemalloc

import pytest

from shockgrid.problems import memory as size
from shockgrid.problems.registry import OWN, load_problem
from shockgrid.regrid.errors import BadInput
from shockgrid.runs.deck.checking import make_parts, resolve
from shockgrid.runs.deck.reading import resolve_deck
from shockgrid.runs.inspection.listing import describe_plan

SMALL = size.PROGRAM_BYTES + 20_000 * size.RUN_BYTES  # bytes of a machine that holds so many cells
HUGE = (2**63 - 1, 10**30)
SHARED = ("run.", "output.", "gauge.")  # tables that all decks have


def find_integers(schema, part, name=""):
    """Every dotted key of a deck that takes a whole number, with its part of the schema."""
    part = resolve(schema, part)
    if part.get("type") == "integer":
        yield name, part
    for key, inner in part.get("properties", {}).items():
        yield from find_integers(schema, inner, f"{name}.{key}".strip("."))
    for inner in part.get("anyOf", ()):
        yield from find_integers(schema, inner, name)
    items = part.get("items", [])
    for place, inner in enumerate([items] if isinstance(items, dict) else items):
        yield from find_integers(schema, inner, f"{name}.{place}")


def lay(key, value):
    """A table with `value` at the dotted `key`; lists are filled up with what a size may be."""
    name, _, rest = key.partition(".")
    if name.isdigit():
        return [8] * int(name) + [lay(rest, value) if rest else value]
    return {name: lay(rest, value) if rest else value}


@pytest.fixture
def small_machine(monkeypatch):
    monkeypatch.setattr(size, "find_memory", lambda: SMALL)


@pytest.mark.parametrize("name", OWN)
def test_every_whole_number_of_a_deck_is_bounded(small_machine, name):
    schema = make_parts(load_problem(name).Deck)
    keys = dict(find_integers(schema, schema))
    assert "run.max_steps" in keys and "gauge.0.count" in keys
    tracemalloc.start()
    try:
        for key, part in keys.items():
            if key.startswith(SHARED) and name != "vortex":
                continue
            assert part.get("maximum", 10**30) <= 2**63 - 1, f"{name}: {key} has no upper bound"
            for value in HUGE:
                table = {"problem": name, **lay(key, value)}
                if value > part["maximum"]:
                    with pytest.raises(BadInput, match=r"it must be|lacks the key"):
                        resolve_deck(table, "deck.toml")
        assert tracemalloc.get_traced_memory()[1] < 50e6
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        (name, [f"{key}={{}}" for key in keys])
        for name, keys in {
            "interface-instability": ["cells"],
            "riemann": ["cells", "rows"],
            "free-stream": ["cells"],
            "vortex": ["cells"],
            "saltzmann": ["cells", "rows"],
            "conical-target": ["cells"],
            "elastic-piston": ["cells", "rows"],
            "taylor-bar": ["cells"],
            "shell": ["cells", "rays"],
            "rippled-surface": ["cells"],
            "elastic-waves": ["cells"],
            "noh": ["cells"],
            "sedov": ["cells"],
            "kidder": ["cells", "rays"],
            "gresho": ["cells"],
            "taylor-green": ["cells"],
            "rayleigh-taylor": ["cells"],
            "oblique-shock": ["cells"],
            "triple-point": ["cells"],
            "shock-bubble": ["cells"],
            "detonation": ["cells"],
        }.items()
    ],
)
def test_what_memory_does_not_hold_is_said_at_once(small_machine, name, settings):
    most = 100_000
    deck = resolve_deck({"problem": name}, "deck", tuple(s.format(most) for s in settings))
    tracemalloc.start()
    try:
        with pytest.raises(BadInput, match=r"where .* GB are there; take fewer cells, at most"):
            describe_plan(deck)  # says the size where a plan is arithmetic; a run refuses it
            deck.make_problem().check_memory()
        assert tracemalloc.get_traced_memory()[1] < 100e6
    finally:
        tracemalloc.stop()


def test_the_matrices_of_a_convecting_box_count(monkeypatch):
    """Its factors need many times the memory of its cells: 1798 cells up to twice as high."""
    monkeypatch.setattr(size, "find_memory", lambda: 24e9)
    deck = resolve_deck({"problem": "heated-cavity"}, "deck", ("cells=1798", "aspect=2"))
    with pytest.raises(BadInput, match=r"where 24 GB are there; take fewer cells"):
        deck.make_problem().check_memory()
    deck = resolve_deck({"problem": "heated-cavity"}, "deck", ("cells=400",))
    deck.make_problem().check_memory()
