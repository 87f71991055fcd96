"""Keywords of a call as settings of a deck: `cells=32, run={"t_end": 1e-3}` or `"run.t_end": 1e-3`.

They become the words of `--set`, so that the command line and Python have the same checks.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from regrid.errors import BadInput, suggest


def make_settings(keywords: Mapping[str, Any]) -> tuple[str, ...]:
    """`key=value` for each value, keys of tables joined by dots.

    Raises BadInput for None and for values that no deck can hold.
    """
    return tuple(f"{key}={_format(value, key)}" for key, value in _flatten(keywords, ""))


SAID = (  # on the command line, in Python
    ("--set: ", ""),
    (" and --set", " and the keywords"),
    ("--set ", ""),
    ("choose another with -o, or --force to", "choose another, or force=True to"),
    ("choose another with -o", "choose another"),
    ("choose another folder with -o", "choose another folder"),
    ("another directory with -o", "another directory"),
    ("choose an earlier one with --at", "choose an earlier one with at="),
)


@contextmanager
def said_in_python() -> Iterator[None]:
    """Sentences of BadInput that name options of the command line name keywords instead."""
    try:
        yield
    except BadInput as error:
        words = str(error)
        for option, keyword in SAID:
            words = words.replace(option, keyword)
        raise BadInput(words) from error


def check_options(name: str, call: Callable, options: Iterable[str]) -> None:
    """Raise BadInput for options that `call`, known to the user by `name`, does not have."""
    known = [
        one.name
        for one in inspect.signature(call).parameters.values()
        if one.name != "self" and one.kind is not one.VAR_POSITIONAL
    ]
    for option in options:
        if option not in known:
            raise BadInput(f"{name}: there is no option {option!r}{suggest(option, known)}")


def with_known_options(call: Callable) -> Callable:
    """`call`, with BadInput instead of a TypeError for an option that it does not have."""

    @functools.wraps(call)
    def checked(*values: Any, **options: Any) -> Any:
        check_options(call.__name__, call, options)
        return call(*values, **options)

    return checked


def _flatten(table: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, Any]]:
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _flatten(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _format(value: Any, key: str) -> str:
    """A value as TOML writes it, on one line."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_format(entry, key) for entry in value) + "]"
    if isinstance(value, Mapping):
        inner = (f"{_format(str(k), key)} = {_format(v, key)}" for k, v in value.items())
        return "{" + ", ".join(inner) + "}"
    if value is None:
        raise BadInput(f"{key} = None: a deck has no such value; leave the keyword out")
    if isinstance(value, Path):
        value = str(value)
    if not isinstance(value, bool | int | float | str):
        raise BadInput(f"{key}: a deck cannot hold a {type(value).__name__}; give a number or text")
    return tomli_w.dumps({"value": value}).partition("=")[2].strip()
