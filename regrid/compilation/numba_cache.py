"""Kernels by numba's public interface alone: its own cache, in a folder for each kernel.

numba finds its files by the place and the time of a kernel's source, and reads them unchecked.
Here the folder is named by a digest of everything that the kernel consists of, and holds a list of
the checksums of numba's files: a folder that differs from its list is emptied before numba looks.
Slower to start than `machine_code`, which is used where numba's insides are known.
"""

from __future__ import annotations

import atexit
import contextlib
import functools
import hashlib
import shutil
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numba
from numba.extending import typeof_impl

from shockgrid.regrid.compilation.contents import compute_contents_digest
from shockgrid.regrid.compilation.first_calls import (
    is_interpreted,
    note_compiled,
    prepare_compiler,
    stopped_clock,
)
from shockgrid.regrid.compilation.kept_files import VERSIONS, find_cache
from shockgrid.regrid.compilation.processor import find_machine

CHECKSUMS = "checksums"  # file of a kernel's folder: a line for each other file in it
# what a kernel shows of the dispatcher that numba makes of it
SHOWN = ("overloads", "signatures", "stats", "inspect_asm", "inspect_llvm", "inspect_types")
MOST_UNWRITTEN_FILES = 100  # of a kernel and those that it calls
# options of numba that are not documented, and left out here: kernels are a little slower
WITHOUT_COUNTS: dict[str, Any] = {}
WITHOUT_WRAPPERS: dict[str, Any] = {}


def find_folder(function, options: dict) -> Path:
    """The folder of a kernel's files, named by all that determines them."""
    causes = compute_contents_digest(function), sorted(options.items()), find_machine(), VERSIONS
    key = hashlib.sha256(repr(causes).encode()).hexdigest()
    return find_cache() / "numba" / f"{function.__name__}-{key[:24]}"


def list_checksums(folder: Path) -> str:
    """A line for each file that numba has put into the folder."""
    lines = []
    for path in sorted(folder.rglob("*")):
        if path.is_file() and path.name != CHECKSUMS:
            checksum = hashlib.sha256(path.read_bytes()).hexdigest()
            lines.append(f"{checksum} {path.relative_to(folder).as_posix()}\n")
    return "".join(lines)


def read_checksums(folder: Path) -> str:
    """What `keep_checksums` has written: nothing where there is no such file."""
    try:
        return folder.joinpath(CHECKSUMS).read_text(encoding="utf-8")
    except FileNotFoundError:
        return ""
    except UnicodeDecodeError:
        return "damaged"


def keep_checksums(folder: Path) -> None:
    """Write down what the folder's files are; where nothing can be written they are not used."""
    with contextlib.suppress(OSError):
        temporary = folder / f"{CHECKSUMS}-{uuid.uuid4().hex}"
        lines = list_checksums(folder)
        temporary.write_text(lines, encoding="utf-8")
        temporary.replace(folder / CHECKSUMS)


def open_folder(folder: Path) -> bool:
    """Prepare a kernel's folder: empty if its files are not as they were written.

    Gives whether there is a folder that numba can write to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if read_checksums(folder) != list_checksums(folder):
            shutil.rmtree(folder)
            folder.mkdir(exist_ok=True)
        probe = folder / f"{CHECKSUMS}-{uuid.uuid4().hex}"
        probe.touch()
        probe.unlink()
    except OSError:
        return False
    return True


@contextlib.contextmanager
def cache_in(folder: Path) -> Iterator[None]:
    """In this block numba chooses this folder for the cache of what is decorated."""
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(folder)
    try:
        yield
    finally:
        numba.config.CACHE_DIR = before


_made: list[CachedKernel] = []  # kernels that numba has been given


class CachedKernel:
    """A function that numba compiles when it is first called, or takes from its own cache."""

    def __init__(self, function, options: dict):
        functools.update_wrapper(self, function)
        self.py_func = function
        self.targetoptions = options
        self.entry = self
        self._folder: Path | None = None
        self._listed = 0  # compiled overloads that the list of checksums knows
        self._is_ready = False

    def __call__(self, *arguments):
        if self._is_ready:
            return self.dispatcher(*arguments)
        if is_interpreted(arguments):
            return self.py_func(*arguments)
        with stopped_clock():
            try:
                return self._call_first(arguments)
            finally:
                self._is_ready = bool(self.dispatcher.overloads)
                list_new_files()

    def _call_first(self, arguments: tuple):
        """Call the kernel though numba cannot write a file: the disk is full, or another process
        has emptied the folder.  What it was written for is compiled then, and not compiled again.
        """
        for _ in range(MOST_UNWRITTEN_FILES):
            with contextlib.suppress(OSError):
                return self.dispatcher(*arguments)
        return self.dispatcher(*arguments)

    def __getattr__(self, name: str):
        if name not in SHOWN:
            raise AttributeError(f"a kernel has no {name}")
        return getattr(self.dispatcher, name)

    def __reduce__(self):
        """What stands for the kernel in the key by which numba finds a function that calls it."""
        return str, (compute_contents_digest(self.py_func),)

    @functools.cached_property
    def dispatcher(self):
        """What numba makes of the function, by its cache where there is a folder for it."""
        prepare_compiler()
        folder = find_folder(self.py_func, self.targetoptions)
        _made.append(self)
        if not open_folder(folder):
            return numba.njit(**self.targetoptions)(self.py_func)
        self._folder = folder
        with cache_in(folder):
            return numba.njit(cache=True, **self.targetoptions)(self.py_func)

    def list_new_files(self) -> None:
        """Count what was compiled since the last time, and keep the checksums of its files."""
        compiled = sum(self.dispatcher.stats.cache_misses.values())
        for _ in range(compiled - self._listed):
            note_compiled()
        if compiled > self._listed and self._folder is not None:
            keep_checksums(self._folder)
        self._listed = compiled


@typeof_impl.register(CachedKernel)
def type_kernel(kernel: CachedKernel, context):
    """A kernel that calls another one calls its dispatcher."""
    return numba.typeof(kernel.dispatcher)


@atexit.register
def list_new_files() -> None:
    """Count and list what was compiled: kernels that Python calls, and those that they call."""
    for kernel in list(_made):
        kernel.list_new_files()


def make_kernel(function, options: dict):
    """A function that numba compiles, with the cache and the first calls of this file."""
    return CachedKernel(function, options)
