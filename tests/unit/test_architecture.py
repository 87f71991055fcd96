"""The shape of the source: imports point one way, files stay short, names resolve."""

from __future__ import annotations

import ast
import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

from problems.registry import PROBLEMS, summary_line
from runs.cli import cli

ROOT = Path(__file__).resolve().parents[2]
ORDER = ("regrid", "hydro", "problems", "runs")
LONGEST = 500
FORBIDDEN = {"utils", "common", "helpers", "misc"}
SOURCES = sorted(path for package in ORDER for path in (ROOT / package).rglob("*.py"))
EVERY = sorted([*SOURCES, *(p for f in ("tests", "benchmarks") for p in (ROOT / f).rglob("*.py"))])


def imported_modules(path: Path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path.relative_to(ROOT)}: imports are absolute"
            yield node.module or ""


def test_imports_point_one_way():
    wrong = []
    for path in SOURCES:
        floor = ORDER.index(path.relative_to(ROOT).parts[0])
        for module in imported_modules(path):
            top = module.split(".")[0]
            if top in ORDER and ORDER.index(top) > floor:
                wrong.append(f"{path.relative_to(ROOT)} imports {module}")
            if top in ("tests", "benchmarks"):
                wrong.append(f"{path.relative_to(ROOT)} imports {module}")
    assert not wrong, wrong


def test_files_are_one_idea_long():
    long = [
        f"{path.relative_to(ROOT)}: {count} lines"
        for path in EVERY
        if (count := len(path.read_text(encoding="utf-8").splitlines())) > LONGEST
    ]
    assert not long, long


def test_names_say_something():
    bad = [str(path.relative_to(ROOT)) for path in EVERY if path.stem in FORBIDDEN]
    assert not bad, bad


def test_every_module_says_what_it_is():
    mute = [
        str(path.relative_to(ROOT))
        for path in EVERY
        if path.stat().st_size and not ast.get_docstring(ast.parse(path.read_text()))
    ]
    assert not mute, mute


@pytest.mark.parametrize("name", PROBLEMS)
def test_registry_names_resolve(name):
    module, _, attribute = PROBLEMS[name].partition(":")
    spec = importlib.util.find_spec(module)
    assert spec is not None, f"{module} does not exist"
    tree = ast.parse(Path(spec.origin).read_text(encoding="utf-8"))
    assert attribute in {node.name for node in tree.body if isinstance(node, ast.ClassDef)}
    assert len(summary_line(name)) <= 90


def test_help_loads_nothing_heavy():
    script = (
        "import sys, runs.cli; runs.cli.main(['--help']); "
        "heavy = {'numpy', 'numba', 'h5py', 'matplotlib', 'scipy', 'msgspec'} & set(sys.modules); "
        "sys.exit(' '.join(heavy) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    assert "interface-instability" in done.stdout


def test_every_command_explains_itself():
    assert list(cli.commands)[:3] == ["list", "run", "restart"]
    for command in cli.commands.values():
        assert command.help
        for parameter in command.params:
            assert parameter.param_type_name == "argument" or parameter.help
