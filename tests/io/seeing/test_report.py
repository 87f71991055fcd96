"""Reports: one file without links to a network, with the numbers of the run in it."""

from __future__ import annotations

import base64
import io
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("jinja2")

from shockgrid.runs.report import PICTURES, report


class Page(HTMLParser):
    """Sources, links, text and how tags nest; stops where one is closed that is not open."""

    VOID = ("meta", "img", "br", "link", "input")

    def __init__(self, text: str):
        super().__init__()
        self.sources = []
        self.links = []
        self.words = []
        self.open = []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        self.sources += [values["src"]] if "src" in values else []
        self.links += [values["href"]] if "href" in values else []
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag not in self.VOID:
            assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] not in ("script", "style"):
            self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())


@pytest.fixture
def run(shockgrid):
    words = ("--set", "density=20.0", "--set", "cells=6", "--set", "output.dumps=2")
    assert shockgrid("run", "toy", "-q", "-o", "run", *words)[0] == 0
    return Path("run")


@pytest.fixture
def few_pictures(monkeypatch):
    """Pages with the problem's own picture alone, where others do not matter."""
    monkeypatch.setattr("shockgrid.runs.report.PICTURES", PICTURES[:1])


def test_a_page_has_all_in_it_and_nothing_from_a_network(run, shockgrid):
    shutil.copytree("run", "a<b>&c")  # words of the run cannot break the page
    code, said, error = shockgrid("report", "a<b>&c", "--dpi", "20")
    assert code == 0 and said.strip() == "a<b>&c/report.html", error
    text = Path(said.strip()).read_text()
    page = Page(text)
    assert "a<b>&c" in page.text
    assert all(source.startswith("data:") for source in page.sources)
    assert all(link.startswith(("#", "data:")) for link in page.links)
    assert "@import" not in text
    assert "<script" not in text and "History" in page.text
    for words in (
        "t_end reached", "theory 1.5", "density 20 was never tried", "it was hot",
        "density = 20.0", "every cell convex", "not convex", "shockgrid run deck.toml",
        "cooling, drawn by the problem", "numpy",
    ):  # fmt: skip
        assert words in page.text, words
    film = page.sources.pop()
    assert re.match(r"data:(video/mp4|image/gif);base64,", film) and len(film) > 1000
    for source in page.sources:
        kind, _, content = source.partition(";base64,")
        assert kind == "data:image/png"
        with Image.open(io.BytesIO(base64.b64decode(content))) as picture:
            assert picture.width > 60 and len(np.unique(np.asarray(picture.convert("L")))) > 5


def test_the_deck_in_the_page_repeats_the_run(run, shockgrid, few_pictures):
    report("run", film=False, dpi=20)
    (link,) = (x for x in Page(Path("run/report.html").read_text()).links if x.startswith("data:"))
    Path("deck.toml").write_bytes(base64.b64decode(link.partition(",")[2]))
    assert shockgrid("run", "deck.toml", "-q", "-o", "again")[0] == 0
    assert shockgrid("compare", "run", "again")[0] == 0
