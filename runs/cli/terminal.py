"""Terminal output: the nearest name for a mistyped command, text without control characters,
system errors as one sentence.
"""

from __future__ import annotations

import io
import os
import re
import sys
from collections.abc import Sequence
from io import TextIOWrapper
from pathlib import Path

import click

from shockgrid.problems.problem_file import describe_mistake
from shockgrid.problems.registry import is_problem
from shockgrid.regrid.errors import BadInput, RunFailure, suggest
from shockgrid.regrid.text_files import MOST_IN_LINE, cut, escape_controls
from shockgrid.runs.store.files import describe_disk_error


class Commands(click.Group):
    """Commands in the order in which users meet them; mistyped ones get the nearest name."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(self.commands)

    def resolve_command(self, ctx: click.Context, args: list[str]):
        if args and args[0] not in self.commands and not args[0].startswith("-"):
            command_words = " ".join(ctx.command_path.split()[1:])
            within = f" of {command_words!r}" if command_words else ""
            hint = suggest(args[0], self.commands)
            raise BadInput(f"there is no command {args[0]!r}{within}{hint}")
        return super().resolve_command(ctx, args)


PAIRS = ("--set", "--vary", "--option")  # options whose value is key=value
NUMBER = re.compile(r"-[\d.]")  # begins a negative one, and no option


def check_pairs(arguments: Sequence[str]) -> None:
    """Raise BadInput for `--set mach 2` and the like, with the correct form: `--set mach=2`.

    An argument that may be the deck is not taken for the value.
    """
    for place, option in enumerate(arguments):
        if option not in PAIRS:
            continue
        key, *next_words = [*arguments[place + 1 : place + 4], ""]
        name = key.removesuffix("=")
        if not name or name.startswith("-") or "=" in name:
            continue
        following = next_words[:2] if next_words[0] == "=" else next_words[:1]
        value = "".join(following).removeprefix("=")
        if not value or (value.startswith("-") and not NUMBER.match(value)) or is_deck(value):
            continue
        raise BadInput(f"{' '.join([option, key, *following])}: write {option} {name}={value}")


def is_deck(word: str) -> bool:
    """Whether an argument may be the problem, deck or directory that a command is for."""
    from shockgrid.runs.deck.reading import packaged_decks

    return is_problem(word) or word in packaged_decks() or Path(word).exists()


def echo(text: object = "", err: bool = False, nl: bool = True) -> None:
    """Print text from users or files to standard output or standard error, escaped."""
    click.echo(escape_controls(str(text)), err=err, nl=nl)


def echo_sentences(text: str, start: str = "shockgrid: ") -> None:
    """Print each line of an error to standard error behind `start`, cut where it is long."""
    for sentence in text.splitlines():
        echo(f"{start}{cut(sentence, MOST_IN_LINE)}", err=True)


def echo_usage(error: click.ClickException) -> None:
    """Print click's message about a mistyped command."""
    usage = io.StringIO()
    error.show(file=usage)
    for line in usage.getvalue().splitlines():
        echo(cut(line, MOST_IN_LINE), err=True)


# exit codes
EXIT_BAD_INPUT = 2
EXIT_FAILED = 3
EXIT_INTERNAL = 70
NULL = ("embedded null byte", "embedded null character")  # Python's messages about a name


def describe_error(error: Exception) -> tuple[int, str]:
    """Exit code and message for an error that ends a command."""
    if isinstance(error, MemoryError) or "unable to allocate memory" in str(error):  # HDF5's words
        return EXIT_BAD_INPUT, "not enough memory; fewer cells need less"
    if isinstance(error, BadInput | RunFailure):
        return EXIT_BAD_INPUT if isinstance(error, BadInput) else EXIT_FAILED, str(error)
    if mistake := describe_mistake(error):
        return EXIT_BAD_INPUT, f"{mistake}; --debug shows the traceback"
    message = str(error)
    if isinstance(error, OSError) and error.errno is not None:
        if error.filename is not None:
            return EXIT_BAD_INPUT, describe_disk_error(error, Path(os.fsdecode(error.filename)))
        return EXIT_BAD_INPUT, f"a given file or device cannot be used: {os.strerror(error.errno)}"
    if isinstance(error, UnicodeEncodeError) and error.reason == "surrogates not allowed":
        return EXIT_BAD_INPUT, "a given name is not valid UTF-8; rename it, or give another"
    if isinstance(error, RuntimeError) and message.startswith("Symlink loop from"):
        name = message.removeprefix("Symlink loop from ")
        return EXIT_BAD_INPUT, f"{name} is a link that leads back to itself"
    if isinstance(error, ValueError) and message in NULL:
        return EXIT_BAD_INPUT, "a file's name cannot hold the character \\u0000"
    kind = type(error).__name__
    return EXIT_INTERNAL, f"a mistake in shockgrid itself ({kind}: {error}); --debug shows where"


def print_what_can_be_shown() -> None:
    """Make standard output and error print "?" for characters that their encoding lacks.

    By default Python raises UnicodeEncodeError for them, as for a Greek name in a pipe on Windows.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")
