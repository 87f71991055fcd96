"""Compilation of kernels: one decorator, and a disk cache that never returns stale code.

What stands behind them is in `regrid.compilation`.  Inside `interpreted`, kernels run as plain
Python functions.  Note: a simulation made there (`hydro.simulation.Simulation`) lacks what a march
needs and cannot march.
"""

from __future__ import annotations

import contextlib
import functools
import os
import typing
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, ParamSpec, Protocol, TypeVar

# threads of a kernel that wait for others sleep after some 50 us, before OpenMP is loaded: spinning
# on a busy machine they take the time of those that work
os.environ.setdefault("GOMP_SPINCOUNT", "1000")

import numba
import numpy as np
from numba.extending import overload, register_jitable

from shockgrid.regrid.compilation.contents import name_by_contents
from shockgrid.regrid.compilation.first_calls import KERNEL_CODES, before_compiling

FIRST_TRIED = 0, 60  # releases of numba whose insides `machine_code` knows
LAST_TRIED = 0, 68

try:
    if os.environ.get("SHOCKGRID_PUBLIC_NUMBA"):
        raise ImportError("only numba's public interface is wanted")
    if not FIRST_TRIED <= numba.version_info.short <= LAST_TRIED:
        raise ImportError("the insides of this release of numba are not known")
    from shockgrid.regrid.compilation import machine_code as backend
except ImportError:
    from shockgrid.regrid.compilation import numba_cache as backend  # type: ignore[no-redef]

# was this process forked from one whose kernels had started threads?
_forked = SimpleNamespace(from_threads=False)


def can_use_threads() -> bool:
    """Whether kernels with `parallel=True` can be called in this process.

    Not in one that was forked from a process in which some have run: the threads are not there any
    more, GNU OpenMP cannot start others, and numba then leaves out the loop and sends SIGTERM.  Who
    calls such a kernel asks first, and calls its serial form, which gives the same bits.
    """
    return not _forked.from_threads


def _note_fork() -> None:
    """Find out, in a forked process, whether its parent's kernels had started threads."""
    with contextlib.suppress(ValueError):  # none has
        numba.threading_layer()
        _forked.from_threads = True


if hasattr(os, "register_at_fork"):  # not on Windows, which has no fork
    os.register_at_fork(after_in_child=_note_fork)


Arguments = ParamSpec("Arguments")
Result_co = TypeVar("Result_co", covariant=True)
Inlined = TypeVar("Inlined", bound=Callable)


class Kernel(Protocol[Arguments, Result_co]):
    """What `kernel` makes of a function: called like it, so that editors show its arguments."""

    py_func: Callable[Arguments, Result_co]
    entry: Callable[Arguments, Result_co]

    def __call__(self, *args: Arguments.args, **kwargs: Arguments.kwargs) -> Result_co: ...


@typing.overload
def kernel(function: Callable[Arguments, Result_co]) -> Kernel[Arguments, Result_co]: ...


@typing.overload
def kernel(
    *, allocates: bool = ..., **options: Any
) -> Callable[[Callable[Arguments, Result_co]], Kernel[Arguments, Result_co]]: ...


def kernel(function=None, *, allocates=True, **options):
    """Compile `function` with numba: cached, without the interpreter lock, IEEE division.

    `allocates=False` for one that makes no arrays but views: numba then counts no references, two
    locked instructions a view.  Options are those of `numba.njit`.  No fastmath is set: the same
    formula gives the same bits in every kernel, in all parts of a loop, and mirrored.

    The attribute `entry` is the kernel again.  Once it is compiled for one set of types, `entry` is
    its machine code, which takes the arguments for what the first ones were: numba's search by
    type takes microseconds where arguments are tuples.  Only for arguments of types that cannot
    change, such as one's own work arrays.
    """
    if function is None:
        return functools.partial(kernel, allocates=allocates, **options)
    options |= {} if allocates else backend.WITHOUT_COUNTS
    named = sorted(options.items())
    before_compiling.append(lambda: name_by_contents(function, named))
    if numba.config.DISABLE_JIT:
        function.entry = function
        return function
    KERNEL_CODES.add(id(function.__code__))
    return backend.make_kernel(function, {"nogil": True, "error_model": "numpy", **options})


def inlined(function: Inlined) -> Inlined:
    """Mark a plain function, which makes no arrays, to be inlined in every kernel that calls it;
    callable from Python too, on arrays.  LLVM inlines it: numba would compile it for every call."""
    return compiled_once(function, allocates=False, forceinline=True)


@typing.overload
def compiled_once(function: Inlined, *, allocates: bool = ..., **options: Any) -> Inlined: ...


@typing.overload
def compiled_once(*, allocates: bool = ..., **options: Any) -> Callable[[Inlined], Inlined]: ...


def compiled_once(function=None, *, allocates=True, **options):
    """Mark a plain function to be compiled once and called by kernels; else as `inlined`."""
    if function is None:
        return functools.partial(compiled_once, allocates=allocates, **options)
    options |= {} if allocates else backend.WITHOUT_COUNTS
    function.compiled_as = sorted(options)

    def register() -> None:
        name_by_contents(function, ())
        register_jitable(error_model="numpy", **backend.WITHOUT_WRAPPERS, **options)(function)

    before_compiling.append(register)
    return function


def choose(condition, yes, no):
    """`yes` where the condition holds, else `no`: numbers in kernels, arrays too in Python."""
    return np.where(condition, yes, no)


def _register_choose() -> None:
    options = backend.WITHOUT_COUNTS | {"forceinline": True}

    @overload(choose, jit_options=options, prefer_literal=False)
    def type_choose(condition, yes, no):
        return lambda condition, yes, no: yes if condition else no


before_compiling.append(_register_choose)
