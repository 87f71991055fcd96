"""The one way to the terminal of all commands: controls escaped."""

from __future__ import annotations

import io

import click

from regrid.text_files import MOST_IN_LINE, cut, escape_controls


def echo(text: object = "", err: bool = False, nl: bool = True) -> None:
    """Print to standard output, or to standard error, what people or files may have written."""
    click.echo(escape_controls(str(text)), err=err, nl=nl)


def echo_sentences(text: str, start: str = "shockgrid: ") -> None:
    """Print each line of an error to standard error behind `start`, cut where it is long."""
    for sentence in text.splitlines():
        echo(f"{start}{cut(sentence, MOST_IN_LINE)}", err=True)


def echo_usage(error: click.ClickException) -> None:
    """Print what click has to say about a mistyped command."""
    words = io.StringIO()
    error.show(file=words)
    for line in words.getvalue().splitlines():
        echo(cut(line, MOST_IN_LINE), err=True)
