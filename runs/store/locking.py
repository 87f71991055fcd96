"""A lock that a process holds on an open file, on every system; it goes with the process.

Unix locks the whole file, Windows its first byte, which need not be there.  The trap: neither
kind says anything over some network file systems; there two runs may not see one another.
"""

from __future__ import annotations

import importlib
import os
from typing import IO, Any


def _import_here(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError:
        return None


fcntl = _import_here("fcntl")  # None on Windows
msvcrt = _import_here("msvcrt")  # None everywhere else
KEEPS_OPEN_FILES = os.name == "nt"  # a file that is open cannot be removed there


def try_lock(file: IO) -> bool:
    """Lock an open file for this process alone, without waiting; False where another has it.

    The lock is given up when the file is closed.  Raises OSError where the file system has no
    locks.
    """
    if fcntl is not None:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
    elif msvcrt is not None:
        file.seek(0)
        try:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        except PermissionError:
            return False
    return True
