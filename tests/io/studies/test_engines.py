"""Engines give every result once, whatever computes it and whatever dies meanwhile."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import engine_tasks
import pytest

from mpiexec import find_mpiexec
from shockgrid.regrid.errors import BadInput
from shockgrid.runs.engines import open_engine

HERE = Path(__file__).resolve().parent
SQUARES = {number: number * number for number in range(1, 9)}


def compute(engine, task, folder, numbers=tuple(SQUARES)) -> dict[int, object]:
    arguments = [(str(folder), number) for number in numbers]
    found = list(engine.compute(task, arguments))
    assert sorted(place for place, _ in found) == list(range(len(numbers)))
    return {numbers[place]: result for place, result in found}


@pytest.mark.parametrize("jobs", [1, 2])
def test_every_result_comes_once(tmp_path, environment, jobs):
    with open_engine("processes", jobs) as engine:
        assert engine.workers == jobs
        found = compute(engine, engine_tasks.square, tmp_path, (0, *SQUARES))
    assert isinstance(found.pop(0), ValueError)
    assert found == SQUARES
    assert all(len(p.read_text().splitlines()) == 1 for p in tmp_path.glob("task-*"))


def test_a_killed_process_costs_nothing_but_its_work(tmp_path, environment):
    with open_engine("processes", 2) as engine:
        assert compute(engine, engine_tasks.square_after_death, tmp_path) == SQUARES
    times = {int(p.name[5:]): len(p.read_text().splitlines()) for p in tmp_path.glob("task-*")}
    assert times.pop(3) == 2
    assert sum(times.values()) <= len(times) + 1  # the one beside it


def test_a_task_that_kills_its_process_fails_alone(tmp_path, environment):
    with open_engine("processes", 2) as engine:
        found = compute(engine, engine_tasks.square_or_die, tmp_path)
    error = found.pop(2)
    assert "died 3 times" in str(error)
    assert found == {n: square for n, square in SQUARES.items() if n != 2}


def test_a_worker_ends_with_its_parent(tmp_path, environment):
    script = (
        "import engine_tasks, time, sys\n"
        "from shockgrid.runs.engines import open_engine\n"
        "if __name__ == '__main__':\n"
        "    with open_engine('processes', 2) as engine:\n"
        "        for _ in engine.compute(engine_tasks.note_and_wait, [sys.argv[1]] * 2): pass\n"
    )
    path = tmp_path / "parent.py"
    path.write_text(script)
    process = subprocess.Popen([sys.executable, str(path), str(tmp_path)])
    while len(pids := list(tmp_path.glob("pid-*"))) < 2:
        assert process.poll() is None
        time.sleep(0.02)
    process.kill()
    process.wait()
    while any(map(is_alive, pids)):  # for ever, should a worker outlive its parent
        time.sleep(0.02)


def test_an_interrupted_engine_stops_its_workers(tmp_path, environment):
    def interrupt():
        while len(list(tmp_path.glob("pid-*"))) < 2:
            time.sleep(0.02)
        signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        threading.Thread(target=interrupt, daemon=True).start()
        with pytest.raises(KeyboardInterrupt), open_engine("processes", 2) as engine:
            list(engine.compute(engine_tasks.note_and_wait, [str(tmp_path)] * 3))
    finally:
        signal.signal(signal.SIGINT, before)
    one, other = tmp_path.glob("pid-*")  # the third task was never begun
    assert not is_alive(one) and not is_alive(other)


def is_alive(note: Path) -> bool:
    """Does the worker that left this note still run? One that has ended may be a zombie."""
    try:
        state = Path("/proc", note.name.removeprefix("pid-"), "stat").read_text().split()[2]
    except (FileNotFoundError, ProcessLookupError):
        return False
    return state not in "ZX"


@pytest.mark.parametrize(
    ("name", "jobs", "words"),
    [
        ("threads", None, "processes and mpi"),
        ("mpi", 2, "has its own workers"),
    ],
)
def test_wrong_engines_are_told(name, jobs, words):
    with pytest.raises(BadInput, match=words), open_engine(name, jobs):
        pass


def test_an_executor_is_an_engine(tmp_path):
    with ThreadPoolExecutor(2) as executor, open_engine(executor, 2) as engine:
        assert engine.workers == 2
        found = compute(engine, engine_tasks.square, tmp_path, (0, *SQUARES))
    assert isinstance(found.pop(0), ValueError)
    assert found == SQUARES


def test_mpi_computes_on_the_ranks_but_the_first(tmp_path, environment):
    path = tmp_path / "ranks.py"
    path.write_text(
        "import sys, engine_tasks\n"
        "from shockgrid.runs.engines import open_engine\n"
        "with open_engine('mpi') as engine:\n"
        "    if engine is not None:\n"
        "        tasks = [(sys.argv[1], n) for n in range(1, 9)]\n"
        "        found = dict(engine.compute(engine_tasks.square, tasks))\n"
        "        print(engine.workers, [found[n] for n in range(8)])\n"
    )
    done = subprocess.run(
        [*find_mpiexec(), sys.executable, str(path), str(tmp_path)],
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == f"2 {list(SQUARES.values())}"
    pids = {line for p in tmp_path.glob("task-*") for line in p.read_text().split()}
    assert 1 <= len(pids) <= 2
