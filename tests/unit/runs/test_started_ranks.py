"""Whether mpiexec has started this process, and how blocks would be shared, in words."""

from __future__ import annotations

import json

import pytest

import shockgrid
from builders import ROOT
from problems.size import estimate_memory
from regrid.errors import BadInput
from runs.cli.main import main
from runs.ranks.map import describe_map, estimate_memories
from runs.ranks.sharing import share_named_blocks
from runs.ranks.speed import foretell_speed, read_costs
from runs.ranks.started import RANKS, SIZES, SLURM, count_started, find_rank, is_for_ranks


@pytest.fixture(autouse=True)
def plain(monkeypatch):
    """An environment in which nothing of MPI is said."""
    for name in (*SIZES, *RANKS, SLURM):
        monkeypatch.delenv(name, raising=False)


def test_alone_where_nothing_is_said():
    assert count_started() == 1 and find_rank() == 0
    assert not is_for_ranks(["run", "riemann"])


@pytest.mark.parametrize(
    ("words", "count", "rank"),
    [
        ({"OMPI_COMM_WORLD_SIZE": "3", "OMPI_COMM_WORLD_RANK": "2"}, 3, 2),
        ({"PMI_SIZE": "2", "PMI_RANK": "1"}, 2, 1),
        ({"PMIX_RANK": "1", "SLURM_STEP_NUM_TASKS": "4"}, 4, 1),
        ({"SLURM_STEP_NUM_TASKS": "4"}, 1, 0),  # a step that starts no MPI
        ({"PMI_SIZE": "many"}, 1, 0),
    ],
)
def test_what_the_environment_says(monkeypatch, words, count, rank):
    for name, value in words.items():
        monkeypatch.setenv(name, value)
    assert (count_started(), find_rank()) == (count, rank)
    assert is_for_ranks(["-q", "restart", "out"]) == (count > 1)
    assert not is_for_ranks(["study", "run", "--engine", "mpi"]) and not is_for_ranks([])


def test_the_map_says_who_has_what_and_what_it_is_worth():
    lines = describe_map([("left", (30, 10)), ("right", (10, 10)), ("top", (10, 10))], 2, {})
    assert lines[0].startswith("rank 0: left; 300 cells, about ")
    assert lines[1].startswith("rank 1: right, top; 200 cells, about ")
    assert lines[3].endswith("; at most 1.67 times")
    assert describe_map([("left", (30, 10))], 3, {})[-1].endswith(
        "at most 1 times; 2 of 3 ranks would have nothing to do: blocks are cut between rows of "
        "tiles, 32 rows of cells each"
    )
    assert "and 4 more ranks" in describe_map([("left", (30, 10))], 12, {})[-3]


def test_the_map_says_which_rows_of_a_block_that_is_cut():
    lines = describe_map([("heavy", (100, 10)), ("light", (20, 10))], 2, {"heavy": 2, "light": 1})
    assert lines[0].startswith("rank 0: rows 0-63 of 'heavy', which regrids it; 640 cells")
    assert lines[1].startswith("rank 1: rows 64-99 of 'heavy', light; 560 cells")
    assert lines[3].endswith("; at most 1.88 times")
    with pytest.raises(BadInput, match=r"there is no block 'heavi'; did you mean 'heavy'"):
        describe_map([("heavy", (100, 10))], 2, {"heavi": 2})


BLOCKS = [("first", (1000, 1000)), ("second", (1000, 1000))]
CELLS = [cells for _, cells in BLOCKS]


def test_the_speed_of_ranks_is_less_than_their_number_and_nearer_to_it_with_more_cells():
    speeds = []
    for size in (50, 200, 1000):
        blocks = [(name, (size, size)) for name, _ in BLOCKS]
        shares = share_named_blocks(blocks, 2, {})
        speeds.append(foretell_speed([cells for _, cells in blocks], shares, 2))
    assert 1.0 < speeds[0] < speeds[1] < speeds[2] < 2.0
    assert foretell_speed(CELLS, share_named_blocks(BLOCKS, 1, {}), 1) == pytest.approx(1.0)


def test_a_home_that_regrids_alone_limits_the_speed():
    cut = foretell_speed(CELLS, share_named_blocks(BLOCKS, 16, {}), 16)
    cost = read_costs()
    regridding = cost["iteration"] * cost["iterations"]
    assert 2.0 < cut < 2.0 * (regridding + cost["cell"]) / regridding


def test_costs_of_ranks_are_those_of_the_page_on_scaling():
    kept = json.loads((ROOT / "docs/results/mpi.json").read_text())
    assumed, costs = kept["projection"]["assumed"], kept["costs"]
    costs["iterations"] = assumed["iterations a node and step"]
    costs["messages"] = assumed["messages a step"]
    assert read_costs() == {name: float(f"{value:.3g}") for name, value in costs.items()}


def test_memory_of_ranks_is_that_of_what_they_hold():
    shares = share_named_blocks(BLOCKS, 4, {})
    first, *others = estimate_memories(CELLS, shares, 4)
    assert first == estimate_memory(2_000_000, [1_000_000, 1_000_000])
    homes = {there[0] for there in shares.places}
    for rank, bytes_held in enumerate(others, 1):
        assert (bytes_held > estimate_memory(1_000_000)) == (rank in homes)
        assert bytes_held < first


def test_ranks_are_for_a_dry_run(capsys):
    assert main(["run", "triple-point", "--set", "cells=8", "--dry-run", "--ranks", "2"]) == 0
    assert "rank 1: " in capsys.readouterr().out
    assert main(["run", "triple-point", "--ranks", "2"]) == 2
    assert "mpiexec -n 2" in capsys.readouterr().err


@pytest.mark.parametrize("call", ["run", "restart"])
def test_a_script_on_several_ranks_is_refused_before_anything_is_written(
    monkeypatch, tmp_path, call
):
    monkeypatch.setenv(SIZES[0], "2")
    calls = {
        "run": lambda: shockgrid.run("triple-point", tmp_path / "none"),
        "restart": lambda: shockgrid.restart(tmp_path / "none"),
    }
    with pytest.raises(BadInput, match=rf"mpiexec -n 2 shockgrid {call} "):
        calls[call]()
    with pytest.raises(BadInput, match="each of them would make the whole run"):
        shockgrid.load("triple-point", cells=8).run(tmp_path / "none")
    assert not (tmp_path / "none").exists()
