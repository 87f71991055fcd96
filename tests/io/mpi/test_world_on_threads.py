"""A whole run with its followers, the ranks being threads: what is written and said, its end."""

from __future__ import annotations

import io

import pytest

from shockgrid.regrid.errors import BadInput
from shockgrid.runs.cli.main import main
from shockgrid.runs.deck.reading import read_deck
from shockgrid.runs.march.launching import start_runner
from shockgrid.runs.ranks.world import World, follow
from shockgrid.runs.store.directory import open_directory
from thread_ranks import run_on_threads

SETTINGS = ("cells=8", "run.max_steps=5")


def run_with_followers(size, folder, settings=SETTINGS, deck="triple-point", screens=None):
    """The exit codes of all ranks, and what the followers said."""
    screens = [] if screens is None else screens
    screens += [io.StringIO() for _ in range(size)]

    def rank(comm):
        if comm.rank:
            return follow(comm, screens[comm.rank])
        world = World(comm)
        code = 70
        try:
            read = read_deck(deck, settings)
            runner = start_runner(read, str(folder), False, True, lambda text: None, world)
            runner.world = world
            code = runner.start().exit_code
        finally:
            world.dismiss(code)
        return code

    codes = run_on_threads(size, rank)
    return codes, [screen.getvalue() for screen in screens]


def test_a_run_with_followers_writes_what_a_run_alone_writes(tmp_path):
    gauges = tmp_path / "gauges.toml"
    words = 'problem = "triple-point"\ncells = 8\n[run]\nmax_steps = 5\n'
    gauges.write_text(words + '[[gauge]]\nname = "g"\nat = [3.0, 0.7]\nfields = ["rho", "p"]\n')
    assert run_with_followers(3, tmp_path / "three", (), str(gauges)) == ([0, 0, 0], [""] * 3)
    assert main(["run", str(gauges), "-o", str(tmp_path / "one"), "-q"]) == 0
    assert main(["compare", str(tmp_path / "one"), str(tmp_path / "three")]) == 0
    tables = [(tmp_path / name / "gauges.csv").read_text() for name in ("one", "three")]
    assert tables[0] == tables[1]
    log = open_directory(tmp_path / "three").log.read_text()
    assert "shared by 3 ranks of MPI; blocks of rank 0: " in log


def test_a_problem_that_is_no_flow_is_refused_before_anything_is_written(tmp_path):
    with pytest.raises(BadInput, match="run it without mpiexec"):
        run_with_followers(2, tmp_path / "none", (), "grid-march-strip")
    assert not (tmp_path / "none").exists()


def test_a_follower_that_cannot_build_the_flow_says_so_and_breaks_off(tmp_path, monkeypatch):
    screens = io.StringIO()

    def rank(comm):
        if comm.rank:
            monkeypatch.setattr("shockgrid.runs.ranks.world.resolve_deck", fail)
            return follow(comm, screens)
        read = read_deck("triple-point", SETTINGS)
        runner = start_runner(read, str(tmp_path / "out"), False, True, lambda text: None)
        runner.world = World(comm)
        return runner.start()

    def fail(*words, **options):
        raise BadInput("made to fail")

    with pytest.raises(BadInput, match="made to fail"):
        run_on_threads(2, rank)
    assert screens.getvalue() == "shockgrid: rank 1: made to fail; all ranks end\n"
