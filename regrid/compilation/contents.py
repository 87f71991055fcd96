"""Digest of everything that a kernel consists of: its code and that of all it calls.

numba's own cache depends only on the file of the compiled function: after a helper in another
module is edited, it still returns the old code.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import pickle
import uuid
from types import CodeType, FunctionType, ModuleType

# where the kernels are
PACKAGES = ("shockgrid.regrid", "shockgrid.hydro", "shockgrid.problems")
TOOLCHAIN = ("numpy", "numba", "llvmlite", "math", "cmath", "operator", "builtins", "typing")


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


def is_of_packages(module: str) -> bool:
    """Whether a module is one of the packages that have kernels, not a user's own."""
    return ".".join(module.split(".")[:2]) in PACKAGES


def _has_names(value) -> bool:
    """Whether it is a function, module or class, and none of the toolchain's."""
    if not isinstance(value, FunctionType | ModuleType | type):
        return False
    where = value.__name__ if isinstance(value, ModuleType) else str(value.__module__)
    return where.split(".")[0] not in TOOLCHAIN


def _list_names(code: CodeType) -> set[str]:
    inner = (
        _list_names(code_object)
        for code_object in code.co_consts
        if isinstance(code_object, CodeType)
    )
    return {*code.co_names, *code.co_freevars}.union(*inner)


def name_by_contents(function, options) -> None:
    """Give a function of which there may be variants (made by a factory, of a user's own, with
    options) a name of its own variant: machine code is linked by name and types, and variants
    cached by two processes and loaded by a third would pass for one another."""
    if function.__closure__ or options or not is_of_packages(function.__module__):
        variant = f"{compute_contents_digest(function)} {options}"
        function.__qualname__ += f"_{hashlib.sha256(variant.encode()).hexdigest()[:10]}"
