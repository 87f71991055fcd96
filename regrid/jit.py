"""Compiling kernels: one decorator, and a disk cache that never serves stale code.

The trap this module removes: numba's cache looks at the file of the compiled function only, so
an edited helper in another module, another numba or another processor silently gives the old
answer.  Here the cache directory of a kernel is named by a hash of its module, of every project
module that it imports (transitively), of numba, numpy and the processor.
"""

from __future__ import annotations

import ast
import functools
import hashlib
import os
import shutil
import sys
import warnings
from pathlib import Path

import numba
import numpy
from llvmlite import binding
from numba.core.errors import NumbaIRAssumptionWarning
from numba.extending import register_jitable

# an internal check of numba that stumbles over inlined conditional expressions
warnings.simplefilter("ignore", NumbaIRAssumptionWarning)

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("regrid", "hydro", "problems")
KEPT_CACHES = 128


@functools.cache
def _imports_of(path: Path) -> tuple[Path, ...]:
    """Project files that the file at `path` imports directly."""
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        else:
            continue
        for name in names:
            parts = name.split(".")
            if parts[0] not in PACKAGES:
                continue
            base = ROOT.joinpath(*parts)
            found += [p for p in (base.with_suffix(".py"), base / "__init__.py") if p.is_file()]
    return tuple(dict.fromkeys(found))


@functools.cache
def _toolchain() -> str:
    host = binding.get_host_cpu_name() + binding.get_host_cpu_features().flatten()
    return f"{numba.__version__} {numpy.__version__} {sys.version} {host}"


@functools.cache
def _cache_directory(path: Path) -> str:
    """Directory for the kernels of the module at `path`; see the module's docstring."""
    files, waiting = set(), [path]
    while waiting:
        file = waiting.pop()
        if file not in files:
            files.add(file)
            waiting += _imports_of(file)
    digest = hashlib.sha256(_toolchain().encode())
    for file in sorted(files):
        digest.update(file.read_bytes())
    home = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    parent = Path(os.environ.get("SHOCKGRID_CACHE_DIR") or os.path.join(home, "shockgrid"))
    directory = parent / f"{path.stem}-{digest.hexdigest()[:16]}"
    if not directory.exists():
        _forget_oldest(parent)
    return str(directory)


def _forget_oldest(parent: Path) -> None:
    """Keep the cache from growing for ever: drop all but the newest directories."""
    try:
        aged = sorted(parent.iterdir(), key=lambda p: p.stat().st_mtime, reverse=True)
        for old in aged[KEPT_CACHES - 1 :]:
            shutil.rmtree(old, ignore_errors=True)
    except OSError:
        pass


def _name_by_closure(function) -> None:
    """Give a function made by a factory a name of its own variant.

    Machine code is linked by name, signature and a count that starts anew in every process: two
    variants of one closure, cached by two processes and loaded by a third, would pass for one
    another (seen: with two limiters, results that depended on which was loaded first).
    """
    if not function.__closure__:
        return
    words = []
    for name, cell in zip(function.__code__.co_freevars, function.__closure__, strict=True):
        value = cell.cell_contents
        value = getattr(value, "py_func", value)
        is_function = hasattr(value, "__qualname__")
        words.append(f"{name}={value.__module__}.{value.__qualname__}" if is_function else value)
    digest = hashlib.sha256(repr(words).encode()).hexdigest()[:10]
    function.__qualname__ = f"{function.__qualname__}_{digest}"


def kernel(function=None, **options):
    """Compile `function` with numba: cached, without the interpreter lock, IEEE division.

    Options are those of `numba.njit`.  No fastmath is set: the same formula gives the same bits
    in every kernel, in the vector body and the remainder of a loop, and for a mirrored flow.
    """
    if function is None:
        return functools.partial(kernel, **options)
    _name_by_closure(function)
    numba.config.CACHE_DIR = _cache_directory(Path(function.__code__.co_filename).resolve())
    return numba.njit(cache=True, nogil=True, error_model="numpy", **options)(function)


def part(function):
    """Mark a plain function as a part of kernels: always inlined, callable from Python too.

    The function stays a plain function, so that a kernel made by a factory can hold it in its
    closure and still be found in the disk cache (a compiled function there never is).
    """
    return register_jitable(inline="always")(function)


def phase(function):
    """Mark a plain function as a phase of kernels: compiled once, called, not inlined.

    Like `part` it may sit in the closure of a kernel made by a factory.
    """
    _name_by_closure(function)
    return register_jitable(error_model="numpy")(function)
