"""The shape of the source: imports point one way, files stay short, names resolve."""

from __future__ import annotations

import ast
import gc
import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

from problems.registry import PROBLEMS, summary_line
from runs.cli.main import cli

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
        "import sys, runs.cli.main; runs.cli.main.main(['--help']); "
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


def test_no_kernel_holds_a_compiled_function_in_its_closure():
    """Such a kernel is never found in the disk cache: every process would compile it anew."""
    from numba.core.dispatcher import Dispatcher

    from runs.deck.reading import read_deck

    kernel_packages = ORDER[:3]
    for package in kernel_packages:
        for path in sorted((ROOT / package).rglob("*.py")):
            name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
            importlib.import_module(name.removesuffix(".__init__"))
    for deck in ("conical-target", "plate-on-wedge", "interface-instability", "detonation"):
        read_deck(deck).make_problem().build()  # some kernels are made for materials
    # by type: an instance check would ask proxies for what they stood for, which may be gone
    kernels = [thing for thing in gc.get_objects() if issubclass(type(thing), Dispatcher)]
    own = [kernel.py_func for kernel in kernels if hasattr(kernel, "py_func")]
    own = [function for function in own if function.__module__.startswith(kernel_packages)]
    assert len(own) > 50
    held = [
        f"{function.__module__}.{function.__qualname__}: {name}"
        for function in own
        for name, cell in zip(
            function.__code__.co_freevars, function.__closure__ or (), strict=True
        )
        if isinstance(cell.cell_contents, Dispatcher)
    ]
    assert not held
