"""Values that one key allows and no flow of its problem means: each is refused by its key."""

import pytest

from regrid.errors import BadInput
from runs.deck.reading import packaged_decks, read_deck

NONSENSE = [
    ("noh", "gamma=1.000001"),
    ("noh", "pressure=1000"),
    ("noh", "pressure=1e-12"),
    ("sedov", "pressure=1e6"),
    ("saltzmann", "pressure=1e6"),
    ("oblique-shock", "mach=1e12"),
    ("oblique-shock", "angle=1e-12"),
    ("detonation", "front=1e12"),
    ("detonation", "length=1e-12"),
    ("triple-point", "thickness=1e12"),
    ("rayleigh-taylor", "sound_speed=1e12"),
    ("rayleigh-taylor", "amplitude=1e-12"),
    ("free-stream", "mach=1e12"),
    ("free-stream", "angle=1e12"),
    ("shock-bubble", "mach=1.000000001"),
    ("shock-bubble", "thickness=1e12"),
    ("heated-cavity", "aspect=1e-12"),
    ("heated-cavity", "prandtl=1e12"),
    ("heated-cavity", "tilt=1e12"),
    ("heated-cavity", "left.value=1e12"),
    ("heated-cavity", "tolerance=0.999"),
    ("rayleigh-benard", "width=1e-12"),
    ("rayleigh-benard", "rayleigh=1e300"),
    ("convection-1d", "mean_speed=1e12"),
    ("moving-grid-1d", "viscosity=1e6"),
]


@pytest.mark.parametrize(("problem", "setting"), NONSENSE, ids=" ".join)
def test_values_without_a_meaning_are_refused(problem, setting):
    key = setting.partition("=")[0]
    with pytest.raises(BadInput, match=f"--set: {key} = .*; it has to be "):
        read_deck(problem, (setting,))


@pytest.mark.parametrize("name", packaged_decks())
def test_packaged_decks_are_taken(name):
    read_deck(name).make_problem()
