"""The model of a step on ranks: what it is fitted to comes back, and what follows has sense."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
import pytest

from benchmarks.mpi_scaling.cases import IN_ROW, Case, Timing, write_row_of_blocks
from benchmarks.mpi_scaling.clocked_run import Clocks
from benchmarks.mpi_scaling.model import (
    LEAST_GAIN,
    Costs,
    Network,
    describe_load,
    find_crossover,
    fit,
    keep_neighbours,
    load_strong,
    load_weak,
    predict,
)
from benchmarks.mpi_scaling.projection import project
from runs.deck.reading import read_deck
from runs.ranks.account import describe_books, read_books

TRUE = Costs(
    cell=90e-9, own_block=30e-6, iteration=40e-9, face=0.4e-6, block=50e-6, step=80e-6,
    message=12e-6, byte=0.5e-9, record=150e-6,
)  # fmt: skip
NODES = 1000


def make_timing(kind: str, cells: int, ranks: int) -> Timing:
    """A run that takes exactly what TRUE says, its parts too."""
    case = Case(kind, cells, ranks, 1, 10)
    timing = Timing(case, command=1.0)
    size, inside = cells * cells * case.own_blocks, 0.4 * TRUE.cell
    counts = np.arange(10.0) * NODES if kind == "mushroom" else np.zeros(10)
    timing.steps = {
        "regrid": list(1e-3 + TRUE.iteration * counts),
        "node_iterations": list(counts),
        "nodes": [NODES] * 10,
    }
    many = ranks > 1
    timing.counts = {"calls": 4.0 * many, "bytes": many * 184.0 * 4 * cells * case.blocks}
    timing.seconds = {
        "inside": inside * size,
        "regrid": inside * size + TRUE.own_block * case.own_blocks,
        "rest": 0.2 * TRUE.cell * size + 20e-6 * case.blocks + TRUE.step,
        "sides": 0.75 * TRUE.face * 4 * cells * case.blocks,
        "lines": 0.25 * TRUE.face * 4 * cells * case.blocks + 30e-6 * case.blocks,
        "messages": TRUE.message * timing.counts["calls"],
        "packing": TRUE.byte * timing.counts["bytes"],
        "record": TRUE.record,
    }
    return timing


@pytest.fixture(scope="module")
def timings() -> list[Timing]:
    squares = [make_timing("square", n, ranks) for n in (50, 100, 200) for ranks in (0, 2)]
    rows = [make_timing("blocks", n, 0) for n in (16, 32)]
    return [*squares, *rows, make_timing("mushroom", 16, 0)]


def test_the_fit_finds_the_constants_that_runs_were_made_with(timings):
    found, wanted = asdict(fit(timings)), asdict(TRUE)
    for name, value in wanted.items():
        assert found[name] == pytest.approx(value, rel=1e-3), name


def test_the_model_gives_back_the_step_of_a_run(timings):
    for timing in timings:
        if timing.case.kind != "mushroom":
            wanted = sum(timing.seconds.values())
            got = sum(predict(TRUE, describe_load(timing)).values())
            assert got == pytest.approx(wanted, rel=1e-9)


def test_an_outlying_step_does_not_move_the_cost_of_an_iteration(timings):
    spoilt = make_timing("mushroom", 16, 0)
    spoilt.steps["regrid"][3] *= 50.0  # the machine was away
    found = fit([*timings[:-1], spoilt])
    assert found.iteration == pytest.approx(TRUE.iteration, rel=0.1)


def test_too_few_runs_are_no_fit(timings):
    with pytest.raises(ValueError, match="too few runs"):
        fit(timings[:3])


def test_a_rank_more_never_makes_the_work_of_all_less_than_that_of_one():
    one = load_strong(1, 1e7, 8, 1.0, 4.0)
    for ranks in (2, 3, 8, 9, 64, 1000):
        load = load_strong(ranks, 1e7, 8, 1.0, 4.0)
        assert load.cells * ranks >= one.cells * (1 - 1e-12)
        assert (load.faces, load.blocks) == (one.faces, one.blocks)
        assert (load.cuts > 0) == (ranks > 8)


def test_weak_ranks_repeat_each_others_perimeters_unless_they_keep_their_neighbours_alone():
    small, large = (load_weak(ranks, 1e4, 1.0, 4.0) for ranks in (10, 1000))
    assert large.faces == pytest.approx(100 * small.faces)
    assert keep_neighbours(large).faces == pytest.approx(5 * 400)
    assert keep_neighbours(small).cells == small.cells
    two = load_weak(2, 1e4, 1.0, 4.0)
    assert keep_neighbours(two) == two


def test_messages_take_the_latency_once_a_doubling_and_the_bytes_once():
    network = Network(latency=1e-6, bandwidth=1e9)
    assert network.take(1, 5, 1000) == 0.0
    assert network.take(1024, 5, 1000) == pytest.approx(50e-6 + 1e-6)
    assert network.take(1025, 5, 0) == pytest.approx(55e-6)


def test_the_crossover_is_the_first_rank_that_gains_too_little():
    assert find_crossover(lambda ranks: 1.0 / (1.0 + 0.1 * (ranks - 1)), 100) == 12
    assert find_crossover(lambda ranks: 1.0, 100) is None


def test_the_projection_loses_by_what_is_alike_and_less_without_it(timings):
    timing = {t.case: t for t in timings}
    two, mushroom = timing[Case("square", 200, 2, 1, 10)], timings[-1]
    cases = project(TRUE, mushroom, two)["cases"]
    for case in ("strong", "weak"):
        rows = cases[case]["rows"]
        better = cases[f"{case}, own and neighbours' perimeters"]["rows"]
        assert rows[0]["efficiency"] == 1.0
        assert all(b["efficiency"] >= a["efficiency"] for a, b in zip(rows, better, strict=True))
        alike = [row["alike"] for row in rows]
        assert alike[-1] == (alike[0] if case == "strong" else pytest.approx(max(alike)))
        where = cases[case]["crossover"]
        shown = [row for row in rows if row["ranks"] < where]
        assert all(row["efficiency"] >= LEAST_GAIN for row in shown)


def test_the_row_of_blocks_is_a_deck(tmp_path):
    path = tmp_path / "row.toml"
    path.write_text(write_row_of_blocks(6))
    deck = read_deck(str(path), ()).deck
    assert len(deck.block) == IN_ROW and len(deck.link) == IN_ROW - 1


def test_clocks_add_up_and_begin_anew():
    clocks = Clocks()
    call = clocks.clock(lambda: sum(range(10_000)), "sum")
    call(), call()
    assert clocks.take("sum") > 0.0 == clocks.take("sum")


def test_books_in_words_and_back_from_the_log():
    books = {
        "ranks": 2, "steps": 10, "seconds": [2.0, 4.0], "waited": [0.5, 0.4],
        "calls": {"nodes": 10, "states": 10, "rows": 0},
        "bytes": {"nodes": 10**7, "states": 2 * 10**7, "rows": 0},
    }  # fmt: skip
    words = describe_books(books)
    assert words == "2.0 a step, MB of nodes 1, states 2; 10% to 25% of a step are waits for them"
    assert describe_books(books | {"steps": 0}) == "none"
    log = 'day  start: ranks: none\nday  ranks: {"ranks": 2}\nday  more\n'
    assert read_books(log) == {"ranks": 2}
    assert read_books("day  start\n") is None
