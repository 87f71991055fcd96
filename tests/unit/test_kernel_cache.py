"""The disk cache of kernels: code of a user's own, edited, is compiled anew and only then."""

from __future__ import annotations

import collections
import gc
import importlib
import os
import subprocess
import sys
import types
from pathlib import Path

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

from builders import ROOT
from regrid.barrier.line_cg import make_solver
from regrid.jit import KernelCache, compiled_once, compute_contents_digest, inlined, kernel

LAW = """
from hydro.eos import IdealGas
from regrid.jit import inlined
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
from hydro.interior.scratch import allocate
from hydro.perimeter.strips import make_side_kernels
from hydro.rim import make_rim
from laws import Law

nodes = np.array(np.meshgrid(np.arange(4.0), np.arange(4.0), indexing="ij"))
state = np.full((4, 5, 5), 2.0)
rim, start = make_rim(12), make_side_kernels(Law).start_sides
start(state, nodes, Law(1.5).parameters, np.zeros(12, np.bool_), allocate(1), rim.rows)
print(rim.c[0] ** 2, sum(start.stats.cache_hits.values()))
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
    laws, exponents = tmp_path / "laws.py", tmp_path / "exponents.py"
    laws.write_text(LAW)
    exponents.write_text(EXPONENTS)
    assert run(tmp_path) == (pytest.approx(3.0), 0)
    assert run(tmp_path) == (pytest.approx(3.0), 1)
    laws.write_text(LAW.replace("FACTOR * parameters[0]", "FACTOR + parameters[0]"))
    assert run(tmp_path) == (pytest.approx(3.5), 0)
    exponents.write_text("EXPONENT = 2.0\n")  # a number in a third file
    assert run(tmp_path) == (pytest.approx(2.75), 0)
    laws.write_text("# a comment moves its lines\n" + LAW)
    exponents.write_text(EXPONENTS)
    assert run(tmp_path) == (pytest.approx(3.0), 1)


CALLED = """
from regrid.jit import kernel

@kernel
def add(values, more):
    for k in range(values.size):
        values[k] += more
"""
CALLING = """
import numpy as np
from called import add
from regrid.jit import kernel

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
    """Of a loaded kernel the intermediate code is read when somebody asks for it."""
    (tmp_path / "called.py").write_text(CALLED)
    for factor, hits in ((3.0, 0), (4.0, 1), (4.0, 1)):  # compiled, compiled anew, loaded
        (tmp_path / "calling.py").write_text(CALLING.replace("FACTOR", str(factor)))
        assert run(tmp_path, script="calling.py") == (2.0 + factor, hits)


def test_without_a_place_for_the_cache_kernels_run_all_the_same(tmp_path):
    (tmp_path / "laws.py").write_text(LAW)
    (tmp_path / "exponents.py").write_text(EXPONENTS)
    (tmp_path / "taken").write_text("a file, not a folder")
    assert run(tmp_path, "taken") == (pytest.approx(3.0), 0)


HELPER = "def helper(x):\n    return x + {}\n"
CALLER = "def caller(x, y={default}):\n    return {call} * NUMBER\n"


def digest(call="helper(x)", helper="1", number=2.0, default="0.0", comment="") -> str:
    """Digest of a function built from texts, in a module of its own."""
    space = {"NUMBER": number, "__name__": "laws"}
    exec(comment + HELPER.format(helper) + CALLER.format(call=call, default=default), space)
    return compute_contents_digest(space["caller"])


def test_the_digest_follows_what_a_function_refers_to():
    assert digest() == digest() == digest(comment="# moved\n\n")
    edited = [
        digest(call="helper(x + 1)"),
        digest(helper="2"),
        digest(helper="1.0"),
        digest(number=np.nextafter(2.0, 3.0)),
        digest(number=2),
        digest(number=(2.0, 1.0)),
        digest(number=np.array([2.0, 1.0])),
        digest(number=np.array([2.0, 3.0])),
        digest(default="1.0"),
        digest(call="(lambda z: helper(z))(x)"),
    ]
    assert len({digest(), *edited}) == len(edited) + 1


def make_module(name, **contents):
    module = types.ModuleType(name)
    vars(module).update(contents)
    return module


@pytest.mark.parametrize("text", ["def f(x):\n    return x * user.numbers.K\n",
                                  "def make(m):\n    def f(x):\n        return x * m.numbers.K\n"
                                  "    return f\nf = make(user)\n"])  # fmt: skip
def test_the_digest_follows_numbers_in_modules_of_modules(text):
    digests = set()
    for number in (2.0, 6.0, 2.0):
        user = make_module("user", numbers=make_module("user.numbers", K=number))
        space = {"user": user, "__name__": "laws"}
        exec(text, space)
        digests.add(compute_contents_digest(space["f"]))
    assert len(digests) == 2


def test_the_digest_knows_fields_and_how_a_function_is_compiled():
    space = {"__name__": "laws"}
    exec("def f(x):\n    return P.a\ndef g(x):\n    return h(x)\n", space)
    digests = set()
    for fields in ("a b", "b a"):
        space["P"] = collections.namedtuple("P", fields)(1.0, 2.0)
        digests.add(compute_contents_digest(space["f"]))
    for mark in (inlined, compiled_once):
        exec("def h(x):\n    return x\n", space)
        space["h"] = mark(space["h"])
        digests.add(compute_contents_digest(space["g"]))
    assert len(digests) == 4


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


def test_options_make_another_kernel():
    """One text compiled for one thread and for several: neither is taken for the other."""
    one, several = make_solver(False), make_solver(True)
    assert compute_contents_digest(one) != compute_contents_digest(several)
    assert one.py_func.__qualname__ != several.py_func.__qualname__


def test_our_own_kernels_have_digests():
    """What has none, for something in it that cannot be written, gets another one each time."""
    for module in ("regrid.barrier.regridder", "regrid.hexahedra.regridder", "hydro.simulation"):
        importlib.import_module(module)
    things = [thing for thing in gc.get_objects() if issubclass(type(thing), Dispatcher)]
    names = ("regrid", "hydro")
    kernels = [one for one in things if str(getattr(one, "__module__", "")).startswith(names)]
    assert len(kernels) > 100
    digests = [[compute_contents_digest(one) for one in kernels] for _ in range(2)]
    assert digests[0] == digests[1]


def test_functions_that_call_each_other_have_a_digest():
    space = {"__name__": "laws"}
    exec("def a(n):\n    return b(n)\n\ndef b(n):\n    return a(n) if n else 0\n", space)
    assert compute_contents_digest(space["a"]) != compute_contents_digest(space["b"])


def make_sum_of_rows(allocates):
    """A kernel that hands each row of an array to another one."""

    @kernel(allocates=allocates)
    def add_row(row):
        total = 0.0
        for k in range(row.shape[0]):
            total += row[k]
        return total

    @kernel(allocates=allocates)
    def add_rows(rows):
        total = 0.0
        for i in range(rows.shape[0]):
            total += add_row(rows[i, 1:])
        return total

    return add_rows


def test_kernels_that_make_no_arrays_count_no_references(monkeypatch):
    monkeypatch.setattr(KernelCache, "load_overload", lambda *_: None)  # stored code has no text
    rows = np.arange(12.0).reshape(3, 4)
    for allocates in (True, False):
        add_rows = make_sum_of_rows(allocates)
        assert add_rows(rows) == rows[:, 1:].sum()
        counts = any("NRT_incref" in text for text in add_rows.inspect_llvm().values())
        assert counts == allocates
