"""Compiling kernels: one decorator, and a disk cache that never serves stale code.

numba's own cache looks at the file of the compiled function only: an edited helper in another
module, another numba or another processor silently gives the old answer.  Here code is found by a
digest of all that the kernel is made of, in a folder named by the toolchain and the processor.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import io
import os
import pickle
import shutil
import sys
import uuid
import warnings
from pathlib import Path
from types import CodeType, FunctionType, ModuleType

import llvmlite
import numba
import numpy as np
from llvmlite import binding
from numba.core.caching import CompileResultCacheImpl, FunctionCache, _CacheLocator
from numba.core.codegen import JITCodeLibrary
from numba.core.dispatcher import Dispatcher
from numba.core.errors import NumbaIRAssumptionWarning
from numba.core.runtime import rtsys
from numba.extending import overload, register_jitable

from regrid.interpreting import suits_python

# an internal check of numba that stumbles over inlined conditional expressions
warnings.simplefilter("ignore", NumbaIRAssumptionWarning)

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("regrid", "hydro", "problems")
TOOLCHAIN = ("numpy", "numba", "llvmlite", "math", "cmath", "operator", "builtins", "typing")
KEPT_FOLDERS, KEPT_FILES = 32, 6000  # of the cache: when there are more, half of them go


def compute_contents_digest(function) -> str:
    """Digest of a function, or a kernel with its options, and of all that its code refers to.

    That is code, defaults, what the closure holds and the globals named; of functions among these
    the same again, of modules and classes what the names could mean, of the toolchain the name.  A
    global that is not bound yet is missing: the digest is taken when a kernel is first called.
    """
    stream = io.BytesIO()
    try:
        _Contents(stream).dump(function)
    except (pickle.PicklingError, TypeError, AttributeError, RecursionError):
        return uuid.uuid4().hex  # something without contents: compiled anew in every process
    return hashlib.sha256(stream.getvalue()).hexdigest()


class _Contents(pickle.Pickler):
    """Writes functions as what they are made of; by value, as identities differ by process."""

    def __init__(self, stream: io.BytesIO):
        super().__init__(stream, 4)
        self.fast, self.seen = True, {}

    def reducer_override(self, value):
        parts = (getattr(value, name, None) for name in ("py_func", "_pyfunc", "_defn"))
        compiled = next((part for part in parts if isinstance(part, FunctionType)), None)
        if compiled is not None:
            return tuple, ((sorted(getattr(value, "targetoptions", {}).items()), compiled),)
        if isinstance(value, CodeType):
            return tuple, (self.take_code(value),)
        if isinstance(value, FunctionType | ModuleType | type):
            if not is_known(value):
                return tuple, (self.take(value, ()),)
            if not isinstance(value, type):
                return tuple, ((getattr(value, "__module__", ""), value.__name__),)
        return NotImplemented

    def take_code(self, code: CodeType):
        sets = (sorted(map(repr, c)) if isinstance(c, frozenset) else c for c in code.co_consts)
        counts = (code.co_argcount, code.co_kwonlyargcount, code.co_flags, code.co_code)
        names = (code.co_name, code.co_names, code.co_varnames, code.co_freevars)
        return names, counts, code.co_exceptiontable, tuple(sets)

    def take(self, value, names):
        """Of a function all, of a module or class what `names` could mean, else the value."""
        if not isinstance(value, FunctionType | ModuleType | type) or is_known(value):
            return value
        where = (getattr(value, "__module__", ""), value.__name__)
        key = (id(value), frozenset(() if isinstance(value, FunctionType) else names))
        if key in self.seen:
            return where, self.seen[key]
        self.seen[key] = len(self.seen)
        if isinstance(value, FunctionType):
            code, space = value.__code__, dict(value.__globals__)
            for name, cell in zip(code.co_freevars, value.__closure__ or (), strict=True):
                with contextlib.suppress(ValueError):  # empty
                    space[name] = cell.cell_contents
            names = list_names(code)
            extra = (getattr(value, "compiled_as", ""), value.__defaults__, value.__kwdefaults__)
        else:
            names = {*names, "_fields", "_field_defaults"}
            code, space = None, {name: getattr(value, name) for name in names & vars(value).keys()}
            jitclass = getattr(value, "class_type", None)
            extra = jitclass and (
                [(name, str(kind)) for name, kind in jitclass.struct.items()],
                dict(jitclass.methods),
                dict(jitclass.static_methods),
            )
        named = {name: self.take(space[name], names) for name in sorted(names & space.keys())}
        return where, code, extra, named


def is_known(value) -> bool:
    """Is a module, class or function the toolchain's, of which the name is enough?"""
    where = value.__name__ if isinstance(value, ModuleType) else str(value.__module__)
    return where.split(".")[0] in TOOLCHAIN


def list_names(code: CodeType) -> set[str]:
    """Names of globals and attributes in a code and in the codes nested in it."""
    inner = (list_names(one) for one in code.co_consts if isinstance(one, CodeType))
    return {*code.co_names, *code.co_freevars}.union(*inner)


@functools.cache
def _find_directory() -> Path:
    """Where kernels of this toolchain and processor are kept."""
    host = binding.get_host_cpu_name() + binding.get_host_cpu_features().flatten()
    versions = f"{numba.__version__} {llvmlite.__version__} {np.__version__} {sys.version} {host}"
    home = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    parent = Path(os.environ.get("SHOCKGRID_CACHE_DIR") or os.path.join(home, "shockgrid"))
    return parent / f"kernels-{hashlib.sha256(versions.encode()).hexdigest()[:16]}"


def _keep_newest(folder: Path, pattern: str, most: int) -> None:
    """Delete all but the newest files or folders in a folder of the cache."""
    with contextlib.suppress(OSError):
        found = list(folder.glob(pattern))
        if len(found) > most:
            for old in sorted(found, key=lambda path: path.stat().st_mtime)[: -most // 2]:
                shutil.rmtree(old, ignore_errors=True) if old.is_dir() else old.unlink()


class _Place(_CacheLocator):
    """Where the code of one kernel lies; nothing is written before there is code to store."""

    def __init__(self, function: FunctionType):
        self._py_file = function.__code__.co_filename  # numba's warnings name it
        self._contents = compute_contents_digest(function)

    @classmethod
    def from_function(cls, py_func, py_file):
        return cls(py_func)

    def get_cache_path(self):
        return str(_find_directory())

    def ensure_cache_path(self):
        folder = _find_directory()
        if not folder.exists():
            _keep_newest(folder.parent, "*-" + 16 * "[0-9a-f]", KEPT_FOLDERS)
        super().ensure_cache_path()
        _keep_newest(folder, "*.nb?", KEPT_FILES)

    def get_source_stamp(self):
        return ""  # names of folder and file say all

    def get_disambiguator(self):
        return self._contents[:32]


class _Code(CompileResultCacheImpl):
    _locator_classes = (_Place,)


class _Library(JITCodeLibrary):
    """Machine code whose intermediate code is parsed only when a compiler asks for it.

    numba parses it with every kernel that it takes from the disk, for half of the time that this
    takes; only a kernel that is compiled anew and calls this one needs it.
    """

    _bitcode: bytes | None = None  # of what comes from the disk

    @classmethod
    def _unserialize(cls, codegen, state):
        name, kind, data = state
        if kind != "object":
            return super()._unserialize(codegen, state)
        library = codegen.create_library(name)
        machine_code, library._bitcode = data
        library.enable_object_caching()
        library._set_compiled_object(machine_code)
        library._finalize_final_module()
        return library

    def get_pointer_to_function(self, name):
        if self._bitcode is None:
            return super().get_pointer_to_function(name)
        return self._codegen._engine.get_function_address(name)

    def _get_module_for_linking(self):
        if self._bitcode is not None and self._shared_module is None:
            self._shared_module = binding.parse_bitcode(self._bitcode)
            self._codegen._engine._load_defined_symbols(self._shared_module)
        return super()._get_module_for_linking()


class KernelCache(FunctionCache):
    """numba's cache of one kernel, set up when it is first called: most kernels never are."""

    _impl_class = _Code

    def __init__(self, function: FunctionType):
        self._py_func = function

    def __getattr__(self, name: str):
        super().__init__(self._py_func)
        return object.__getattribute__(self, name)

    def _index_key(self, sig, codegen):
        return sig, codegen.magic_tuple()

    def load_overload(self, sig, target_context):
        """Code from the cache, or None.

        numba's own method refreshes the context: it loads all that compiling may need, for a fifth
        of a second.  The compiler does so itself; code that is compiled needs the runtime alone.
        """
        with contextlib.suppress(OSError):
            rtsys.initialize(target_context)
            target_context.codegen()._library_class = _Library
            return self._load_overload(sig, target_context)

    def save_overload(self, sig, data):
        """Store compiled code; where nothing can be written the run goes on without."""
        with contextlib.suppress(OSError):
            super().save_overload(sig, data)


_CODES: list[CodeType] = []  # of all kernels of this process, also those that were never called


def find_kernel_codes() -> set[int]:
    """Identities of the code objects of all kernels, by which a profiler tells their calls."""
    return {id(code) for code in _CODES}


def _name_by_contents(function, options=()) -> None:
    """Give a function of which there may be variants a name of its own variant.

    These are functions made by factories, from outside the packages, or compiled with options.
    Machine code is linked by name, signature and a count that starts anew in every process: two
    variants of one closure, cached by two processes and loaded by a third, would pass for one
    another, so that results depend on which is loaded first.
    """
    own = function.__module__.split(".")[0] in PACKAGES
    if function.__closure__ or options or not own:
        words = f"{compute_contents_digest(function)} {options}"
        function.__qualname__ += f"_{hashlib.sha256(words.encode()).hexdigest()[:10]}"


def _compile_or_interpret(compiled: Dispatcher, *arguments, **named):
    """What numba's dispatcher calls for new types of arguments; it runs the function returned."""
    if suits_python(arguments):
        return compiled.py_func
    return type(compiled)._compile_for_args(compiled, *arguments, **named)


def kernel(function=None, *, allocates=True, **options):
    """Compile `function` with numba: cached, without the interpreter lock, IEEE division.

    `allocates=False` for one that makes no arrays but views: numba then counts no references to
    them.  Every view handed to another kernel costs two locked instructions otherwise, which for
    short rows was a sixth of the assembly.
    Options are those of `numba.njit`.  No fastmath is set: the same formula gives the same bits
    in every kernel, in the vector body and the remainder of a loop, and for a mirrored flow.
    """
    if function is None:
        return functools.partial(kernel, allocates=allocates, **options)
    if not allocates:
        options["_nrt"] = False
    _name_by_contents(function, sorted(options.items()))
    compiled = numba.njit(nogil=True, error_model="numpy", **options)(function)
    if isinstance(compiled, Dispatcher):  # not so with NUMBA_DISABLE_JIT
        compiled._cache = KernelCache(compiled.py_func)
        compiled._compile_for_args = functools.partial(_compile_or_interpret, compiled)
        _CODES.append(function.__code__)
    return compiled


def inlined(function):
    """Mark a plain function to be inlined in every kernel that calls it; callable from Python too.

    The function stays a plain function: the same text serves numpy arrays, and a kernel made by a
    factory that holds it in its closure contains its code.  It makes no arrays.  Note: LLVM inlines
    it, of which loops over rows become packed all the same; numba's own inlining compiles a
    function again for every call of it.
    """
    return _mark(function, "inlined", allocates=False, forceinline=True)


def compiled_once(function=None, *, allocates=True):
    """Mark a plain function to be compiled once and called by kernels; as `inlined` but for that.

    allocates: as of `kernel`.
    """
    if function is None:
        return functools.partial(compiled_once, allocates=allocates)
    return _mark(function, "called" if allocates else "called without counting", allocates)


def _mark(function, how: str, allocates: bool, **options):
    function.compiled_as = how
    _name_by_contents(function)
    if not allocates:
        options["_nrt"] = False
    return register_jitable(
        error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True, **options
    )(function)


def replaces(function):
    """Decorate what compiled kernels call in place of the plain `function` (`numba.overload`)."""

    def mark(substitute):
        function.compiled_as = substitute
        return overload(function)(substitute)

    return mark
