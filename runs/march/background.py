"""A file that is written while the run goes on: one at a time, by a thread.

The trap: what follows a file (older restart points go, the sidecar shows it) must not be done
before it is on the disk.  It is done by the thread of the run, when that looks and the file is
there.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType
from typing import Any

from regrid.errors import BadInput


class Background:
    """Writes one file at a time; as a context it is left when the last one is written."""

    def __init__(self) -> None:
        self._executor: ThreadPoolExecutor | None = None
        self._writing: Future[Any] | None = None
        self._then: Callable[[], None] | None = None
        self._steps = math.inf

    def start(
        self, write: Callable[[], Any], then: Callable[[], None], steps: float = math.inf
    ) -> None:
        """Call `write` in the thread, when what is being written is; `then` follows in `finish`.

        steps: of the run that leave alone what is written; the one after them waits.
        """
        self.finish()
        self._executor = self._executor or ThreadPoolExecutor(1, thread_name_prefix="dump")
        self._writing, self._then = self._executor.submit(write), then
        self._steps = steps
        if steps < 1:
            self.finish()

    def begin_step(self) -> None:
        """Wait for the file before a step that writes to what the file is read from."""
        if self._steps < 1:
            self.finish()
        self._steps -= 1

    def look(self) -> None:
        """`finish`, where that needs no waiting."""
        if self._writing is not None and self._writing.done():
            self.finish()

    def finish(self) -> None:
        """Wait for the file and do what follows.  Raises what its writing has raised, once."""
        if self._writing is None or self._then is None:
            return
        writing, then = self._writing, self._then
        writing.exception()  # waits; interrupted, it can be waited for again
        self._writing = self._then = None
        writing.result()
        then()

    def __enter__(self) -> Background:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Finish; where something else has failed before, that is what is told."""
        try:
            with contextlib.suppress(BadInput) if kind else contextlib.nullcontext():
                self.finish()
        finally:
            if self._executor is not None:
                self._executor.shutdown()
                self._executor = None
