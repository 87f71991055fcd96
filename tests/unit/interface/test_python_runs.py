"""Runs and cases from Python, and what it refuses."""

from __future__ import annotations

import copy
import os
import pickle
import re
import subprocess
import sys
import threading
from dataclasses import dataclass

import h5py
import numpy as np
import pytest

import shockgrid as sg
from builders import ROOT, box, two_blocks, wall_off
from shockgrid.hydro.eos.gases import energy, pressure, sound_speed_squared
from shockgrid.runs.cli.main import main
from shockgrid.runs.deck.reading import read_deck
from shockgrid.runs.inspection.compare import compare_in_words
from shockgrid.runs.interface.wording import say_in_python

DECK = {"cells": 8, "run": {"max_steps": 12}}
NAME = "interface-instability"


def load(**settings):
    return sg.load(NAME, **(DECK | settings))


@pytest.fixture(scope="module")
def case():
    case = load()
    case.advance(3)
    return case


def test_keywords_are_settings_of_the_deck():
    words = ("cells=8", "run.max_steps=5", "modes=[{number = 2, ka0 = 0.1}]", "limiter=minmod")
    modes = [{"number": 2, "ka0": 0.1}]
    case = sg.load(NAME, cells=np.int64(8), modes=modes, limiter="minmod", **{"run.max_steps": 5})
    assert case.deck == read_deck(NAME, words).deck
    assert sg.load(NAME, regrid={"options": {"threads": 1}}).deck.regrid.options == {"threads": 1}


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"cells": -3}, r"^cells = -3; it must be a whole number of at least"),
        ({"run": {"t_nd": 1.0}}, r"^there is no key 'run.t_nd'; did you mean 'run.t_end'\?"),
        ({"mach_number": 2.0}, r"^there is no key 'mach_number'; did you mean 'mach'\?"),
        ({"cells": None}, "cells = None: a deck cannot hold this"),
        ({"cells": object()}, "cells = <object.*: a deck cannot hold this"),
    ],
)
def test_wrong_keywords_are_told_without_words_of_the_command_line(settings, words):
    with pytest.raises(sg.BadInput, match=words) as found:
        sg.load(NAME, **settings)
    assert "--set" not in str(found.value)


def test_a_mistake_beside_keywords_says_that_it_is_in_them(tmp_path):
    with pytest.raises(sg.BadInput, match=r"and the keywords: output\.columns: there is no"):
        sg.run(NAME, tmp_path / "run", output={"columns": ["none"]}, **DECK)


def test_ghost_cells_never_show(case):
    for name, block in case.blocks.items():
        (inner,) = [one for one in case.simulation.blocks if one.name == name]
        ni, nj = block.cells
        assert block.nodes.shape == (2, ni + 1, nj + 1)
        assert block.centres.shape == (2, ni, nj)
        for field, row in zip(("rho", "u", "v", "p"), inner.state, strict=True):
            seen = getattr(block, field)
            assert seen.shape == (ni, nj) == block.cell_fields[field].shape
            assert np.array_equal(seen, row[1:-1, 1:-1])
            assert row.shape == (ni + 2, nj + 2)
        assert block.e.shape == (ni, nj)
        assert set(block.cell_fields) == {"rho", "u", "v", "p", "e"}
        assert all(not block.cell_fields[field].flags.writeable for field in block.cell_fields)


def test_a_run_ends_in_the_bits_of_the_command(tmp_path, case):
    one = load().run(tmp_path / "one", hooks=[lambda case: None])
    words = ["--set", "cells=8", "--set", "run.max_steps=12", "-q", "-o", str(tmp_path / "two")]
    assert main(["run", NAME, *words]) == 0
    assert sg.compare(one, tmp_path / "two") == []
    assert one.final.step == 12 and one.reason == "max_steps = 12 reached"


def test_hooks_see_each_step_and_stop_a_run(tmp_path):
    seen = []
    every = []
    late = []

    def look(case):
        seen.append((case.step, float(case.blocks["first"].p.max())))
        return "far enough" if case.step == 7 else None

    def note(case):
        every.append(case.step)

    def note_time(case):
        late.append(case.t)

    tick = 2e-2
    hooks = [sg.Hook(note, steps=3), sg.Hook(note_time, time=tick), look]
    run = load().run(tmp_path / "run", hooks=hooks)
    assert [step for step, _ in seen] == [1, 2, 3, 4, 5, 6, 7] and every == [3, 6]
    assert run.reason == "far enough" and run.dumps[-1].step == 7
    numbers = np.floor(run.history.t / tick)
    crossed = np.flatnonzero(np.diff(numbers) > 0) + 1
    assert crossed.size > 0 and late == list(run.history.t[crossed])
    again = sg.restart(run)
    assert again.reason == "max_steps = 12 reached"
    whole = load().run(tmp_path / "whole")
    assert {one.where for one in sg.compare(again, whole)} <= {"dumps"}


STATES = ((1.0, 0.0, 0.0, 1.0), (0.125, 0.0, 0.0, 0.1))  # Sod's


def make_tube(t_end=0.1, gamma=1.4, bend=0.05):
    """Two gases beside a bent line, closed by walls."""

    def front(y):
        return bend * np.cos(np.pi * y)

    blocks, links = two_blocks(front, (10, 6), (sg.IdealGas(gamma),) * 2, STATES)
    for block in blocks:
        wall_off(block, *({"left": "i_min", "right": "i_max"}[block.name], "j_min", "j_max"))
    return sg.Simulation(blocks, links, t_end=t_end)


def measure(simulation):
    return {"furthest": float(simulation.blocks[0].nodes[0].max())}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("own") / "tube"
    return sg.run(make_tube(), folder, dumps=4, measure=measure)


def test_blocks_of_a_script_have_all_that_problems_have(run, capsys):
    assert run.reason == "t_end reached" and run.final.t == 0.1
    assert run.dumps[0].t == 0.0 and len(run.dumps) == 5
    assert run.history.furthest[-1] > run.history.furthest[0] + 0.05
    assert "largest conservation errors" in run.summary
    assert run.deck.materials["left"] == "left, ideal-gas 1.4"
    assert (run.path / "run.xmf").exists()
    assert main(["info", str(run.path)]) == 0
    assert "block right: 10 x 6 cells" in capsys.readouterr().out
    assert main(["plot", str(run.path), "rho", "--mesh"]) == 0
    assert main(["compare", str(run.path), str(run.path)]) == 0


def test_data_of_a_run(run):
    last = run.dumps[-1]["right"]
    assert last.rho.shape == (10, 6) and np.array_equal(last.rho, last.cell_fields["rho"])
    final = {block.name: block for block in run.final.blocks}
    assert np.array_equal(last.p, final["right"].cell_fields["p"])
    assert np.array_equal(last.nodes, final["right"].nodes)
    with pytest.raises(AttributeError, match="has no field 'roh'; did you mean 'rho'"):
        _ = last.roh
    with pytest.raises(sg.BadInput, match="has no block 'middle'"):
        _ = run.dumps[0]["middle"]
    curve = run.interface(0.0)
    line = run.dumps[0]["left"].nodes[:, -1]
    assert np.array_equal([curve.x, curve.y], line) and curve.t == 0.0
    assert run.interface().t == 0.1


@pytest.mark.parametrize("opened", [True, False], ids=["opened", "just made"])
def test_data_of_a_run_go_to_other_processes(run, opened):
    one = sg.open(run.path) if opened else run
    block = one.dumps[-1]["right"]
    history = one.history
    rho = block.rho
    for other in (pickle.loads(pickle.dumps(one)), copy.deepcopy(one)):
        assert other.history.t.tolist() == history.t.tolist()
        assert other.history.units == history.units
        assert other.reason == one.reason and other.deck == one.deck
        assert np.array_equal(other.dumps[-1]["right"].rho, rho)
        assert np.array_equal(other.dumps[-1]["right"].nodes, block.nodes)


def test_two_runs_in_two_threads_are_as_one_after_the_other(tmp_path):
    found = {}

    def make(name, cells):
        try:
            found[name] = sg.run(NAME, tmp_path / name, cells=cells, dumps=6, run={"max_steps": 12})
        except BaseException as error:
            found[name] = error

    several = {"one": 8, "other": 12, "third": 8}
    threads = [threading.Thread(target=make, args=work) for work in several.items()]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for name, cells in several.items():
        alone = sg.run(
            NAME, tmp_path / f"{name}-alone", cells=cells, dumps=6, run={"max_steps": 12}
        )
        assert not isinstance(found[name], BaseException), found[name]
        assert sg.compare(found[name], alone) == []


def test_blocks_of_a_table_run_as_those_of_its_gas_and_restart_with_it_alone(tmp_path):
    def write(gamma):
        rho = np.linspace(0.01, 4.0, 30)
        e = np.linspace(0.2, 40.0, 30)
        with h5py.File(tmp_path / "table.h5", "w") as file:
            file["rho"] = rho
            file["e"] = e
            file["p"] = (gamma - 1.0) * rho[:, None] * e

    def make(eos):
        p = 1.0 + np.arange(8.0)[:, None] * np.ones(4)
        limiter = "generalised-minmod"  # tables have no steep one
        nodes = box((0, 0), (1, 1), (8, 4))
        block = sg.Block("gas", eos, nodes, 1.0, 0.0, 0.0, p, limiter=limiter)
        wall_off(block)
        return sg.Simulation([block], [], t_end=0.1)

    write(1.4)
    path = str(tmp_path / "table.h5")
    most = {"max_steps": 6}
    table = sg.run(make(sg.Tabular(path)), tmp_path / "table", run=most)
    gas = sg.run(make(sg.IdealGas(1.4)), tmp_path / "gas", run=most)
    assert table.dumps[-1]["gas"].p == pytest.approx(gas.dumps[-1]["gas"].p, rel=1e-10)
    write(1.5)
    with pytest.raises(sg.BadInput, match="different flows"):
        sg.restart(table, simulation=make(sg.Tabular(path)), run={"max_steps": 8})
    write(1.4)
    longer = sg.restart(table, simulation=make(sg.Tabular(path)), run={"max_steps": 8})
    assert longer.dumps[-1].step == 8


def test_restart_with_blocks_made_anew_ends_in_the_same_bits(run, tmp_path):
    part = sg.run(make_tube(), tmp_path / "part", dumps=4, run={"max_steps": 5}, measure=measure)
    assert part.reason == "max_steps = 5 reached"
    more = {"max_steps": 10_000}
    whole = sg.restart(part, simulation=make_tube(), measure=measure, run=more)
    assert whole.reason == "t_end reached"
    # nothing but the dump at which the first part ended
    assert {one.where for one in sg.compare(run, whole)} <= {"dumps"}
    assert whole.dumps[-1].step == run.dumps[-1].step


def test_a_signal_in_a_script_ends_it_with_a_restart_point(tmp_path):
    script = (
        "import os, signal, shockgrid as sg\n"
        "def stop(case):\n"
        "    if case.step == 3: os.kill(os.getpid(), signal.SIGINT)\n"
        "try:\n"
        "    sg.run('interface-instability', 'run', cells=8, hooks=[stop])\n"
        "except KeyboardInterrupt as error:\n"
        "    print(error)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)}, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout == "stopped by SIGINT; run can be restarted from\n"
    assert sg.open(tmp_path / "run").dumps[-1].step == 3


def make_block(name="gas", eos=None, **more):
    nodes = box((0.0, 0.0), (1.0, 1.0), (3, 2))
    at = {"rho": 1.0, "u": 0.0, "v": 0.0, "p": 1.0} | more
    return sg.Block(name, sg.IdealGas(1.4) if eos is None else eos, nodes, **at)


@pytest.mark.parametrize(
    ("kind", "options", "words"),
    [
        ("piston", {"velocity": 0.3}, r"piston segment: velocity gives 0.3; \(u, v\) is wanted"),
        ("piston", {"velocity": (0.3, 0.0, 0.0)}, r"\(u, v\) is wanted, or a function of the time"),
        ("piston", {"velocity": "fast"}, r"velocity gives 'fast'; \(u, v\) is wanted"),
        ("piston", {"velocity": lambda t: 0.3}, r"velocity gives 0.3; \(u, v\) is wanted"),
        ("piston", {"velocity": (float("nan"), 0.0)}, r"\(u, v\) is wanted"),
        ("piston", {}, r"piston segment: velocity=... is missing \(Wall moving with"),
        ("piston", {"speed": 1.0}, "there is no option 'speed'"),
        ("wall", {"velocity": 1.0}, "there is no option 'velocity'"),
        ("inflow", {"state": (1.0, 0.0, 1.0)}, r"\(rho, u, v, p\) is wanted"),
        ("inflow", {"state": (1.0, 0.0, 0.0, 1.0), "velocity": 1.0}, r"\(u, v\) is wanted"),
        ("inflow", {}, "state=... is missing"),
        ("free-surface", {"pressure": "none"}, "pressure = 'none'; a number"),
        (3, {}, "there is no segment kind 3"),
    ],
)
def test_a_boundary_that_cannot_be_is_told(kind, options, words):
    block = make_block()
    with pytest.raises(sg.BadInput, match=words) as found:
        sg.put(block, "i_min", kind, **options)
    assert "__init__" not in str(found.value)
    assert block.segments == []


@dataclass(frozen=True)
class WithoutParts(sg.EquationOfState):
    """An equation of state without formulas."""

    gamma: float = 1.4


@dataclass(frozen=True)
class Half(WithoutParts):
    """Formulas that are no static methods, or not all of them."""

    pressure_part = staticmethod(pressure)
    energy_part = staticmethod(energy)
    sound_speed_squared_part = staticmethod(sound_speed_squared)
    least_pressure_part = lambda parameters: -1e300  # noqa: E731


@dataclass(frozen=True)
class Plain(Half):
    """A formula that no kernel can call."""

    least_pressure_part = staticmethod(lambda parameters: -1e300)


@dataclass(frozen=True)
class WithoutWaves(Half):
    """All formulas, and no law of waves."""

    least_pressure_part = staticmethod(pressure)


@pytest.mark.parametrize(
    ("eos", "words"),
    [
        (1.4, r"eos is 1.4; an equation of state is wanted, such as shockgrid.IdealGas\(1.4\)"),
        (sg.IdealGas, r"eos is the class IdealGas; one made of it is wanted, IdealGas\(...\)"),
        (WithoutParts(), "class WithoutParts, which lacks pressure_part, energy_part, sound_speed"),
        (Half(), r"Half.least_pressure_part is not a staticmethod\(least_pressure_part\)"),
        (Plain(), "Plain.least_pressure_part is not marked with shockgrid.inlined"),
        (WithoutWaves(), "class WithoutWaves, which lacks wave_law"),
    ],
)
def test_what_is_no_equation_of_state_is_told(eos, words):
    with pytest.raises(sg.BadInput, match=f"block 'gas': eos.*{words[-40:]}"):
        make_block(eos=eos)


def read_all(folder):
    """All files of a run, byte by byte."""
    return {path: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    folder = tmp_path_factory.mktemp("own") / "tube"
    return sg.run(make_tube(), folder, dumps=2, measure=measure, run={"max_steps": 4})


def add_one(simulation):
    return measure(simulation) | {"nearest": 0.0}


@pytest.mark.parametrize(
    ("again", "words"),
    [
        ({}, "would go on without furthest; give the restart what the run had"),
        ({"measure": add_one}, "would go on with nearest; give"),
        ({"measure": lambda simulation: {"far": 1.0}}, "without furthest and with far; give"),
    ],
)
def test_a_restart_with_other_columns_is_refused_before_it_writes(stopped, again, words):
    before = read_all(stopped.path)
    with pytest.raises(sg.BadInput, match=words):
        sg.restart(stopped, simulation=make_tube(), run={"max_steps": 6}, **again)
    assert read_all(stopped.path) == before


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"output": {"times": [99.0]}}, r"output\.times has 99, which is after the end"),
        ({"output": {"fields": ["roh"]}}, "output.fields has 'roh'; no block has such a field"),
        ({"gauge": [{"name": "g", "at": [0.1, 0.1], "fields": ["roh"]}]}, "roh"),
        ({"output": {"columns": ["nosuch"]}}, "there is no group of history columns"),
    ],
)
def test_what_cannot_be_written_down_is_refused_before_there_is_a_directory(
    settings, words, tmp_path
):
    place = tmp_path / "run"
    deck = {"cells": 20, "run": {"max_steps": 1}} | settings
    with pytest.raises(sg.BadInput, match=words):
        sg.load("riemann", **deck).run(place)
    with pytest.raises(sg.BadInput, match=words):
        sg.run("riemann", place, **deck)
    assert not place.exists()


def test_a_bad_hook_or_measure_leaves_no_directory(tmp_path):
    place = tmp_path / "run"
    with pytest.raises(sg.BadInput, match="a hook is a function of the case, not a int"):
        sg.run(make_tube(), place, hooks=[3])
    for wrong, words in (
        (lambda simulation: 3.0, "measure returned 3.0: it returns numbers by name"),
        (lambda simulation: {"a": "far"}, "measure returned 'far' for 'a': a number is wanted"),
        (lambda simulation: {"a,b": 1.0}, "measure returned 'a,b': a column's name"),
        (lambda simulation: {"t": 1.0}, "measure returned 't', which every history has"),
        (3.0, "measure = 3.0: a function of the simulation is wanted"),
    ):
        with pytest.raises(sg.BadInput, match=words):
            sg.run(make_tube(), place, measure=wrong)
    assert not place.exists()


def test_a_run_is_opened_by_its_directory():
    with pytest.raises(sg.BadInput, match=r"a Case is not the directory of a run"):
        sg.open(sg.load("riemann"))


SENTENCES = {  # on the command line, in Python
    "--set: mach = -1": "mach = -1",
    "defaults of tube.py and --set: no package": "defaults of tube.py and the keywords: no package",
    "--set a.b: b is not an index": "a.b: b is not an index",
    "--zoom 1,2: 4 numbers are wanted": "zoom=1,2: 4 numbers are wanted",
    "--line (0, 0, 0, 0): the same": "line=(0, 0, 0, 0): the same",
    "choose an earlier one with --at": "choose an earlier one with `at`",
    "choose another with -o, or --force to clear it": "choose another, or force=True to clear it",
    "choose another directory with -o": "choose another directory",
    "shockgrid run a.toml -o a --force; or --force": (
        "shockgrid run a.toml -o a --force; or force=True"
    ),
    "a-o b/-o c--set: d": "a-o b/-o c--set: d",
}


@pytest.mark.parametrize("words", SENTENCES)
def test_options_become_keywords_once(words):
    assert say_in_python(words) == SENTENCES[words]


def test_messages_to_python_name_no_options(tmp_path):
    """Every way into the package from Python, with a value that is refused there."""
    run = load().run(tmp_path / "run")
    wrong = [
        lambda: sg.load("noh", cells=-3),
        lambda: sg.load("interface-instability", **{"modes.7.ka0": 1}),
        lambda: sg.run("noh", run.path, output={"columns": ["not-there"]}),
        lambda: sg.run("noh", run.path),
        lambda: sg.run("noh", tmp_path, force=True),
        lambda: sg.restart(run, mach=3.0),
        lambda: sg.restart(run, cells=7, output=run.path),
        lambda: run.plot("rho", zoom=(1, 2)),
        lambda: run.plot(what="line"),
        lambda: run.plot("rho", colours="not-there"),
        lambda: run.film(zoom=(0, 1)),
        lambda: sg.film(run.path, follow=True, zoom=(0, 1, 0, 1)),
        lambda: sg.compare(run, run, rtol=-1.0),
        lambda: sg.study("noh", vary={"cells": [8, 16]}),
        lambda: sg.study("noh", output=tmp_path, vary={}),
    ]
    for call in wrong:
        with pytest.raises(sg.BadInput) as found:
            call()
        assert not re.search(r"(?<!\w)(--\w|-o\b)", str(found.value)), found.value


def test_a_problem_file_is_compared_by_its_name(tmp_path):
    """The same file under two paths is one problem; other content is named."""
    source = (ROOT / "tests/io/toy_problem.py").read_text()
    places = [tmp_path / "one" / "toy.py", tmp_path / "two" / "toy.py"]
    for place in places:
        place.parent.mkdir()
        place.write_text(source)
    runs = [sg.run(place, place.parent / "out") for place in places]
    assert sg.compare(*runs) == []
    places[1].write_text(source + "\n# other content\n")
    edited = sg.run(places[1], tmp_path / "edited")
    assert sg.compare(runs[0], edited) == []
    words, differ = compare_in_words(str(runs[0].path), str(edited.path), 0.0, 0.0)
    assert "content of the problem's file" in words and not differ
