"""Whether mpiexec has started this process, and how blocks would be shared, in words."""

from __future__ import annotations

import pytest

import shockgrid
from regrid.errors import BadInput
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
