"""Compiling kernels: one decorator, and a disk cache that never serves stale code.

The trap this module removes: numba's cache looks at the file of the compiled function only, so
an edited helper in another module, another numba or another processor silently gives the old
answer.  Here the cache directory of a kernel is named by a hash of its module, of every project
module that it imports (transitively), of numba, numpy and the processor.  Functions from outside
the packages, an equation of state of a user's own for example, are in no such hash: in the
directory each kernel's code is found by the digest of all that it is made of
(`regrid.kernel_contents`), so that edited ones are compiled anew.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import re
import shutil
import sys
import warnings
from pathlib import Path
from types import CodeType, FunctionType

import llvmlite
import numba
import numpy
from llvmlite import binding
from numba.core.caching import CompileResultCacheImpl, FunctionCache, _CacheLocator
from numba.core.codegen import JITCodeLibrary
from numba.core.dispatcher import Dispatcher
from numba.core.errors import NumbaIRAssumptionWarning
from numba.core.runtime import rtsys
from numba.extending import register_jitable

from regrid.interpreting import suits_python
from regrid.kernel_contents import compute_contents_digest

# an internal check of numba that stumbles over inlined conditional expressions
warnings.simplefilter("ignore", NumbaIRAssumptionWarning)

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("regrid", "hydro", "problems")
KEPT_CACHES = 128

NAME = re.compile(r"[A-Za-z_][\w.]*")
COMMENT = re.compile(r"#[^\n]*")
IMPORT = re.compile(
    r"^[ \t]*(?:from[ \t]+([A-Za-z_][\w.]*)[ \t]+import[ \t]+"
    r"(\((?:[^)#]|#[^\n]*)*\)|(?:[^\n\\]|\\\n)*)"
    r"|import[ \t]+((?:[^\n\\]|\\\n)*))",
    re.MULTILINE,
)


@functools.cache
def _read(path: Path) -> bytes:
    return path.read_bytes()


@functools.cache
def find_imports(path: Path) -> tuple[Path, ...]:
    """Project files that the file at `path` imports directly, wherever in it.

    Found by pattern, not parsed: every command that uses kernels waits for this.  Words of a
    docstring that look like an import count as one, which does no harm.
    """
    found = []
    for match in IMPORT.finditer(_read(path).decode("utf-8")):
        module, names, plain = match.groups()
        if module:
            # in brackets a comment may stand behind a name, and the brackets end after them
            words = NAME.findall(COMMENT.sub("", names))
            modules = [module, *(f"{module}.{word}" for word in words)]
        else:
            modules = NAME.findall(plain)
        for name in modules:
            if name.partition(".")[0] in PACKAGES:
                found += _find_files(name)
    return tuple(dict.fromkeys(found))


@functools.cache
def _find_files(module: str) -> list[Path]:
    base = ROOT.joinpath(*module.split("."))
    return [p for p in (base.with_suffix(".py"), base / "__init__.py") if p.is_file()]


@functools.cache
def _toolchain() -> str:
    host = binding.get_host_cpu_name() + binding.get_host_cpu_features().flatten()
    return f"{numba.__version__} {llvmlite.__version__} {numpy.__version__} {sys.version} {host}"


@functools.cache
def _cache_directory(path: Path) -> str:
    """Directory for the kernels of the module at `path`; see the module's docstring.

    The file of a module outside the packages is not hashed: a script is edited for other reasons.
    """
    own = any(path.is_relative_to(ROOT / package) for package in PACKAGES)
    files, waiting = set(), [path] if own else []
    while waiting:
        file = waiting.pop()
        if file not in files:
            files.add(file)
            waiting += find_imports(file)
    digest = hashlib.sha256(_toolchain().encode())
    for file in sorted(files):
        digest.update(_read(file))
    home = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    parent = Path(os.environ.get("SHOCKGRID_CACHE_DIR") or os.path.join(home, "shockgrid"))
    directory = parent / f"{path.stem}-{digest.hexdigest()[:16]}"
    if not directory.exists():
        _forget_oldest(parent)
    return str(directory)


def _forget_oldest(parent: Path) -> None:
    """Keep the cache from growing for ever: drop all but the newest directories."""
    try:
        own = [path for path in parent.iterdir() if re.fullmatch(r".+-[0-9a-f]{16}", path.name)]
        aged = sorted(own, key=lambda path: path.stat().st_mtime, reverse=True)
        for old in aged[KEPT_CACHES - 1 :]:
            shutil.rmtree(old, ignore_errors=True)
    except OSError:
        pass


class _Place(_CacheLocator):
    """Where the code of one kernel lies; nothing is written before there is code to store."""

    def __init__(self, function: FunctionType):
        self._py_file = function.__code__.co_filename  # numba's warnings name it
        self._directory = _cache_directory(Path(self._py_file).resolve())

    @classmethod
    def from_function(cls, py_func, py_file):
        return cls(py_func)

    def get_cache_path(self):
        return self._directory

    def get_source_stamp(self):
        return ""  # the directory and the key of an entry say all

    def get_disambiguator(self):
        return "kernel"


class _Code(CompileResultCacheImpl):
    _locator_classes = (_Place,)


class _Library(JITCodeLibrary):
    """Machine code, of which the intermediate code is read when a compiler asks for it.

    numba reads it with every kernel that it takes from the disk, for half of the time that this
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
    """numba's cache of one kernel, with the digest of its contents and options in each key."""

    _impl_class = _Code

    def __init__(self, compiled: Dispatcher):
        super().__init__(compiled.py_func)
        self._compiled = compiled

    @functools.cached_property
    def _contents(self) -> str:
        return compute_contents_digest(self._compiled)

    def _index_key(self, sig, codegen):
        return sig, codegen.magic_tuple(), self._contents

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


class _LaterCache:
    """A kernel's cache, made when it is first asked for: most kernels of a process never run."""

    def __init__(self, compiled: Dispatcher):
        self._compiled = compiled

    @functools.cached_property
    def _made(self) -> KernelCache:
        return KernelCache(self._compiled)

    def __getattr__(self, name: str):
        return getattr(self._made, name)


_CODES: list[CodeType] = []  # of all kernels of this process, also those that were never called


def find_kernel_codes() -> set[int]:
    """Identities of the code objects of all kernels, by which a profiler tells their calls."""
    return {id(code) for code in _CODES}


def _name_by_contents(function, options=()) -> None:
    """Give a function of which there may be variants a name of its own variant.

    These are functions made by factories, from outside the packages, or compiled with options.
    Machine code is linked by name, signature and a count that starts anew in every process: two
    variants of one closure, cached by two processes and loaded by a third, would pass for one
    another (seen: with two limiters, results that depended on which was loaded first).
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
    them. Every view handed to another kernel costs two locked instructions otherwise, which for
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
        compiled._cache = _LaterCache(compiled)
        compiled._compile_for_args = functools.partial(_compile_or_interpret, compiled)
        _CODES.append(function.__code__)
    return compiled


def inlined(function):
    """Mark a plain function to be inlined in every kernel that calls it; callable from Python too.

    The function stays a plain function: the same text serves numpy arrays, and a kernel made by a
    factory that holds it in its closure contains its code.
    """
    function.compiled_as = "inlined"
    return register_jitable(inline="always")(function)


def compiled_once(function=None, *, allocates=True):
    """Mark a plain function to be compiled once and called by kernels, not inlined.

    Like `inlined` it may sit in the closure of a kernel made by a factory.  `allocates`: as of
    `kernel`.
    """
    if function is None:
        return functools.partial(compiled_once, allocates=allocates)
    options = {} if allocates else {"_nrt": False}
    function.compiled_as = "called" if allocates else "called without counting references"
    _name_by_contents(function)
    return register_jitable(error_model="numpy", **options)(function)
