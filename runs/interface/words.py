"""A small table in HTML, for what notebooks show of a case or a run."""

from __future__ import annotations

import html
from collections.abc import Sequence


def make_table(rows: Sequence[tuple[str, str]]) -> str:
    """Two columns: what, and its value; both as plain text."""
    lines = "".join(
        f"<tr><th style='text-align:left'>{html.escape(what)}</th>"
        f"<td style='text-align:left'>{html.escape(value)}</td></tr>"
        for what, value in rows
    )
    return f"<table>{lines}</table>"
