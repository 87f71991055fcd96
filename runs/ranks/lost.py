"""A sentence for a run of which a rank has died.

When a rank dies, mpiexec sends SIGTERM to the others, and soon ends them by force.  The
first rank waits in MPI then, where Python calls no handler of a signal.  The signal's number goes
through a socket to a thread, which says where the run can be taken up.
"""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterator

PATIENCE = 0.05  # seconds: less than mpiexec has


@contextlib.contextmanager
def loss_told(several: bool, is_heard: Callable, describe: Callable[[], str]):
    """In the block: SIGTERM that the main thread does not hear of is told on standard error.

    several: are there other ranks at all?  is_heard: has the main thread's handler been called?
    describe: gives the end of the sentence.  Only a main thread can watch; others pass.
    """
    if not several or threading.current_thread() is not threading.main_thread():
        yield
        return
    ours, theirs = socket.socketpair()
    theirs.setblocking(False)
    before = signal.set_wakeup_fd(theirs.fileno(), warn_on_full_buffer=False)
    watch = threading.Thread(target=_watch, args=(ours, is_heard, describe), daemon=True)
    watch.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        theirs.close()
        watch.join()
        ours.close()


def _watch(
    ours: socket.socket, is_heard: Callable[[], object], describe: Callable[[], str]
) -> None:
    for number in _read(ours):
        if number == signal.SIGTERM:
            time.sleep(PATIENCE)
            if not is_heard():
                words = (
                    "asked to stop, after this step; where a rank has died, there is no end of it: "
                )
                os.write(2, f"\nshockgrid: {words}{describe()}\n".encode())


def _read(ours: socket.socket) -> Iterator[int]:
    while numbers := ours.recv(64):
        yield from numbers
