"""A figure as a file: its words harmless, and in its metadata what made it.

The trap: the name of a folder, a block or a deck may stand in a title.  A control character in it
has no shape to draw, and a lone "$" begins a formula that matplotlib then cannot read.
"""

from __future__ import annotations

from pathlib import Path
from typing import IO, Any

from matplotlib.cbook import is_math_text
from matplotlib.figure import Figure
from matplotlib.mathtext import MathTextParser
from matplotlib.text import Text

from regrid.text_files import escape_controls
from runs.store.provenance import describe_software, hash_deck

NAMES = {  # of the fields of metadata: what made it, what of
    "png": ("Software", "Description"), "pdf": ("Creator", "Subject"),
    "svg": ("Creator", "Description"), "eps": ("Creator", None), "ps": ("Creator", None),
}  # fmt: skip


def write_figure(
    figure: Figure,
    target: Path | IO[bytes],
    dpi: int,
    ending: str,
    deck_text: str | None = None,
) -> None:
    """Write a figure in the format of that ending.

    deck_text: the resolved deck as TOML of the run that is shown; its digest goes into the file.
    Raises OSError where the disk does not take it.
    """
    clean_words(figure)
    metadata = make_metadata(ending, deck_text)
    figure.savefig(target, dpi=dpi, format=ending, metadata=metadata or None)


def clean_words(figure: Figure) -> None:
    """Escape controls in all words of a figure; those that are no formula are drawn as they are."""
    for text in figure.findobj(Text):
        words = text.get_text()
        if (plain := escape_controls(words)) != words:
            text.set_text(plain)
        if "$" in plain and not _is_formula(plain):
            text.set_parse_math(False)


def _is_formula(words: str) -> bool:
    if not is_math_text(words):
        return True
    try:
        for line in words.splitlines():
            MathTextParser("path").parse(line)
    except ValueError:
        return False
    return True


def make_metadata(ending: str, deck_text: str | None) -> dict[str, Any]:
    """Names and words on what made a file; {} for formats without a place for them."""
    maker, content = NAMES.get(ending.lower(), (None, None))
    words = {maker: describe_software()} if maker else {}
    if content and deck_text is not None:
        words[content] = f"deck SHA-256 {hash_deck(deck_text)}"
    return words
