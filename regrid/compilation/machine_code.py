"""Machine code of kernels straight from the disk: here alone names are used that numba keeps back.

A command's start pays for it: numba's own cache imports all of its compiler, numba.np and scipy
before it reads a file, half a second of processor time where the rest of a start takes as much, and
checks nothing that it reads.  Such names may go or change with any release of numba: with one that
has not been tried `regrid.jit` leaves this file out, and kernels are made by `numba_cache`, which
needs none of them.
"""

from __future__ import annotations

import contextlib
import functools
import io
import pickle
from pathlib import Path
from types import FunctionType

import llvmlite.binding
import numba
from numba.core import serialize
from numba.core.codegen import CodeLibrary, JITCodeLibrary
from numba.core.compiler import CompileResult
from numba.core.dispatcher import Dispatcher
from numba.core.environment import Environment, _rebuild_env, lookup_environment
from numba.core.runtime import _nrt_python

from shockgrid.regrid.compilation.contents import compute_contents_digest
from shockgrid.regrid.compilation.first_calls import (
    KERNEL_CODES,
    is_interpreted,
    note_compiled,
    prepare_compiler,
    stopped_clock,
)
from shockgrid.regrid.compilation.kept_files import find_kept, keep, read_kept

# options of numba that are not documented: arrays are not counted, nor called from elsewhere
WITHOUT_COUNTS = {"_nrt": False}
WITHOUT_WRAPPERS = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


class KernelCache:
    """Compiled code of one kernel on the disk, in the place of numba's own cache."""

    cache_path = None  # numba wants one

    def __init__(self, function: FunctionType, options: dict):
        self._function = function
        self._options = str(sorted(options.items()))  # serial and on threads are of the same text

    @functools.cached_property
    def _contents(self) -> str:
        return compute_contents_digest(self._function)

    def _find(self, types, context) -> Path:
        return find_kept(self._function.__name__, self._contents, self._options, str(types))

    def load_overload(self, types, context):
        with contextlib.suppress(Exception):  # what another release of numba has written
            parts = _Reader(io.BytesIO(read_kept(self._find(types, context)))).load()
            context.codegen().unserialize_library = functools.partial(_Loaded, context.codegen())
            return CompileResult._rebuild(context, *parts)
        prepare_compiler()

    def save_overload(self, types, result) -> None:
        note_compiled()
        keep(self._find(types, result.target_context), serialize.dumps(result._reduce()))


class _Loaded(JITCodeLibrary):
    """Machine code from the disk, which LLVM takes as it is.  Its bitcode, much slower to read, is
    read when a kernel that calls it is compiled."""

    def __init__(self, codegen, serialized):
        name, _, (machine_code, self._bitcode) = serialized
        CodeLibrary.__init__(self, codegen, name)  # without an empty module
        self._finalized = self._disable_inspection = True
        _name_runtime()
        engine = codegen._engine._ee
        engine.add_object_file(llvmlite.binding.ObjectFileRef.from_data(machine_code))
        engine.finalize_object()

    def get_pointer_to_function(self, name):
        return self._codegen._engine.get_function_address(name)

    @functools.cached_property
    def _shared_module(self):
        return llvmlite.binding.parse_bitcode(self._bitcode)

    _final_module = property(lambda self: self._shared_module)


@functools.cache
def _name_runtime() -> None:
    """Tell LLVM where numba's C functions are: what `rtsys.initialize` does before it compiles."""
    for name, address in _nrt_python.c_helpers.items():
        llvmlite.binding.add_symbol(name if name.startswith("_") else f"NRT_{name}", address)


class _Reader(pickle.Unpickler):
    """Reads compiled code; of numba's own modules none is imported for it, for with numba.np they
    bring scipy, a quarter of a second.  Globals are looked up by code that calls Python alone."""

    def find_class(self, module, name):
        mine = name == "_rebuild_env"
        return _rebuild_environment if mine else super().find_class(module, name)


def _rebuild_environment(module: str, constants: list, name: str) -> Environment:
    if module.startswith("numba.") and lookup_environment(name) is None:
        environment = Environment({})
        environment.consts[:] = constants
        environment.env_name = name
        Environment._memo[name] = environment
    return _rebuild_env(module, constants, name)


def _compile_or_interpret(compiled: Dispatcher, *arguments):
    """What numba calls where the types of arguments are new: gives the function to be called."""
    if is_interpreted(arguments):
        return compiled.py_func
    with stopped_clock():
        entry = type(compiled)._compile_for_args(compiled, *arguments)
    compiled.entry = entry if len(compiled.overloads) == 1 else compiled
    KERNEL_CODES.add(id(entry))
    return entry


def make_kernel(function, options: dict):
    """A function that numba compiles, with the cache and the first calls of this file."""
    compiled = numba.njit(**options)(function)
    compiled._cache = KernelCache(compiled.py_func, options)
    compiled._compile_for_args = functools.partial(_compile_or_interpret, compiled)
    compiled.entry = compiled
    return compiled
