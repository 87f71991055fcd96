"""Compilation of kernels: one decorator, and a disk cache that never returns stale code.

numba's own cache depends only on the file of the compiled function: after a helper in another
module is edited, it still returns the old code.  The cache here is keyed by a digest of everything
that a kernel consists of.  Checking a deck takes a few calls on small arrays, for which a minute of
compilation is not worthwhile: inside `interpreted`, kernels run as plain Python functions.  Note: a
simulation made there (`hydro.simulation.Simulation`) lacks what a march needs and cannot march.
"""

from __future__ import annotations

import contextlib
import contextvars
import functools
import hashlib
import io
import os
import pickle
import signal
import sys
import threading
import time
import uuid
from collections.abc import Callable
from pathlib import Path
from types import CodeType, FunctionType, ModuleType, SimpleNamespace
from typing import Any

# threads of a kernel that wait for others sleep after some 50 us, before OpenMP is loaded: spinning
# on a busy machine they take the time of those that work
os.environ.setdefault("GOMP_SPINCOUNT", "1000")

import llvmlite
import llvmlite.binding
import numba
import numpy as np
from numba.core import serialize
from numba.core.codegen import CodeLibrary, JITCodeLibrary, get_host_cpu_features
from numba.core.compiler import CompileResult
from numba.core.dispatcher import Dispatcher
from numba.core.environment import Environment, _rebuild_env, lookup_environment
from numba.core.registry import cpu_target
from numba.core.runtime import _nrt_python
from numba.extending import overload, register_jitable

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("regrid", "hydro", "problems")
TOOLCHAIN = ("numpy", "numba", "llvmlite", "math", "cmath", "operator", "builtins", "typing")
VERSIONS = numba.__version__, llvmlite.__version__, np.__version__, sys.version
KEPT_FILES = 6000  # of the cache: when there are more, half of them go
MOST_NUMBERS = 300_000  # in an interpreted call's arrays: beyond, compiling takes no longer
# identities of all kernels' codes and of their entries: a profiler tells calls by them
KERNEL_CODES: set[int] = set()
# the first processors with vectors of 512 bits, which slow down where these are used
SLOW_AT_512 = ("skylake-avx512", "cascadelake", "cooperlake", "cannonlake")


def widen_vectors() -> None:
    """Let LLVM use vectors of 512 bits where the processor has them: by itself it stays at 256.

    Kernels are a tenth to a fifth faster, with the same bits.  It holds for all that numba compiles
    in this process.  NUMBA_CPU_NAME and NUMBA_CPU_FEATURES take precedence.
    """
    own = numba.config.CPU_NAME, numba.config.CPU_FEATURES
    if own != (None, None) or llvmlite.binding.get_host_cpu_name() in SLOW_AT_512:
        return
    features = get_host_cpu_features()
    if "+avx512f" in features.split(","):
        numba.config.CPU_FEATURES = f"{features},-prefer-256-bit"


widen_vectors()


def compute_contents_digest(function) -> str:
    """Digest of a function, or a kernel with its options: code, defaults, and all that its names
    mean, of functions among these the same again, of the toolchain the name; taken when a kernel is
    first called, as globals may not be bound before."""
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
        self.fast = True
        self.seen = {}

    def reducer_override(self, value):
        for name in ("py_func", "_pyfunc", "_defn"):  # of what numba has compiled
            if isinstance(compiled := getattr(value, name, None), FunctionType):
                return tuple, ((sorted(getattr(value, "targetoptions", {}).items()), compiled),)
        if isinstance(value, CodeType):  # but for file and lines; sets have no order
            sets = [
                sorted(map(repr, c)) if isinstance(c, frozenset) else c for c in value.co_consts
            ]
            counts = value.co_argcount, value.co_kwonlyargcount, value.co_flags
            names = value.co_name, value.co_names, value.co_varnames, value.co_freevars
            return tuple, ((value.co_code, value.co_exceptiontable, counts, names, sets),)
        if _has_names(value):
            return tuple, (self.take(value, ()),)
        if isinstance(value, FunctionType | ModuleType):  # of the toolchain
            return tuple, ((getattr(value, "__module__", ""), value.__name__),)
        return NotImplemented

    def take(self, value, names):
        """Of a function all, of a module or class what `names` could mean, else the value."""
        if not _has_names(value):
            return value
        is_function = isinstance(value, FunctionType)
        where = getattr(value, "__module__", ""), value.__name__
        key = id(value), frozenset(() if is_function else names)
        if key in self.seen:
            return where, self.seen[key]
        self.seen[key] = len(self.seen)
        if is_function:
            names = _list_names(value.__code__)
            space = dict(value.__globals__)
            for name, cell in zip(value.__code__.co_freevars, value.__closure__ or (), strict=True):
                with contextlib.suppress(ValueError):  # empty
                    space[name] = cell.cell_contents
            extra = getattr(value, "compiled_as", ""), value.__defaults__, value.__kwdefaults__
        else:
            names = {*names, "_fields", "_field_defaults"}
            space = {name: getattr(value, name) for name in names & vars(value).keys()}
            if extra := getattr(value, "class_type", None):  # compiled by numba
                struct = [(name, str(kind)) for name, kind in extra.struct.items()]
                extra = struct, dict(extra.methods), dict(extra.static_methods)
        named = {name: self.take(space[name], names) for name in sorted(names & space.keys())}
        return where, getattr(value, "__code__", None), extra, named


def _has_names(value) -> bool:
    """Is it a function, module or class, and none of the toolchain's?"""
    if not isinstance(value, FunctionType | ModuleType | type):
        return False
    where = value.__name__ if isinstance(value, ModuleType) else str(value.__module__)
    return where.split(".")[0] not in TOOLCHAIN


def _list_names(code: CodeType) -> set[str]:
    inner = (_list_names(one) for one in code.co_consts if isinstance(one, CodeType))
    return {*code.co_names, *code.co_freevars}.union(*inner)


class KernelCache:
    """Compiled code of one kernel on the disk, in the place of numba's own cache."""

    cache_path = None  # numba wants one

    def __init__(self, function: FunctionType):
        self._function = function

    @functools.cached_property
    def _contents(self) -> str:
        return compute_contents_digest(self._function)

    def _find(self, types, context) -> Path:
        return find_kept(self._function.__name__, self._contents, str(types))

    def load_overload(self, types, context):
        with contextlib.suppress(Exception):  # what another release of numba has written
            parts = _Reader(io.BytesIO(read_kept(self._find(types, context)))).load()
            context.codegen().unserialize_library = functools.partial(_Loaded, context.codegen())
            return CompileResult._rebuild(context, *parts)
        prepare_compiler()

    def save_overload(self, types, result) -> None:
        _compiling.compiled += 1
        _tell()
        keep(self._find(types, result.target_context), serialize.dumps(result._reduce()))


def find_kept(name: str, *words: str) -> Path:
    """The file of the cache for what these words, the compiler and the processor determine."""
    machine = cpu_target.target_context.codegen().magic_tuple()
    key = hashlib.sha256(repr((words, machine, VERSIONS)).encode()).hexdigest()
    home = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    folder = os.environ.get("SHOCKGRID_CACHE_DIR") or os.path.join(home, "shockgrid")
    return Path(folder, "kernels", f"{name}-{key[:24]}.kept")


def compute_checksum(contents: bytes) -> bytes:
    """What a file of the cache begins with: SHA-256 of all bytes after it."""
    return hashlib.sha256(contents).digest()


def read_kept(path: Path) -> bytes:
    """What `keep` has put into a file of the cache.

    Machine code of which one bit is wrong runs, and its numbers look sound: nothing of a file is
    used before all of it is known to be as it was written.  Raises OSError where there is no file
    that can be read, ValueError where it is damaged or cut off.
    """
    kept = path.read_bytes()
    size = hashlib.sha256().digest_size
    checksum = kept[:size]
    contents = kept[size:]
    if checksum != compute_checksum(contents):
        raise ValueError(f"{path} is damaged")
    return contents


def keep(path: Path, contents: bytes) -> None:
    """Write a file of the cache; where nothing can be written the run goes on without."""
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_name(uuid.uuid4().hex)
        part.write_bytes(compute_checksum(contents) + contents)
        part.replace(path)
        found = list(path.parent.iterdir())
        if len(found) > KEPT_FILES:
            for old in sorted(found, key=os.path.getmtime)[: -KEPT_FILES // 2]:
                old.unlink()


@functools.cache
def digest_sources() -> str:
    """Digest of all files of the packages: what is computed with them may differ with it."""
    files = sorted(file for name in PACKAGES for file in ROOT.joinpath(name).rglob("*.py"))
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()


def remember(name: str, words: Any, compute: Callable[[], Any]) -> Any:
    """What `compute` gives; it stays in the cache until a file of the packages changes.

    words: all that it depends on beside them, as pickle writes it.
    """
    words = hashlib.sha256(pickle.dumps(words)).hexdigest()
    path = find_kept(name, digest_sources(), words)
    with contextlib.suppress(OSError, ValueError):
        return pickle.loads(read_kept(path))
    found = compute()
    if not is_interpreting():  # there the last bits may be others
        keep(path, pickle.dumps(found))
    return found


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
        made = Environment({})
        made.consts[:] = constants
        made.env_name = name
        Environment._memo[name] = made
    return _rebuild_env(module, constants, name)


_before_compiling: list[Callable[[], None]] = []


def prepare_compiler() -> None:
    """Do what numba needs of kernels and inlined functions before it compiles something: names,
    entries in its tables.  Kernels from the disk need none of it."""
    while _before_compiling:
        _before_compiling.pop()()


def _name_by_contents(function, options) -> None:
    """Give a function of which there may be variants (made by a factory, of a user's own, with
    options) a name of its own variant: machine code is linked by name and types, and variants
    cached by two processes and loaded by a third would pass for one another."""
    if function.__closure__ or options or function.__module__.split(".")[0] not in PACKAGES:
        words = f"{compute_contents_digest(function)} {options}"
        function.__qualname__ += f"_{hashlib.sha256(words.encode()).hexdigest()[:10]}"


_interpreting = contextvars.ContextVar("interpreting", default=False)
is_interpreting = _interpreting.get  # is this inside a block of `interpreted`?


@contextlib.contextmanager
def interpreted():
    """In this block kernels that this process has not used run as Python, on small arrays; those of
    threads that are started in the block are compiled."""
    before = _interpreting.set(True)
    try:
        with np.errstate(all="ignore"):  # kernels do not warn
            yield
    finally:
        _interpreting.reset(before)


# wall seconds of compiling and loading until now; when the present one began, 0 where there is none
_compiling = SimpleNamespace(
    lock=threading.Lock(), seconds=0.0, begun=0.0, ready=0, compiled=0, processor=0.0, told=False
)
SILENT_SECONDS = 3.0  # wall seconds of compiling from which on a person at a terminal is told


def _tell() -> None:
    """Say once, to a person at a terminal, what the first call waits for."""
    now = time.perf_counter() - _compiling.begun
    if _compiling.told or not _compiling.begun or _compiling.seconds + now < SILENT_SECONDS:
        return
    _compiling.told = True
    if sys.stderr is not None and sys.stderr.isatty():
        words = "compiling kernels, kept for later runs: a minute, several on a busy machine ..."
        print(f"regrid: {words}", file=sys.stderr, flush=True)


def leave_telling() -> None:
    """Whoever calls this tells a person itself that kernels are compiled."""
    _compiling.told = True


@contextlib.contextmanager
def _interrupts_kept():
    """In this block an interrupt ends as KeyboardInterrupt, whatever numba makes of it.

    Where numba is interrupted it may raise that it has "no compiled object yet", or go on.
    """
    mine = threading.current_thread() is threading.main_thread()
    if not (mine and signal.getsignal(signal.SIGINT) is signal.default_int_handler):
        yield
        return
    interrupted = []

    def remember(number, frame):
        interrupted.append(number)
        signal.default_int_handler(number, frame)

    signal.signal(signal.SIGINT, remember)
    try:
        yield
    except Exception:
        if not interrupted:
            raise
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        if interrupted:
            raise KeyboardInterrupt from None


def _compile_or_interpret(compiled: Dispatcher, *arguments):
    numbers = sum(one.size for one in arguments if isinstance(one, np.ndarray))
    if is_interpreting() and numbers <= MOST_NUMBERS:
        return compiled.py_func
    with _compiling.lock:
        _compiling.begun = time.perf_counter()
        processor = time.thread_time()
        try:
            with _interrupts_kept():
                found = type(compiled)._compile_for_args(compiled, *arguments)
            compiled.entry = found if len(compiled.overloads) == 1 else compiled
            KERNEL_CODES.add(id(found))
            return found
        finally:
            _compiling.ready += 1
            _compiling.processor += time.thread_time() - processor
            _compiling.seconds += time.perf_counter() - _compiling.begun
            _compiling.begun = 0.0


def count_compiling() -> tuple[int, int, float]:
    """Kernels that Python has called until now; how many kernels had to be compiled for them; wall
    seconds [s] of compiling and loading them."""
    now = time.perf_counter() - _compiling.begun if _compiling.begun else 0.0
    return _compiling.ready, _compiling.compiled, _compiling.seconds + now


def read_processor_time() -> float:
    """Processor time [s] of this process, without that of compiling and loading kernels."""
    return time.process_time() - _compiling.processor


def read_clock() -> float:
    """Wall time [s] from some moment on; the clock is stopped while kernels are compiled."""
    return (_compiling.begun or time.perf_counter()) - _compiling.seconds


# was this process forked from one whose kernels had started threads?
_forked = SimpleNamespace(from_threads=False)


def can_use_threads() -> bool:
    """Can kernels with `parallel=True` be called in this process?

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
    options |= {} if allocates else {"_nrt": False}
    named = sorted(options.items())
    _before_compiling.append(lambda: _name_by_contents(function, named))
    compiled = numba.njit(nogil=True, error_model="numpy", **options)(function)
    if isinstance(compiled, Dispatcher):  # not so with NUMBA_DISABLE_JIT
        compiled._cache = KernelCache(compiled.py_func)
        compiled._compile_for_args = functools.partial(_compile_or_interpret, compiled)
        KERNEL_CODES.add(id(function.__code__))
    compiled.entry = compiled
    return compiled


def inlined(function):
    """Mark a plain function, which makes no arrays, to be inlined in every kernel that calls it;
    callable from Python too, on arrays.  LLVM inlines it: numba would compile it for every call."""
    return compiled_once(function, allocates=False, forceinline=True)


def compiled_once(function=None, *, allocates=True, **options):
    """Mark a plain function to be compiled once and called by kernels; else as `inlined`."""
    if function is None:
        return functools.partial(compiled_once, allocates=allocates, **options)
    options |= {} if allocates else {"_nrt": False}
    function.compiled_as = sorted(options)

    def register() -> None:
        _name_by_contents(function, ())
        wrappers = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
        register_jitable(error_model="numpy", **wrappers, **options)(function)

    _before_compiling.append(register)
    return function


def choose(condition, yes, no):
    """`yes` where the condition holds, else `no`: numbers in kernels, arrays too in Python."""
    return np.where(condition, yes, no)


def _register_choose() -> None:
    @overload(choose, jit_options={"_nrt": False, "forceinline": True}, prefer_literal=False)
    def type_choose(condition, yes, no):
        return lambda condition, yes, no: yes if condition else no


_before_compiling.append(_register_choose)
