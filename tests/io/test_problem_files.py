"""Problems in files of one's own: run, looked at, restarted, refused in words."""

from __future__ import annotations

import pytest

import shockgrid as sg

FILE = '''"""Heat that spreads, from a file of one's own."""
from toy_problem import Toy as _Toy, ToyDeck

LIMIT = 300


class Problem(_Toy):
    def measure(self, evolution):
        if self.deck.density == 7.0:
            raise RuntimeError("no such heat")
        return {"hottest": float(evolution.blocks[0].heat.max()) - 0.0}
'''


@pytest.fixture
def file(toy):
    path = toy / "my_heat.py"
    path.write_text(FILE)
    return path


def test_a_file_is_run_and_looked_at_like_a_packaged_problem(file, shockgrid):
    code, out, _ = shockgrid("run", "my_heat.py", "--set", "run.t_end=0.1")
    assert code == 0 and "hottest at the end" in out
    assert sorted(path.name for path in (file.parent / "out" / "my_heat-1").glob("problem.*")) == [
        "problem.json", "problem.py",
    ]  # fmt: skip
    assert (file.parent / "out/my_heat-1/problem.py").read_text() == FILE
    code, out, _ = shockgrid("info", "out/my_heat-1")
    assert code == 0 and "my_heat.py (Heat that spreads, from a file of one's own.)" in out
    code, out, _ = shockgrid("plot", "out/my_heat-1", "--what", "cooling")
    assert code == 0 and out.strip().endswith("cooling.png")
    assert "Heat that spreads" in shockgrid("list", "my_heat.py")[1]
    code, out, _ = shockgrid("run", "my_heat.py", "--dry-run")
    assert code == 0 and "nothing was run" in out


def test_restart_goes_on_with_the_same_file_only(file, shockgrid):
    whole = shockgrid("run", "my_heat.py", "-o", "whole", "--set", "run.max_steps=20", "-q")
    part = shockgrid("run", "my_heat.py", "-o", "part", "--set", "run.max_steps=10", "-q")
    assert whole[0] == part[0] == 0
    file.write_text(FILE.replace("- 0.0", "- 1.0"))
    code, _, error = shockgrid("restart", "part", "--set", "run.max_steps=20", "-q")
    assert code == 2
    assert len(error.splitlines()) == 1 and "has changed since the run in part started" in error
    assert shockgrid("info", "part")[0] == 0  # by the copy
    assert shockgrid("plot", "part", "--what", "cooling")[0] == 0
    file.unlink()  # the copy is the file as it was
    assert shockgrid("restart", "part", "--set", "run.max_steps=20", "-q")[0] == 0
    differences = sg.compare("part", "whole")  # the dump at which the part ended, no more
    assert [(one.where, "steps 10" in one.words) for one in differences] == [("dumps", True)]


def test_a_run_by_the_full_path_of_a_file_is_compared_with_one_by_its_name(file, shockgrid):
    words = ("--set", "run.max_steps=2", "-q")
    assert shockgrid("run", "my_heat.py", "-o", "one", *words)[0] == 0
    assert shockgrid("run", str(file.resolve()), "-o", "other", *words)[0] == 0
    code, text, error = shockgrid("compare", "one", "other")
    assert (code, error) == (0, "") and "no difference" in text


def test_a_damaged_copy_is_not_run(file, shockgrid):
    assert shockgrid("run", "my_heat.py", "-o", "run", "--set", "run.max_steps=2", "-q")[0] == 0
    (file.parent / "run" / "problem.py").write_text(FILE + "\n")
    code, _, error = shockgrid("restart", "run")
    assert code == 2 and "problem.py has changed since the run started" in error
    (file.parent / "run" / "problem.json").write_text("{}")
    code, _, error = shockgrid("plot", "run", "--what", "cooling")
    assert code == 2 and "missing or damaged" in error
    assert shockgrid("plot", "run")[0] == 0  # fields need no problem


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("def f(:\n", "line 1: this is not valid Python"),
        ("x = 1\ny = undefined_name\n", "line 2: the file cannot be run (NameError"),
        ("import no_such_module_anywhere\n", "line 1: the file cannot be run (ModuleNotFoundError"),
        ("x = 1\n", "holds no problem: it needs a class derived from shockgrid.Problem"),
        (FILE + "\nclass Other(_Toy):\n    pass\n", "holds 2 problems (Problem, Other)"),
        ("raise SystemExit(3)\n", "line 1: the file cannot be run (SystemExit: 3)"),
    ],
)
def test_a_file_that_is_no_problem_is_refused_in_a_sentence(file, shockgrid, text, words):
    file.write_text(text)
    for command in ("run", "check"):
        code, _, error = shockgrid(command, "my_heat.py")
        assert code == 2 and words in error and len(error.splitlines()) == 1, error
    assert not (file.parent / "out").exists()


def test_missing_file_wrong_key_and_a_mistake_in_the_file(file, shockgrid):
    code, _, error = shockgrid("run", "nowhere.py")
    assert (code, error.strip()) == (2, "shockgrid: nowhere.py does not exist")
    code, _, error = shockgrid("run", "my_heat.py", "--set", "celis=3")
    assert code == 2 and "did you mean 'cells'?" in error
    code, _, error = shockgrid("run", "my_heat.py", "--set", "density=7")
    line = error.strip().splitlines()[-1]
    assert code == 2 and "my_heat.py, line 10: a mistake in this file (RuntimeError" in line
