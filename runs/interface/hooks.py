"""Functions that are called while a run marches: `case.run("out/mine", hooks=[function])`.

A hook is called with the case after a step is recorded, and ends the run by returning words that
say why.  It sees what `Case` shows, so that it cannot change what is computed; what it raises ends
the run with a restart point.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Protocol

from regrid.errors import BadInput


class Marched(Protocol):
    """What tells when a hook is due; `runs.interface.case.Case` is one."""

    @property
    def t(self) -> float:
        """Time [s]."""
        ...

    @property
    def step(self) -> int:
        """Number of the last step."""
        ...


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

    def is_due(self, case: Marched, t_before: float) -> bool:
        """Is it to be called after the step from `t_before` to the time of the case?"""
        if self.time is not None:
            return math.floor(case.t / self.time) > math.floor(t_before / self.time)
        return case.step % (self.steps or 1) == 0


HooksGiven = Sequence[Hook | HookFunction] | Hook | HookFunction


class Hooks:
    """All hooks of a run; called after each step."""

    def __init__(self, case: Marched, hooks: HooksGiven):
        self.case = case
        if isinstance(hooks, Hook) or not isinstance(hooks, Sequence):
            hooks = [hooks]
        self.hooks = [hook if isinstance(hook, Hook) else Hook(hook) for hook in hooks]

    def __call__(self, t_before: float) -> str | None:
        """Call those that are due after the step from `t_before` [s]; the first reason to stop.

        Raises BadInput for what is neither None nor text.
        """
        due = [hook for hook in self.hooks if hook.is_due(self.case, t_before)]
        for hook in due:
            reason = hook.function(self.case)
            if reason is not None and not isinstance(reason, str):
                name = getattr(hook.function, "__name__", "hook")
                raise BadInput(
                    f"{name} returned {reason!r}: a hook returns None, or words on why to stop"
                )
            if reason:
                return reason
        return None
