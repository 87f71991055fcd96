"""What the system refuses, in one sentence: errors that no part of the program has put into words.

A path too long, a loop of links, a folder that may not be entered: none of them is a mistake in
the program, whichever line met it first.
"""

from __future__ import annotations

import os
from pathlib import Path

from runs.store.files import describe_disk_error

NAMES = {  # what Python says where a name is none that a file can have
    "embedded null byte": "a file's name cannot hold the character \\u0000",
    "embedded null character": "a file's name cannot hold the character \\u0000",
}


def describe_outside(error: BaseException) -> str | None:
    """A sentence on an error of the system or of a file's name; None for any other error."""
    if isinstance(error, OSError) and error.errno is not None:
        if error.filename is None:
            return f"a file or device that was given cannot be used: {os.strerror(error.errno)}"
        return describe_disk_error(error, Path(os.fsdecode(error.filename)))
    if isinstance(error, UnicodeEncodeError) and error.reason == "surrogates not allowed":
        return "a name that was given is no text in UTF-8; rename it, or give another"
    words = str(error)
    if isinstance(error, RuntimeError) and words.startswith("Symlink loop from"):
        return f"{words.removeprefix('Symlink loop from ')} is a link that leads back to itself"
    return NAMES.get(words) if isinstance(error, ValueError) else None
