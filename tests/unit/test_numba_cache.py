"""Kernels by numba's public interface alone: what is used with a release that is not known."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest

from builders import ROOT
from shockgrid.regrid import jit
from shockgrid.regrid.compilation import numba_cache
from shockgrid.regrid.compilation.first_calls import count_compiling, interpreted
from shockgrid.regrid.compilation.numba_cache import CHECKSUMS, make_kernel

OPTIONS = {"nogil": True, "error_model": "numpy"}
NEXT_RELEASES = {  # what the next numba may do to a name that it keeps to itself
    "another number": (
        "import types, numba\nnumba.version_info = types.SimpleNamespace(short=(0, jit_after))\n"
    ).replace("jit_after", str(jit.LAST_TRIED[1] + 1)),
    "a class is gone": "import numba.core.codegen\ndel numba.core.codegen.JITCodeLibrary\n",
    "a function is gone": "import numba.core.environment as e\ndel e.lookup_environment\n",
}
START = """
import numpy as np
from shockgrid.regrid.jit import backend, inlined, kernel

@inlined
def double(x):
    return 2.0 * x

@kernel(allocates=False)
def double_all(values):
    for k in range(values.size):
        values[k] = double(values[k])

values = np.ones(3)
double_all(values)
print(backend.__name__, values.sum(), len(double_all.signatures))
"""
# numba documents these two for extensions (extending/low-level)
DOCUMENTED = {"numba.core.cgutils", "numba.core.types"}


@pytest.fixture
def cache(tmp_path, monkeypatch) -> Path:
    monkeypatch.setenv("SHOCKGRID_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(numba_cache, "_made", [])
    return tmp_path


def call_again(factor: float = 2.0, times: float = 1.5) -> tuple[float, int]:
    """A kernel of this factor as another process makes it: its value, how often numba's cache had
    it."""

    def multiply(x):
        return factor * x

    made = make_kernel(multiply, OPTIONS)
    return made(times), sum(made.stats.cache_hits.values())


def list_numbas_files(cache: Path) -> list[Path]:
    return [path for path in cache.rglob("*") if path.suffix in (".nbi", ".nbc")]


def test_numba_finds_a_kernel_again_and_only_the_same_one(cache):
    before = count_compiling()[1]
    assert [call_again(2.0), call_again(2.0), call_again(3.0)] == [(3.0, 0), (3.0, 1), (4.5, 0)]
    assert count_compiling()[1] == before + 2
    assert call_again(2.0, 3) == (6.0, 0)  # for another type
    assert call_again(2.0, 3) == (6.0, 1)
    assert call_again(2.0) == (3.0, 1)


def test_numbas_files_that_are_damaged_are_compiled_anew(cache):
    call_again()
    for suffix in (".nbi", ".nbc"):
        (file,) = [path for path in list_numbas_files(cache) if path.suffix == suffix]
        whole = file.read_bytes()
        for damaged in (
            whole[:-1] + bytes([whole[-1] ^ 1]),
            whole[: len(whole) // 2] + bytes([whole[len(whole) // 2] ^ 4, *whole[-9:]]),
            whole[:99],
            b"",
        ):
            file.write_bytes(damaged)
            assert call_again() == (3.0, 0)
            assert call_again() == (3.0, 1)
    (file,) = cache.rglob(CHECKSUMS)
    for damaged in (b"", b"\xff" + file.read_bytes(), file.read_bytes()[1:]):
        file.write_bytes(damaged)
        assert call_again() == (3.0, 0)


def test_a_kernel_is_compiled_without_a_folder_for_it(cache, monkeypatch):
    cache.joinpath("file").touch()
    monkeypatch.setenv("SHOCKGRID_CACHE_DIR", str(cache / "file"))
    assert call_again() == (3.0, 0)
    assert not list_numbas_files(cache)


def test_a_kernel_is_compiled_where_the_disk_is_full(cache, monkeypatch):
    def add_one(x):
        return x + 1.0

    def add_two(x):
        return added(added(x))

    def fail(*names):
        raise OSError("the disk is full")

    monkeypatch.setattr(os, "replace", fail)
    added = make_kernel(add_one, OPTIONS)
    twice = make_kernel(add_two, OPTIONS)
    assert twice(1.0) == 3.0
    assert added(1.0) == 2.0
    assert not list_numbas_files(cache)


def test_a_kernel_calls_another_and_is_python_where_it_is_interpreted(cache):
    def fill(values):
        for k in range(values.size):
            values[k] += 1.0

    def fill_twice(values):
        filled(values)
        filled(values)

    for hits in (0, 1):
        filled = make_kernel(fill, OPTIONS)
        twice = make_kernel(fill_twice, OPTIONS)
        values = np.zeros(3)
        with interpreted():
            twice(values)
        assert not numba_cache._made
        twice(values)
        assert values.tolist() == [4.0] * 3
        assert sum(twice.stats.cache_hits.values()) == hits
        numba_cache._made.clear()


@pytest.mark.parametrize("change", NEXT_RELEASES.values(), ids=NEXT_RELEASES)
def test_another_release_of_numba_does_not_break_the_start(tmp_path, change):
    environment = os.environ | {
        "SHOCKGRID_CACHE_DIR": str(tmp_path / "cache"),
        "PYTHONPATH": str(ROOT),
    }
    script = tmp_path / "start.py"
    script.write_text(change + START)
    done = subprocess.run(
        [sys.executable, str(script)], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["shockgrid.regrid.compilation.numba_cache", "6.0", "1"]
    assert done.stderr == ""


def test_the_installed_numba_is_a_known_one():
    """Where this fails: run all tests with it, then raise LAST_TRIED, or mend `machine_code`."""
    assert numba.version_info.short <= jit.LAST_TRIED
    assert jit.backend.__name__ == "shockgrid.regrid.compilation.machine_code"


def test_one_file_uses_what_numba_keeps_to_itself():
    found = []
    for package in ("regrid", "hydro", "problems", "runs", "shockgrid"):
        for path in ROOT.joinpath(package).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                names = []
                if isinstance(node, ast.Import):
                    names = [alias.name for alias in node.names]
                elif isinstance(node, ast.ImportFrom):
                    names = [f"{node.module}.{alias.name}" for alias in node.names]
                inside = [name for name in names if re.match(r"numba\.(core|np|_)", name)]
                found += [path.name for name in inside if name not in DOCUMENTED]
    assert set(found) == {"machine_code.py"}
