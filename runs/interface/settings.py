"""Keywords of a call as settings of a deck: `cells=32, run={"t_end": 1e-3}` or `"run.t_end": 1e-3`.

They become the words of `--set`, so that the command line and Python have the same checks.
"""

from __future__ import annotations

import html
import math
import re
from collections.abc import Callable, Iterator, Mapping, MutableMapping, Sequence
from contextlib import contextmanager
from typing import Any

from hydro.boundary import SEGMENTS, Segment
from hydro.eos import EQUATIONS_OF_STATE
from hydro.eos.base import EquationOfState
from problems.problem import Problem
from problems.registry import PROBLEMS
from regrid.errors import BadInput
from regrid.registry import REGRIDDERS
from runs.study.definition import flatten, write_settings


def make_table(rows: Sequence[tuple[str, str]], theory: Mapping[str, float]) -> str:
    """HTML of two columns, what and its value, `theory` the last rows."""
    rows = [*rows, *((f"theory: {name}", f"{value:.6g}") for name, value in theory.items())]
    lines = "".join(
        f"<tr><th style='text-align:left'>{html.escape(what)}</th>"
        f"<td style='text-align:left'>{html.escape(value)}</td></tr>"
        for what, value in rows
    )
    return f"<table>{lines}</table>"


def make_settings(keywords: Mapping[str, Any]) -> tuple[str, ...]:
    """`key=value` for each value, keys of tables joined by dots.

    Raises BadInput for None and for values that no deck can hold.
    """
    return write_settings(flatten(keywords))


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


HookFunction = Callable[[Any], Any]  # of the case; None, or words on why to stop


def is_count(value: object) -> bool:
    """Is it a whole number of at least 1?"""
    return type(value) is int and value >= 1


class Hook:
    """A function to be called every `steps` steps or every `time` [s], after each step
    where neither is given.

    Times are multiples of `time`; a call is made after the first step past one.  Raises BadInput
    where both are given, or one that is not positive.
    """

    def __init__(
        self, function: HookFunction, *, steps: int | None = None, time: float | None = None
    ):
        if not callable(function):
            raise BadInput(f"a hook is a function of the case, not a {type(function).__name__}")
        if steps is not None and time is not None:
            raise BadInput(
                "a hook is called every so many steps or every so many seconds, not both"
            )
        if steps is not None and not is_count(steps):
            raise BadInput(f"steps = {steps!r} of a hook: a whole number of at least 1 is wanted")
        if time is not None and not (math.isfinite(time) and time > 0.0):
            raise BadInput(f"time = {time!r} s of a hook: a positive number is wanted")
        self.function, self.steps, self.time = function, steps, time

    def is_due(self, case: Any, t_before: float) -> bool:
        """Is it to be called after the step from `t_before` to the time of the case?"""
        if self.time is not None:
            return math.floor(case.t / self.time) > math.floor(t_before / self.time)
        return case.step % (self.steps or 1) == 0


HooksGiven = Sequence[Hook | HookFunction] | Hook | HookFunction


def join_hooks(case: Any, given: HooksGiven) -> Callable[[float], str | None]:
    """What a runner calls after each step, from a time [s] on: all hooks that are due.

    It returns the first reason to stop, and raises BadInput where a hook returns neither None nor
    text.
    """
    several = given if isinstance(given, Sequence) else [given]
    hooks = [hook if isinstance(hook, Hook) else Hook(hook) for hook in several]

    def call(t_before: float) -> str | None:
        for hook in [one for one in hooks if one.is_due(case, t_before)]:
            reason = hook.function(case)
            if reason is not None and not isinstance(reason, str):
                name = getattr(hook.function, "__name__", "hook")
                raise BadInput(
                    f"{name} returned {reason!r}: a hook returns None, or words on why to stop"
                )
            if reason:
                return reason
        return None

    return call


NAME = re.compile(r"[a-z0-9]+(-[a-z0-9]+)*")
_OWN: dict[tuple[str, str], str] = {}  # what was registered here: kind and name, and its class


def register(name: str, thing: type) -> None:
    """Make a class known by name: a problem, an equation of state, a boundary kind, a regridder.

    A regridder is a class with a method `regrid(previous, boundary)`.  The same name may be given
    again by the same class, rewritten.  Raises BadInput for another class, for a name that is
    taken, and for one that is not of small letters, digits and hyphens.
    """
    if not isinstance(thing, type):
        raise BadInput(f"{name!r}: a class is registered, not a {type(thing).__name__}")
    if not NAME.fullmatch(name):
        raise BadInput(f"{name!r} is not a valid name: use lower-case letters, digits and hyphens")
    place = f"{thing.__module__}:{thing.__qualname__}"
    registry: MutableMapping[str, Any]
    value: Any
    if issubclass(thing, Problem):
        kind, registry, value = "problem", PROBLEMS, place
    elif issubclass(thing, EquationOfState):
        kind, registry, value = "equation of state", EQUATIONS_OF_STATE, thing
    elif issubclass(thing, Segment):
        kind, registry, value = "boundary kind", SEGMENTS, thing
    elif callable(getattr(thing, "regrid", None)):
        kind, registry, value = "regridder", REGRIDDERS, place
    else:
        raise BadInput(
            f"{thing.__name__} is not a problem, equation of state, boundary kind or regridder: it "
            "is derived from none of them and has no method regrid"
        )
    if "<locals>" in place:
        raise BadInput(f"{thing.__qualname__}: a class inside a function cannot be registered")
    if name in registry and _OWN.get((kind, name)) != place:
        raise BadInput(f"there is a {kind} {name!r} already; choose another name")
    registry[name] = value
    _OWN[kind, name] = place
