"""Messages that name options of the command line, for callers in Python."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from shockgrid.regrid.errors import BadInput

# text in messages for the command line, and for callers in Python
PHRASES: Mapping[str, str] = {
    " and --set": " and the keywords",
    " with restart --set, or with --set in a new run": " in shockgrid.restart or in a new run",
    "--set: ": "",
    "--set ": "",
    ", or --force to": ", or force=True to",
    "--force": "force=True",
    "-o: ": "directory: ",
    "choose another with -o": "choose another",
    " with -o": "",
    "-o ": "output=",
}
COMMAND = r"shockgrid [a-z]+(?: [^\s;,)]+)*"  # to be typed as it stands
OPTION = r"--(?P<name>[a-z]+(?:-[a-z]+)*)(?P<value> (?=(?:\([^)]*\)|\S+):))?"  # --zoom 0,1: ...
ALONE = r"(?<![\w/-])"  # no part of a path or of another word
ALTERNATIVES = [
    (ALONE if words.startswith("-") else "") + re.escape(words)
    for words in sorted(PHRASES, key=len, reverse=True)
]
WORDS = re.compile(rf"(?P<command>{COMMAND})|(?P<phrase>{'|'.join(ALTERNATIVES)})|{ALONE}{OPTION}")


def say_in_python(words: str) -> str:
    """The message with Python keywords in place of options; commands stay as they are.

    The message is searched once from left to right, so replacements are not searched again.
    """

    def name_keyword(found: re.Match) -> str:
        if found["command"]:
            return found["command"]
        if found["phrase"]:
            return PHRASES[found["phrase"]]
        keyword = found["name"].replace("-", "_")
        return f"{keyword}=" if found["value"] else f"`{keyword}`"

    return WORDS.sub(name_keyword, words)


@contextmanager
def said_in_python() -> Iterator[None]:
    """Replace options of the command line by keywords in the messages of BadInput."""
    try:
        yield
    except BadInput as error:
        raise BadInput(say_in_python(str(error))) from error
