"""A problem in a file of one's own: `shockgrid run my_problem.py`, without touching the packages.

Such a file is a module with one class derived from `Problem`; its name stands in a deck where that
of a packaged problem would.  Note: the file alone is known by its content, not what else it
imports from its folder; and a file that is run may do anything, as any Python script.
"""

from __future__ import annotations

import ast
import hashlib
import sys
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import FunctionType, ModuleType
from typing import TYPE_CHECKING, Any

from shockgrid.regrid.errors import BadInput, suggest
from shockgrid.regrid.text_files import check_regular

if TYPE_CHECKING:
    from shockgrid.problems.problem import Problem

ENDING = ".py"
PREFIX = "problem_file_"  # of the names of modules, so that none hides another module


@dataclass(frozen=True)
class ProblemFile:
    """A file as it was read: where, its text, the digest of that, its module and its class."""

    path: Path
    text: bytes
    digest: str
    module: ModuleType
    problem: type[Problem]


_LOADED: dict[tuple[str, str], ProblemFile] = {}  # by path and digest
_FUNCTION_FILES: dict[tuple[str, str], ModuleType] = {}  # other files that were run, alike


def is_problem_file(name: object) -> bool:
    """Does a name that stands where a problem's does mean a Python file?"""
    return isinstance(name, str) and name.endswith(ENDING)


def find_problem_file(name: str, folder: Path | None = None) -> Path:
    """The path of file `name`, from here or, where it is not there, from `folder` (a deck's)."""
    here = Path(name)
    if folder is not None and not here.exists() and (folder / here).exists():
        return folder / here
    return here


def read_problem_file(
    path: Path | str, name: str | None = None, beside: Path | None = None
) -> ProblemFile:
    """Run a file and find its class; the same content at the same place is run once.

    name, beside: of a copy, the name of the file it is of and the folder that this lay in, where
    its imports are looked for.  Raises BadInput with the line for a file that is missing, cannot be
    run, or holds no problem or two.
    """
    path = Path(path)
    text = _read(path)
    digest = compute_digest(text)
    key = str(path.resolve()), digest
    if key not in _LOADED:
        module = _run(path, text, Path(name or path).stem, beside or path.parent)
        _LOADED[key] = ProblemFile(path, text, digest, module, _find_class(module, path))
    found = _LOADED[key]
    sys.modules[found.module.__name__] = found.module  # where annotations are looked up
    return found


def read_function(path: Path | str, name: str, promise: str) -> Callable[..., Any]:
    """Run a file and find its function `name`; the same content at the same place is run once.

    promise: what such a function is, for the message.  Raises BadInput with the line for a file
    that is missing or cannot be run, and for a name that is no function of it.
    """
    path = Path(path)
    text = _read(path)
    key = str(path.resolve()), compute_digest(text)
    if key not in _FUNCTION_FILES:
        _FUNCTION_FILES[key] = _run(path, text, path.stem, path.parent)
    module = _FUNCTION_FILES[key]
    found = vars(module).get(name)
    if not isinstance(found, FunctionType):
        own = [one for one, value in vars(module).items() if isinstance(value, FunctionType)]
        raise BadInput(f"{path} has no function {name!r}{suggest(name, own)}; {promise}")
    return found


def compute_digest(text: bytes) -> str:
    """The digest by which the content of a file is known."""
    return hashlib.sha256(text).hexdigest()


def read_head(path: Path | str) -> str:
    """The docstring of a file, read without running it; "" where it has none.

    Raises BadInput where the file cannot be read or is no Python.
    """
    path = Path(path)
    try:
        return ast.get_docstring(ast.parse(_read(path), str(path))) or ""
    except (SyntaxError, ValueError) as error:
        raise BadInput(_describe_failure(path, error)) from error


def _read(path: Path) -> bytes:
    check_regular(path)
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise BadInput(f"{path} does not exist") from None
    except OSError as error:
        raise BadInput(f"{path} cannot be read: {error.strerror}") from error


def describe_mistake(error: BaseException) -> str:
    """A sentence where an error came from a file that is a problem, with its line; else ""."""
    files = {str(found.path) for found in _LOADED.values()}
    files |= {str(module.__file__) for module in _FUNCTION_FILES.values()}
    for frame in reversed(traceback.extract_tb(error.__traceback__)):
        if frame.filename in files:
            return (
                f"{frame.filename}, line {frame.lineno}: a mistake in this file"
                f" ({type(error).__name__}: {error})"
            )
    return ""


def _run(path: Path, text: bytes, stem: str, folder: Path) -> ModuleType:
    """Run the file as a module; its name is the same after an edit, as those of kernels are."""
    name = PREFIX + stem.replace(".", "_")
    module = ModuleType(name)
    module.__file__ = str(path)
    before = sys.modules.get(name)
    sys.modules[name] = module
    if str(folder.resolve()) not in sys.path:
        sys.path.append(str(folder.resolve()))  # last: it hides no other module
    try:
        exec(compile(text, str(path), "exec"), module.__dict__)
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        if before is not None:
            sys.modules[name] = before
        if isinstance(error, BadInput):
            raise
        raise BadInput(_describe_failure(path, error)) from error
    return module


def _describe_failure(path: Path, error: BaseException) -> str:
    lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if f.filename == str(path)]
    mistake = f"the file cannot be run ({type(error).__name__}: {error})"
    if isinstance(error, SyntaxError) and error.filename == str(path):
        lines = [error.lineno]
        mistake = f"this is not valid Python ({error.msg})"
    place = f", line {lines[-1]}" if lines and lines[-1] else ""
    return f"{path}{place}: {mistake}"


def _find_class(module: ModuleType, path: Path) -> type[Problem]:
    from shockgrid.problems.problem import Problem

    classes = dict.fromkeys(value for value in vars(module).values() if isinstance(value, type))
    own = [one for one in classes if issubclass(one, Problem) and one.__module__ == module.__name__]
    last = [one for one in own if not any(one in other.__mro__[1:] for other in own)]
    if len(last) == 1:
        return last[0]
    if not last:
        raise BadInput(
            f"{path} holds no problem: it needs a class derived from shockgrid.Problem; a script "
            "that runs a simulation of its own is started by python"
        )
    names = ", ".join(one.__name__ for one in last)
    raise BadInput(f"{path} holds {len(last)} problems ({names}); a file of one is wanted")
