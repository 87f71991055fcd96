"""Every packaged deck, with few cells, broken off at three places: the end has the same bits."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from shockgrid.runs.deck.reading import packaged_decks, read_deck
from shockgrid.runs.store.reader import RunData
from soak.settings import change_cells

MOST_STEPS = 120
PARTS_OF_CELLS = (0.25, 0.5, 0.7, 1.0)  # the smallest that the problem accepts
BREAKS = (0.25, 0.5, 0.75)  # of the steps
QUICK = ("flyer-target-visar", "cavity-copper-sphere", "plate-on-wedge-apart")  # all with voids
OWN = ("flyer-target", "cavity", "plate-on-wedge")  # default decks, with voids as well


def run_with_few_cells(shockgrid, deck: str) -> list[str]:
    """Run a deck with as few cells as it accepts, as `whole`; the words that do so."""
    for part in PARTS_OF_CELLS:
        settings = change_cells(msgspec.to_builtins(read_deck(deck).deck), part)
        words = [f"--set={setting}" for setting in ("run.threads=1", *settings)]
        code, _, error = shockgrid("run", deck, "-q", *words, *stop(MOST_STEPS), "-o", "whole")
        if code in (0, 3):
            return words
        assert code == 2, error
    raise AssertionError(error)


def stop(step: int) -> tuple[str, str]:
    return "--set", f"run.max_steps={step}"


def check_breaks(shockgrid, deck: str, words: list[str]) -> None:
    """Break the run off at three places; its end is that of `whole`."""
    last = int(RunData("whole").history["step"][-1])
    places = sorted({max(1, int(part * last)) for part in BREAKS})
    shockgrid("run", deck, "-q", *words, *stop(places[0]), "-o", "broken")
    for place in (*places[1:], MOST_STEPS):
        code, _, error = shockgrid("restart", "broken", "-q", *stop(place))
        assert code in (0, 3), error
    for run in ("whole", "broken"):  # of the dumps where the runs were told to stop
        for place in places:
            RunData(run).directory.dump_path(place).unlink(missing_ok=True)
    code, text, _ = shockgrid("compare", "whole", "broken")
    assert (code, text.splitlines()[-1]) == (0, "no difference between whole and broken"), text


@pytest.mark.parametrize(
    "deck",
    [
        deck if deck in QUICK else pytest.param(deck, marks=pytest.mark.slow)
        for deck in (*OWN, *packaged_decks())
    ],
)
def test_a_deck_broken_off_has_the_same_end(deck, shockgrid):
    words = run_with_few_cells(shockgrid, deck)
    check_breaks(shockgrid, deck, words)
    if deck in QUICK:
        assert np.nanmax(RunData("whole").history["voids"]) > 0


TWO_PLATES = """
problem = "blocks"
run = {{ t_end = 4e-7, threads = 1 }}
{void_fill}
[[block]]
name = "flyer"
material = "Al1100"
cells = [10, 2]
u = 800.0
side = [{sides}]
curves.i_min = [[-1e-3, 0.0], [-1e-3, 1e-3]]
curves.i_max = [[-1e-4, 0.0], [0.0, 1e-3]]
curves.j_min = [[-1e-3, 0.0], [-1e-4, 0.0]]
curves.j_max = [[-1e-3, 1e-3], [0.0, 1e-3]]
[[block]]
name = "target"
material = "Cu"
cells = [12, 3]
side = [{sides}]
curves.i_min = [[1e-4, 0.0], [1e-4, 1e-3]]
curves.i_max = [[2e-3, 0.0], [2e-3, 1e-3]]
curves.j_min = [[1e-4, 0.0], [2e-3, 0.0]]
curves.j_max = [[1e-4, 1e-3], [2e-3, 1e-3]]
"""
SIDES = ", ".join(
    [f'{{ side = "{side}", kind = "free-surface", pressure = 0.0 }}' for side in ("i_min", "i_max")]
    + [f'{{ side = "{side}", kind = "wall" }}' for side in ("j_min", "j_max")]
)


@pytest.mark.parametrize("gas", ["", "void_fill = { pressure = 1e5 }"])
def test_plates_of_ones_own_with_a_void_between(gas, shockgrid, tmp_path):
    (tmp_path / "plates.toml").write_text(TWO_PLATES.format(sides=SIDES, void_fill=gas))
    assert shockgrid("run", "plates.toml", "-q", *stop(MOST_STEPS), "-o", "whole")[0] == 0
    history = RunData("whole").history
    assert history["voids"][1] == 1 and history["voids"][-1] == 0, "it closes during the run"
    check_breaks(shockgrid, "plates.toml", [])


@pytest.mark.parametrize("name", ["t", "dt", "step", "rate", "clock", "contacts", "ledger"])
def test_a_block_may_have_any_name(name, shockgrid, tmp_path):
    text = TWO_PLATES.format(sides=SIDES, void_fill="").replace('"target"', f'"{name}"')
    (tmp_path / "plates.toml").write_text(text)
    code, _, error = shockgrid("run", "plates.toml", "-q", *stop(4), "-o", "named")
    assert code == 0, error
    code, _, error = shockgrid("restart", "named", "-q", *stop(6))
    assert code == 0, error
    assert RunData("named").outputs[-1].step == 6
