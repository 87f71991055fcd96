"""Surface tension in decks: where it is said, what is built, refused and warned of."""

from __future__ import annotations

import pytest

from problems.standard.rayleigh_taylor import GRAVITY, WAVE_NUMBER, RayleighTaylor
from problems.standard.rayleigh_taylor import RayleighTaylorDeck as Deck
from regrid.errors import BadInput
from runs.deck.reading import read_deck

BLOCKS = """
problem = "blocks"
[run]
t_end = 1e-6
[[block]]
name = "a"
cells = [4, 4]
curves = { i_min = [[0,0],[0,1]], i_max = [[1,0],[1,1]], j_min = [[0,0],[1,0]], j_max = [[0,1],[1,1]] }
side = [{ side = "i_min", kind = "wall" }, { side = "j_min", kind = "wall" }, { side = "j_max", kind = "wall" }]
[[block]]
name = "b"
cells = [4, 4]
curves = { i_min = [[1,0],[1,1]], i_max = [[2,0],[2,1]], j_min = [[1,0],[2,0]], j_max = [[1,1],[2,1]] }
side = [{ side = "i_max", kind = "free-surface", pressure = 1e5, options = { tension = 0.07 } },
        { side = "j_min", kind = "wall" }, { side = "j_max", kind = "wall" }]
[[link]]
kind = "interface"
sides = ["a.i_max", "b.i_min"]
tension = 0.02
"""  # noqa: E501


def make(tmp_path, text):
    path = tmp_path / "deck.toml"
    path.write_text(text, encoding="utf-8")
    return read_deck(str(path), ()).make_problem()


def test_links_and_free_surfaces_of_blocks(tmp_path):
    simulation = make(tmp_path, BLOCKS).build()
    assert sorted(line.tension for line in simulation.tension.lines) == [0.02, 0.07]
    assert simulation.start_row()["surface_energy"] == pytest.approx(0.09)


def test_a_wave_at_the_cut_off_has_no_rate():
    with pytest.raises(BadInput, match="neither grows nor swings"):
        RayleighTaylor(Deck(tension=GRAVITY / WAVE_NUMBER**2))
    assert RayleighTaylor(Deck()).t_end == 3.0
    assert RayleighTaylor(Deck(above="nothing")).t_end == 6.0
