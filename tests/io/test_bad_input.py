"""Whatever is wrong with what a person gave: one sentence, the right exit code, no traceback."""

from __future__ import annotations

from pathlib import Path

import h5py
import pytest

from shockgrid.runs.store.directory import RunDirectory
from shockgrid.runs.store.reader import RunData


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("cels=3", "there is no key 'cels'; did you mean 'cells'?"),
        ("run.tend=3", "no key 'run.tend'; did you mean 'run.t_end'?"),
        ("t_end=3", "no key 't_end'; did you mean 'run.t_end'?"),
        ("output.dmps=3", "did you mean 'output.dumps'?"),
        ("modes=[{numer=1}]", "no key 'modes.0.numer'; did you mean 'modes.number'?"),
        ("start={kind='cold',temperature=2}", "'start.temperature'; did you mean"),
        ("cells=many", 'cells = "many"; it must be a whole number'),
        ("cells=2.5", "cells = 2.5; it must be a whole number"),
        ("density=-1", "density = -1; it must be a number greater than 0"),
        ("density=nan", "density = nan; it must be a number"),
        ("density=1\ncells=2", 'density = "1\\ncells=2"; it must be a number'),
        ("density=true", "density = true; it must be a number"),
        ("run.threads=0", "run.threads = 0; it must be a whole number of at least 1"),
        ("shape=rund", '"flat" or "wavy"'),
        ("start.kind=warm", "one of 'hot', 'cold'"),
        ("start={temperature=3}", "start lacks the key 'kind'"),
        ("modes=[{number=0}]", "modes.0.number = 0"),
        ("modes=[{number=1", "is not valid TOML"),
        ("run=3", "run = 3; it must be a table, such as { t_end = ..."),
        ("run.t_end.x=2", "run.t_end is a value, not a table"),
        ("cells", "--set cells: its value is missing; write --set cells=VALUE"),
        ("=3", "the form is key=value"),
        ("cells=7", "cells = 7 and shape 'wavy' do not go together"),
        ("problem=riemman", "did you mean 'riemann'?"),
        ("density=inf", "density = inf; it must be a number greater than 0, finite"),
        ("regrid.name=barrier", "--set: there is no key 'regrid'"),
    ],
)
def test_settings(shockgrid, setting, words):
    code, out, error = shockgrid("check", "toy", "--set", setting)
    assert code == 2 and out == ""
    assert words in error and error.count("\n") == 1, error


NO_STEADY = ("left.heat=adiabatic", "left.value=0", "right.heat=flux", "right.value=1")
NO_HEAT = [f"{side}.{key}" for side in ("left", "right") for key in ("heat=adiabatic", "value=0")]


@pytest.mark.parametrize(
    ("deck", "words"),
    [
        (("flyer-target", "plates.0.gap=1e-4"), "nothing is before the first plate"),
        (("flyer-target", "plates=[{}]"), "plates"),
        (("plate-on-wedge-apart", "refinement=2"), "finer at A only where the plate lies"),
        (("cavity", "material=air"), "has no such shock"),
        (("heated-cavity", "rayleigh=-5"), "Ra = -5 is negative"),
        (("heated-cavity", "rayleigh=nan"), "rayleigh"),
        (("heated-cavity", "tilt=inf"), "tilt"),
        (("heated-cavity", "prandtl=0"), "Pr = 0 must be positive"),
        (("heated-cavity", "top.value=1"), "top.value = 1 contradicts top.heat = 'adiabatic'"),
        (("heated-cavity", *NO_STEADY), "which no steady state can"),
        (("heated-cavity", *NO_HEAT), "no wall is isothermal"),
        (("convection-1d", "rayleigh=0"), "nothing would rise"),
        (("riemann", "cells=2000", "grading=1.1"), "with grading 1.1 the last of 1000 cells"),
        (("vortex", "beta=20"), "beta = 20; it must be a number of at least 0 and at most 10"),
    ],
)
def test_keys_that_contradict_each_other(shockgrid, deck, words):
    name, *settings = deck
    code, _, error = shockgrid("run", name, *(f"--set={setting}" for setting in settings), "-q")
    assert code == 2 and words in error and error.count("\n") == 1, error


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("cells = 8", 'a deck starts with problem = "name"'),
        ('problem = "tyo"', "there is no problem 'tyo'; did you mean 'toy'?"),
        ("problem = 3", "is not a name"),
        ('problem = "toy"\ncells = ', "is not valid TOML"),
        ('problem = "toy"\n[run]\nt_end = "soon"', 'deck.toml: run.t_end = "soon"; it must be'),
        (b"\xff\xfe", "not a text file in UTF-8"),
    ],
)
def test_deck_files(shockgrid, content, words):
    content = content.encode() if isinstance(content, str) else content
    Path("deck.toml").write_bytes(content)
    code, _, error = shockgrid("run", "deck.toml")
    assert code == 2 and words in error and "deck.toml" in error, error
    assert not Path("out").exists()


FAST = ("--set=left={rho=1,p=1,u=1e300}", "--set=right={rho=1,p=1}")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("run", "riemann", *FAST), "and --set: a number is too large"),
        (("run", "vortex", "--set=cells=99999"), "take fewer cells"),
        (("run", "toy", "-o", "notes"), "notes is a file, a run needs a folder"),
        (("run", "toy", "-o", ""), "needs a name"),
    ],
)
def test_what_cannot_be_run_is_said_before_anything_is_written(shockgrid, words, said):
    Path("notes").touch()
    code, out, error = shockgrid(*words)
    assert code == 2 and said in error and error.count("\n") == 1 and not out, error
    assert [path.name for path in Path().iterdir()] == ["notes"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["run", "missing.toml"], "missing.toml does not exist"),
        (["run", "tyo"], "did you mean 'toy'?"),
        (["run", "mushroom"], "did you mean 'interface-instability-mushroom' or"),
        (["compare", ".", "nowhere"], "shockgrid: nowhere does not exist"),
        (["run", "."], "is a folder; give a problem"),
        (["rnu"], "did you mean 'run'?"),
        (["run"], "Missing argument"),
        (["run", "toy", "--threads", "none"], "--threads"),
        (["info", "nowhere"], "nowhere does not exist"),
        (["plot", "."], "not a run directory"),
        (["check", "interface-instability", "--set", "first=Al"], 'first = { material = "Al" }'),
        (["restart", "nowhere"], "nowhere does not exist"),
        (["list", "tyo"], "did you mean 'toy'?"),
    ],
)
def test_command_lines(shockgrid, words, said):
    code, _, error = shockgrid(*words)
    assert code == 2 and said in error, error


def test_output_directory_in_use(shockgrid):
    assert shockgrid("run", "toy", "-q", "-o", "run", "--set", "run.max_steps=2")[0] == 0
    before = {path: path.stat().st_mtime_ns for path in Path("run").rglob("*")}
    code, _, error = shockgrid("run", "toy", "-o", "run")
    assert code == 2 and "run is not empty" in error and "--force" in error
    assert before == {path: path.stat().st_mtime_ns for path in Path("run").rglob("*")}
    with RunDirectory("run").claimed():
        code, _, error = shockgrid("restart", "run")
        assert code == 2 and "in use" in error
    assert shockgrid("run", "toy", "-q", "-o", "run", "--force")[0] == 0
    Path("mine").mkdir()
    Path("mine/thesis.txt").write_text("years of work")
    code, _, error = shockgrid("run", "toy", "-o", "mine", "--force")
    assert code == 2 and "holds no run" in error
    assert Path("mine/thesis.txt").read_text() == "years of work"


@pytest.mark.parametrize("content", [b"", b"no HDF5 at all", b"\x89HDF\r\n\x1a\n" + b"\0" * 100])
def test_unreadable_dump(shockgrid, content):
    Path("broken.h5").write_bytes(content)
    code, _, error = shockgrid("info", "broken.h5")
    assert code == 2 and "broken.h5" in error and error.count("\n") == 1


def test_foreign_hdf5(shockgrid):
    with h5py.File("other.h5", "w") as file:
        file["x"] = 1
    assert "not a shockgrid dump" in shockgrid("info", "other.h5")[2]


def test_physics_failure_names_the_restart_point(shockgrid):
    code, _, error = shockgrid("run", "toy", "-q", "-o", "run", "--set", "fail_at=40")
    assert code == 3
    assert "block 'left', cell (1, 2)" in error
    step = RunData("run").restart_step
    assert f"last restart point is step {step} (shockgrid restart run)" in error


def test_own_mistake_has_no_traceback(shockgrid, monkeypatch):
    import toy_problem

    monkeypatch.setattr(toy_problem.ToyEvolution, "advance", lambda self: 1 / 0)
    code, _, error = shockgrid("run", "toy", "-q")
    assert code == 70 and "ZeroDivisionError" in error and "--debug" in error
    from shockgrid.runs.cli.main import main

    with pytest.raises(ZeroDivisionError):
        main(["run", "toy", "-q", "--debug"])
