"""What a kernel is made of, as a digest: its code and all that the code refers to.

Bytecode, constants and names of the function, its defaults, what its closure holds and the globals
it names; of functions among these the same again, compiled or not.  Of the toolchain's own
packages the name is enough: `regrid.jit` hashes their versions.

Of other modules that the code names, those attributes count that its names could mean.  What numba
is told of a user's functions elsewhere (`numba.extending.overload`) is not seen.

The trap: a global that is not bound yet counts as missing.  A digest that is to be complete is
taken when the kernel is first called, not when it is decorated.
"""

from __future__ import annotations

import enum
import hashlib
import pickle
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType

import numpy as np
from numba.core.serialize import dumps

TOOLCHAIN = ("numpy", "numba", "llvmlite", "math", "cmath", "operator", "builtins", "typing")
NUMBERS = (bool, int, float, complex, str, bytes, type(None), type(...))


def compute_contents_digest(function) -> str:
    """Digest of a function, or a kernel with its options, and of all that its code refers to."""
    digest = hashlib.sha256()
    _Walk(digest.update).add(function)
    return digest.hexdigest()


class _Walk:
    """One walk through values; each object is written once, and then by its number."""

    def __init__(self, update):
        self.update = update
        self.numbers: dict[int, int] = {}
        self.kept: list[object] = []  # so that no object gets the identity of one that has gone
        self.names: tuple[str, ...] = ()  # of globals and attributes in the code at hand
        self.modules: set[tuple[int, tuple[str, ...]]] = set()  # seen with which names

    def say(self, *words) -> None:
        self.update("\0".join(map(str, words)).encode() + b"\n")

    def add(self, value) -> None:
        """Write one value of any kind."""
        kind = type(value)
        if kind in NUMBERS:
            self.say(kind.__name__, repr(value))
            return
        if kind is ModuleType:
            self.add_module(value)
            return
        if id(value) in self.numbers:
            self.say("again", self.numbers[id(value)])
            return
        self.numbers[id(value)] = len(self.numbers)
        self.kept.append(value)
        compiled = getattr(value, "py_func", None) or getattr(value, "_pyfunc", None)  # of a cfunc
        if isinstance(compiled, FunctionType):
            self.say("compiled", sorted(getattr(value, "targetoptions", {}).items()))
            self.add(compiled)
        elif isinstance(value, FunctionType):
            self.add_function(value)
        elif isinstance(value, CodeType):
            self.add_code(value)
        elif isinstance(value, np.ndarray | np.generic):
            self.say("array", value.dtype, value.shape)
            self.update(value.tobytes())
        elif isinstance(value, enum.Enum):
            self.say("member", kind.__qualname__, value.name, value.value)
        elif isinstance(value, tuple | list):
            self.say(kind.__name__, len(value), getattr(value, "_fields", ""))
            for entry in value:
                self.add(entry)
        elif isinstance(value, dict):
            self.say("dict", len(value))
            for key in sorted(value, key=repr):
                self.add(key)
                self.add(value[key])
        elif isinstance(value, set | frozenset):
            self.say("set", sorted(map(repr, value)))
        elif isinstance(value, enum.EnumType):
            self.say("members", value.__qualname__, list(value.__members__))
            self.add([member.value for member in value])
        elif isinstance(value, type):
            self.add_class(value)
        elif isinstance(value, BuiltinFunctionType | np.ufunc):
            self.say(kind.__name__, getattr(value, "__module__", ""), value.__name__)
        else:
            self.add_other(value)

    def add_other(self, value) -> None:
        try:
            self.update(dumps(value))
        except (TypeError, AttributeError, pickle.PicklingError):
            self.say(type(value).__qualname__, repr(value))

    def add_module(self, module: ModuleType) -> None:
        """The name of a module; what the code may mean of it where it is none of the toolchain."""
        self.say("module", module.__name__)
        seen = (id(module), self.names)
        if module.__name__.split(".")[0] in TOOLCHAIN or seen in self.modules:
            return
        self.modules.add(seen)
        for name in self.names:
            if name in vars(module):
                self.say("attribute", name)
                self.add(vars(module)[name])

    def add_class(self, value: type) -> None:
        """A class by name; what it is compiled from, or what the code may mean of it, too."""
        self.say("class", value.__module__, value.__qualname__)
        if value.__module__.split(".")[0] in TOOLCHAIN:
            return
        compiled = getattr(value, "class_type", None)  # of a jitclass
        if compiled is not None:
            self.say(*((name, str(kind)) for name, kind in compiled.struct.items()))
            self.add((dict(compiled.methods), dict(compiled.static_methods)))
        self.add((getattr(value, "_fields", ()), getattr(value, "_field_defaults", ())))
        for name in self.names:
            if name in vars(value):
                self.say("attribute", name)
                self.add(getattr(value, name))

    def add_function(self, function: FunctionType) -> None:
        """Code, defaults, closure and the globals that the code names."""
        self.say("function", function.__module__, function.__name__)
        if function.__module__ and function.__module__.split(".")[0] in TOOLCHAIN:
            return
        self.say(getattr(function, "compiled_as", ""))  # inlined, or called
        outer, self.names = self.names, tuple(_list_names(function.__code__))
        self.add(function.__code__)
        self.add((function.__defaults__, function.__kwdefaults__))
        for name, cell in zip(
            function.__code__.co_freevars, function.__closure__ or (), strict=True
        ):
            self.say("closure", name)
            try:
                self.add(cell.cell_contents)
            except ValueError:
                self.say("empty")
        for name in self.names:
            if name in function.__globals__:  # else an attribute, a builtin, or not bound yet
                self.say("global", name)
                self.add(function.__globals__[name])
        self.names = outer

    def add_code(self, code: CodeType) -> None:
        """Instructions, names and constants, those of nested functions included; not the lines."""
        self.say("code", code.co_name, code.co_argcount, code.co_kwonlyargcount, code.co_flags)
        self.say(code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars)
        self.update(code.co_code + code.co_exceptiontable)
        for constant in code.co_consts:
            self.add(constant)


def _list_names(code: CodeType) -> list[str]:
    """Names of globals and attributes in a code and in the codes nested in it."""
    names, waiting = set(), [code]
    while waiting:
        one = waiting.pop()
        names.update(one.co_names)
        waiting += [constant for constant in one.co_consts if isinstance(constant, CodeType)]
    return sorted(names)
