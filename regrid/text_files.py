"""Text and TOML from users: read so that nothing can stop the program, and printed safely.

A pipe without a writer would block, a device never ends, tables nested thousands deep overflow the
stack, and a number with thousands of digits cannot be printed: each of these is rejected with a
message.  A name in a deck, a folder or an HDF5 file may contain control characters that move the
cursor, rename the window, or reverse the direction of writing; they are not sent to a terminal.
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shockgrid.regrid.errors import BadInput

if TYPE_CHECKING:
    import numpy as np

MOST_BYTES = 64_000_000  # of a text that is read whole
DEEPEST_NESTING = 100  # tables and lists in one another
MOST_BITS = 1024  # of a whole number: those of the largest float
PIPES = ("/dev/stdin", "/dev/fd/", "/proc/self/fd/")  # given by a shell, with a writer


class TooMuch(tomllib.TOMLDecodeError):
    """A TOML text whose numbers are too long, or whose tables lie too deep in one another."""


def read_text(path: str | Path) -> str:
    """The text (UTF-8, with a mark at its start or none) of a file.

    Raises OSError where it cannot be opened, UnicodeDecodeError where it is no text, BadInput for
    what is no file or is larger than MOST_BYTES.
    """
    path = Path(path)
    check_regular(path)
    with path.open("rb") as file:
        content = file.read(MOST_BYTES + 1)
    if len(content) > MOST_BYTES:
        raise BadInput(f"{path} is larger than {MOST_BYTES // 10**6} MB, which no such file is")
    return content.decode("utf-8-sig")


def read_columns(path: str | Path, counts: Sequence[int] = (2,), where: str = "") -> np.ndarray:
    """Columns (k, n) of finite numbers in a text file, k one of `counts`, n at least 2.

    Numbers are parted by blanks or commas; # begins a comment.  Raises BadInput naming the file,
    as `where` does if it is given.
    """
    import numpy as np  # slow to load, and texts are read before

    where = where or str(path)
    try:
        text = read_text(path).replace(",", " ")
        lines = [line for line in text.splitlines() if line.partition("#")[0].strip()]
        values = np.loadtxt(lines, ndmin=2) if lines else np.empty((0, 2))
    except OSError as error:
        raise BadInput(f"{where} cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise BadInput(f"{where}: columns of numbers are wanted ({error})") from None
    if values.shape[1] not in counts or values.shape[0] < 2:
        raise BadInput(
            f"{where}: {' or '.join(map(str, counts))} columns of at least two numbers are wanted; "
            f"it has {values.shape[0]} lines of {values.shape[1]}"
        )
    if not np.isfinite(values).all():
        raise BadInput(f"{where} holds numbers that are not finite")
    return np.ascontiguousarray(values.T)


def check_regular(path: str | Path) -> None:
    """Raise BadInput for a pipe, a socket or a device, whose reading may never end.

    Pipes that a shell has put in a file's place pass.
    """
    is_ordinary = os.path.isdir(path) or os.path.isfile(path) or not os.path.exists(path)
    if not is_ordinary and not str(path).startswith(PIPES):
        raise BadInput(f"{path} is not a file but a device, a pipe or a socket")


def load_toml(text: str) -> dict[str, Any]:
    """The table in a TOML text; TOMLDecodeError for what is wrong with it, TooMuch among those."""
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        raise
    except RecursionError:
        raise TooMuch(_TOO_DEEP) from None
    except ValueError:  # Python turns no text of more digits into a number
        raise TooMuch(_TOO_LONG) from None
    check_plain(table)
    return table


_TOO_DEEP = f"lists or tables lie more than {DEEPEST_NESTING} deep in one another"
_TOO_LONG = "a whole number has hundreds of digits"


def check_plain(value: Any) -> None:
    """Raise TooMuch for tables too deep and whole numbers beyond the largest float."""
    items = [value]
    for _ in range(DEEPEST_NESTING):
        inner_items: list[Any] = []
        for item in items:
            if isinstance(item, Mapping):
                inner_items += item.values()
            elif isinstance(item, list | tuple):
                inner_items += item
            elif isinstance(item, int) and item.bit_length() > MOST_BITS:
                raise TooMuch(_TOO_LONG)
        if not inner_items:
            return
        items = inner_items
    raise TooMuch(_TOO_DEEP)


MOST_SHOWN = 60  # characters of a value in a sentence
MOST_IN_LINE = 1000  # of a sentence


def escape_controls(text: str) -> str:
    r"""`text` with all that is not printed written as \u001b; ends of lines and tabs stay.

    That is C0 and C1 controls, marks of direction and of no width, separators other than a blank,
    halves of pairs (bytes of a file name that are no UTF-8), and what no standard assigns.
    """
    if text.isprintable():
        return text
    return "".join(c if c in "\n\t" or c.isprintable() else _escape(c) for c in text)


def _escape(character: str) -> str:
    number = ord(character)
    return f"\\u{number:04x}" if number < 0x10000 else f"\\U{number:08x}"


def cut(text: str, longest: int = MOST_SHOWN) -> str:
    """`text` if it has at most so many characters, else its start and its end around "..."."""
    if len(text) <= longest:
        return text
    kept_at_end = longest // 3
    return text[: longest - kept_at_end - 3] + "..." + text[-kept_at_end:]
