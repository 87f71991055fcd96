"""Names of code in the pages about code are names in the code."""

from __future__ import annotations

import re

import pytest

from builders import ROOT
from hydro.step import SIDE_PASSES

PACKAGES = ("regrid", "hydro", "problems", "runs", "shockgrid")
SOURCES = "\n".join(
    path.read_text(encoding="utf-8")
    for package in PACKAGES
    for path in sorted((ROOT / package).rglob("*.py"))
)
WORDS = set(re.findall(r"\w+", SOURCES))
NAME = re.compile(r"`([A-Za-z_][\w.]*)(?:\(.*?\))?`")
FENCE = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)
NOT_CODE = {"toml", "csv", "py", "md", "history"}  # endings of files


@pytest.mark.parametrize("page", ["architecture.md", "extending.md"])
def test_names_are_in_the_code(page):
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    own = set(re.findall(r"\w+", " ".join(FENCE.findall(text))))  # of the page's examples
    names = {name for name in NAME.findall(FENCE.sub("", text)) if "_" in name or "." in name}
    names |= {name for name in NAME.findall(text) if re.match(r"[A-Z]\w+[a-z]$", name)}
    assert len(names) >= 5
    known = WORDS | own | NOT_CODE
    strange = {name for name in names if not set(name.split(".")) - {""} <= known}
    assert not strange


def test_passes_stand_in_the_page_in_their_order():
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    names = [move.__name__ for move, _, _ in SIDE_PASSES]
    assert [name for name in NAME.findall(text[text.index("| pass |") :]) if name in names] == names
    assert all(reason for _, _, reason in SIDE_PASSES)
