"""What is printed to a terminal or a pipe that does not know every sign."""

from __future__ import annotations

import sys
from io import TextIOWrapper


def print_what_can_be_shown() -> None:
    """From here on standard output and error show "?" for signs that their encoding has not got.

    Python opens standard output so that such a sign raises UnicodeEncodeError: a name in Greek, in
    a pipe on Windows.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")
