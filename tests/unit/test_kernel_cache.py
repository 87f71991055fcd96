"""The disk cache of kernels: code of a user's own, edited, is compiled anew and only then."""

from __future__ import annotations

import contextlib
import io
import os
import pickle
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from builders import ROOT
from shockgrid.regrid.compilation import first_calls, kept_files
from shockgrid.regrid.compilation.contents import compute_contents_digest
from shockgrid.regrid.compilation.first_calls import read_clock
from shockgrid.regrid.jit import kernel
from shockgrid.runs.march import compiling

LAW = """
from shockgrid.hydro.eos import IdealGas
from shockgrid.regrid.jit import inlined
from exponents import EXPONENT

FACTOR = 2.0

@inlined
def sound_speed_squared(rho, p, parameters):
    return FACTOR * parameters[0] * p / rho**EXPONENT

class Law(IdealGas):
    sound_speed_squared_part = staticmethod(sound_speed_squared)
"""
EXPONENTS = "EXPONENT = 1.0\n"
SCRIPT = """
import numpy as np
from shockgrid.hydro.interior.cell_fields import make_fill_sound_speed
from laws import Law

state, sound = np.full((4, 5, 5), 2.0), np.zeros((3, 3))
fill = make_fill_sound_speed(Law)
fill(state, Law(1.5).parameters, 0, 3, sound)
print(sound[0, 0] ** 2, sum(fill.stats.cache_hits.values()))
"""


LEAST = """
import sys
import numpy as np
from shockgrid.regrid.jit import kernel

@kernel
def find_least(x):
    return np.median(x) + x.min()

print(find_least(np.ones(4)), int("scipy.linalg" in sys.modules))
"""


def run(folder: Path, cache: str = "cache", script: str | None = None) -> tuple[float, int]:
    """What a script prints: a number (sound speed squared at rho = p = 2), and how often code came
    from the cache."""
    environment = os.environ | {
        "SHOCKGRID_CACHE_DIR": str(folder / cache),
        "PYTHONPATH": os.pathsep.join([str(ROOT), str(folder)]),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    done = subprocess.run(
        [sys.executable, *([script] if script else ["-c", SCRIPT])],
        capture_output=True, text=True, cwd=folder, env=environment, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    value, hits = done.stdout.split()
    return float(value), int(hits)


def test_an_edited_equation_of_state_is_compiled_anew(tmp_path):
    laws = tmp_path / "laws.py"
    exponents = tmp_path / "exponents.py"
    laws.write_text(LAW)
    exponents.write_text(EXPONENTS)
    assert run(tmp_path) == (pytest.approx(3.0), 0)
    laws.write_text("# a comment moves its lines\n" + LAW)
    assert run(tmp_path) == (pytest.approx(3.0), 1)
    laws.write_text(LAW.replace("FACTOR * parameters[0]", "FACTOR + parameters[0]"))
    exponents.write_text("EXPONENT = 2.0\n")
    assert run(tmp_path) == (pytest.approx(2.75), 0)


CALLED = """
from shockgrid.regrid.jit import kernel

@kernel
def add(values, more):
    for k in range(values.size):
        values[k] += more
"""
CALLING = """
import numpy as np
from called import add
from shockgrid.regrid.jit import kernel

@kernel
def add_twice(values, more):
    add(values, more)
    add(values, FACTOR * more)

values = np.zeros(2)
add(values, 1.0)  # from the disk, where it is there
add_twice(values, 1.0)
print(values[0], sum(add.stats.cache_hits.values()))
"""


def test_a_new_kernel_can_call_one_that_comes_from_the_disk(tmp_path):
    (tmp_path / "called.py").write_text(CALLED)
    for factor, hits in ((3.0, 0), (4.0, 1), (4.0, 1)):  # compiled, compiled anew, loaded
        (tmp_path / "calling.py").write_text(CALLING.replace("FACTOR", str(factor)))
        assert run(tmp_path, script="calling.py") == (2.0 + factor, hits)


HELPERS = {
    "ufunc": "@numba.vectorize\ndef h(x):\n    return x * K\n",
    "callback": "@numba.cfunc('float64(float64)')\ndef h(x):\n    return x * K\n",
    "class of numba": (
        "@numba.experimental.jitclass([('a', numba.float64)])\nclass Line:\n"
        "    def __init__(self, a):\n        self.a = a\n"
        "    def at(self, x):\n        return self.a + K * x\n"
        "def h(x):\n    return Line(1.0).at(x)\n"
    ),
    "attribute of a class": "class Law:\n    C = K\ndef h(x):\n    return x * Law.C\n",
    "function in a class": (
        "class Law:\n    @staticmethod\n    def at(x):\n        return x * K\n"
        "def h(x):\n    return Law.at(x)\n"
    ),
    "default of a field": (
        "class Law(typing.NamedTuple):\n    a: float = K\ndef h(x):\n    return Law().a * x\n"
    ),
    "namespace": "law = types.SimpleNamespace(k=K)\ndef h(x):\n    return law.k * x\n",
    "partial": "def g(k, x):\n    return k * x\nh = functools.partial(g, K)\n",
    "number beside it": "FACTOR = K\ndef h(x):\n    return FACTOR * x\n",
    "formula": "def h(x):\n    return x + K\n",
}


@pytest.mark.parametrize("text", HELPERS.values(), ids=HELPERS)
def test_the_digest_follows_what_users_write_helpers_as(text):
    head = "import functools, types, typing, numba, numba.experimental\n"
    digests = []
    for number in ("2.0", "3.0", "2.0"):
        space = {"__name__": "laws"}
        exec(f"{head}{text.replace('K', number)}def f(x):\n    return h(x)\n", space)
        digests.append(compute_contents_digest(space["f"]))
    assert digests[0] == digests[2] != digests[1]


def test_the_clock_of_steps_stands_while_a_kernel_is_compiled(monkeypatch):
    wall = SimpleNamespace(now=1000.0)

    def compile_for_a_minute(dispatcher, *arguments):
        wall.now += 60.0
        assert read_clock() == began
        return dispatcher.py_func

    @kernel
    def double(x):
        return 2.0 * x

    clocks = SimpleNamespace(perf_counter=lambda: wall.now, thread_time=lambda: wall.now)
    monkeypatch.setattr(first_calls, "time", clocks)
    monkeypatch.setattr(type(double), "_compile_for_args", compile_for_a_minute)
    began = read_clock()
    assert double(1.5) == 3.0
    assert read_clock() == began
    wall.now += 1.0
    assert read_clock() == began + 1.0


COUNTS = [(0, 0, 0.0), (4, 9, 1.0), (9, 20, 4.0), (30, 60, 40.0)]  # ready, compiled, seconds


def watch(monkeypatch, counts, terminal=False, helped=True) -> tuple[str, list]:
    """What is said where the kernels are counted so, and the programs that are started."""
    programs = []
    stream = io.StringIO()
    numbers = iter(counts)
    looks = iter([*[False] * (len(counts) - 1), True])

    def start_process(program, **options):
        programs.append(program)
        process = contextlib.ExitStack()
        process.terminate = lambda: None
        return process

    monkeypatch.setattr(compiling, "_told", False)
    monkeypatch.setattr(compiling, "count_compiling", lambda: next(numbers))
    monkeypatch.setattr(compiling.subprocess, "Popen", start_process)
    monkeypatch.setattr(stream, "isatty", lambda: terminal, raising=False)
    done = SimpleNamespace(wait=lambda seconds: next(looks))
    compiling._watch(done, stream, False, helped)
    return stream.getvalue(), programs


def test_a_second_process_compiles_where_much_is_compiled(monkeypatch):
    program = [sys.executable, "-m", "shockgrid.runs.march.compiling"]
    assert watch(monkeypatch, COUNTS)[1] == [program]
    assert watch(monkeypatch, COUNTS, helped=False)[1] == []
    loaded = [(0, 0, 0.0), (30, 0, 4.0), (40, 2, 6.0)]
    assert watch(monkeypatch, loaded)[1] == []


def test_compiling_is_said_once_and_counted_in_a_terminal(monkeypatch):
    assert watch(monkeypatch, COUNTS)[0].count("compiling kernels, kept for later runs") == 1
    bar = watch(monkeypatch, COUNTS, terminal=True)[0]
    assert "compiling kernels, kept for later runs: 30 of about 30|" in bar
    assert watch(monkeypatch, [(0, 0, 0.0), (9, 0, 9.0)])[0] == ""  # from the disk


@pytest.mark.parametrize(("compilers", "helped"), [("", True), ("1", False)])
def test_one_process_compiles_where_only_one_may(monkeypatch, compilers, helped):
    told = []
    monkeypatch.setenv("SHOCKGRID_COMPILERS", compilers)
    monkeypatch.setattr(compiling.os, "cpu_count", lambda: 2)
    monkeypatch.setattr(
        compiling, "_watch", lambda done, stream, quiet, helped: told.append(helped)
    )
    with compiling.compiling(quiet=True), compiling.compiling(quiet=True):
        pass
    assert told == [helped]


def test_code_that_uses_numpy_is_loaded_without_numba_np_and_scipy(tmp_path):
    script = tmp_path / "least.py"
    script.write_text(LEAST)
    assert run(tmp_path, script=str(script))[0] == 2.0
    assert run(tmp_path, script=str(script)) == (2.0, 0)


FLIPPED_PLACES = 40  # spread over a file of the cache, its first and last byte among them


def list_damaged(whole: bytes) -> list[bytes]:
    """What a file may have become: one bit flipped somewhere, cut off, longer, another file."""
    damaged = []
    for k in range(FLIPPED_PLACES):
        flipped = bytearray(whole)
        flipped[k * (len(whole) - 1) // (FLIPPED_PLACES - 1)] ^= 1 << k % 8
        damaged.append(bytes(flipped))
    damaged += [whole[:cut] for cut in (0, 1, 31, 32, 33, len(whole) // 2, len(whole) - 1)]
    return [*damaged, whole + b"\0", bytes(len(whole)), pickle.dumps((1, 2))]


def test_a_damaged_file_is_compiled_anew(tmp_path, monkeypatch):
    monkeypatch.setenv("SHOCKGRID_CACHE_DIR", str(tmp_path))

    def compile_and_call():
        @kernel
        def double(x):
            return 2.0 * x

        assert double(1.5) == 3.0
        return double

    compile_and_call()
    (file,) = tmp_path.joinpath("kernels").iterdir()
    whole = file.read_bytes()
    assert compile_and_call().stats.cache_hits
    for damaged in list_damaged(whole):  # each would run, crash or compute something else
        file.write_bytes(damaged)
        with pytest.raises(ValueError, match="damaged"):
            kept_files.read_kept(file)
    for place in (len(whole) // 3, len(whole) // 2, len(whole) - 1):
        file.write_bytes(whole[:place] + bytes([whole[place] ^ 4]) + whole[place + 1 :])
        assert not compile_and_call().stats.cache_hits
        assert len(kept_files.read_kept(file)) > 0.9 * len(whole)
    file.write_bytes(
        kept_files.compute_checksum(b"no kernel") + b"no kernel"
    )  # sound, of another numba
    assert not compile_and_call().stats.cache_hits


def test_what_was_computed_is_remembered_until_its_file_is_damaged(tmp_path, monkeypatch):
    monkeypatch.setenv("SHOCKGRID_CACHE_DIR", str(tmp_path))
    asked = []

    def remember(words, first=1.0):
        return kept_files.remember("sum", words, lambda: asked.append(words) or [first, 2.0])

    with first_calls.interpreted():
        assert remember("a", 0.0) == [0.0, 2.0]
    assert [remember("a"), remember("a"), remember("b")] == [[1.0, 2.0]] * 3
    assert asked == ["a", "a", "b"]
    for file in tmp_path.joinpath("kernels").iterdir():
        contents = bytearray(file.read_bytes())
        contents[-5] ^= 1
        file.write_bytes(contents)
    assert remember("a") == [1.0, 2.0] and asked == ["a", "a", "b", "a"]


def test_one_text_with_two_options_has_two_machine_codes(tmp_path, monkeypatch):
    # in a forked process the code that is compiled for threads ends a run
    def double(x):
        return 2.0 * x

    monkeypatch.setenv("SHOCKGRID_CACHE_DIR", str(tmp_path))
    for error_model in ("python", "numpy"):
        assert kernel(error_model=error_model)(double)(1.0) == 2.0
    assert len(list((tmp_path / "kernels").iterdir())) == 2
