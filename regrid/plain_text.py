"""Text that people or files gave, made harmless before it is shown.

A name in a deck, a folder or an HDF5 file may hold characters that move the cursor, name the
window, or turn the direction of writing; a terminal obeys them.
"""

from __future__ import annotations

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


def cut(text: str, most: int = MOST_SHOWN) -> str:
    """`text` if it has at most so many characters, else its start and its end around "..."."""
    if len(text) <= most:
        return text
    end = most // 3
    return text[: most - end - 3] + "..." + text[-end:]


def make_plain_line(text: str, most: int = MOST_IN_LINE) -> str:
    """`text` on one line without controls, cut where it is long: for titles and sentences."""
    return cut(escape_controls(" ".join(text.splitlines())), most)
