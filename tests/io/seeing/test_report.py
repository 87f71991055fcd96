"""Reports: one file without links to a network, with the numbers of the run in it."""

from __future__ import annotations

import base64
import builtins
import csv
import io
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("plotly")
pytest.importorskip("jinja2")

from runs.report.page import PICTURES, make_report
from runs.report.plots import make_panel, thin
from runs.report.study import report


class Page(HTMLParser):
    """Sources, links, text and how tags nest; stops where one is closed that is not open."""

    VOID = ("meta", "img", "br", "link", "input")

    def __init__(self, text: str):
        super().__init__()
        self.sources, self.links, self.words, self.open = [], [], [], []
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
    monkeypatch.setattr("runs.report.page.PICTURES", PICTURES[:1])


def test_a_page_has_all_in_it_and_nothing_from_a_network(run, shockgrid):
    shutil.copytree("run", "a<b>&c")  # words of the run cannot break the page
    code, said, error = shockgrid("report", "a<b>&c", "--dpi", "20")
    assert code == 0 and said.strip() == "a<b>&c/report.html", error
    text = Path(said.strip()).read_text()
    page = Page(text)
    assert "a<b>&c" in page.text
    assert all(source.startswith("data:") for source in page.sources)
    assert all(link.startswith(("#", "data:")) for link in page.links)
    assert "<script src" not in text and "@import" not in text
    assert "Plotly.newPlot" in text and "hottest" in page.text
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
    make_report("run", film=False, dpi=20)
    (link,) = (x for x in Page(Path("run/report.html").read_text()).links if x.startswith("data:"))
    Path("deck.toml").write_bytes(base64.b64decode(link.partition(",")[2]))
    assert shockgrid("run", "deck.toml", "-q", "-o", "again")[0] == 0
    assert shockgrid("compare", "run", "again")[0] == 0


def test_a_run_that_was_stopped_has_a_report(run, shockgrid, few_pictures):
    Path("run/summary.txt").unlink()
    for path in sorted(Path("run/dumps").iterdir())[1:]:
        path.unlink()
    page = Page(make_report("run", dpi=20).read_text())
    assert "not finished" in page.text and "theory 1.5" in page.text
    Path("run/history.csv").unlink()
    assert "No step was made" in make_report("run", dpi=20).read_text()


def test_a_study_links_the_reports_of_its_runs(run, shockgrid, few_pictures):
    home = Path("my study")
    (home / "runs").mkdir(parents=True)
    for name in ("first", "second"):
        shutil.copytree("run", home / "runs" / name)
    with open(home / "study.csv", "w", newline="") as file:
        csv.writer(file).writerows(
            [["density", "run", "error"], ["20", "first", "0.1"], ["<20>", "second", ""]]
        )
    code, said, error = shockgrid("report", str(home), "--dpi", "20")
    assert code == 0, error
    page = Page(Path(said.strip()).read_text())
    assert page.links == ["runs/first/report.html", "runs/second/report.html"]
    assert all((home / link).exists() for link in page.links) and "<20>" in page.text
    before = (home / "runs/first/report.html").stat().st_mtime_ns
    report(home, dpi=20)
    assert (home / "runs/first/report.html").stat().st_mtime_ns == before
    (home / "runs/second/deck.toml").write_text("problem = ")
    (home / "runs/second/report.html").unlink()
    page = Page(report(home, dpi=20).read_text())
    assert page.links == ["runs/first/report.html"] and "no report of second" in page.text


def test_thinned_curves_keep_their_extremes():
    t = np.linspace(0.0, 1.0, 30001)
    values = np.sin(40.0 * t)
    values[17003], values[21001], values[::11] = 7.0, -9.0, np.nan
    values[17003], values[21001] = 7.0, -9.0
    x, y = thin(t, values, 1000)
    assert len(x) == len(y) <= 1000 and (np.diff(x) > 0.0).all()
    assert (y.max(), y.min()) == (7.0, -9.0)
    same = thin(t[:500], values[:500], 1000)
    assert same[0].size == 500


def test_the_limits_of_dt_are_curves_of_their_own():
    history = {"dt": np.array([np.nan, 1e-3, 2e-3]), "dt_limit": np.array(["", "sound", "end"])}
    title, curves = make_panel(history, ["dt"], {})
    assert title == "dt [ms]" and [name for name, _, _ in curves] == ["sound", "end"]
    np.testing.assert_array_equal(curves[0][1], [np.nan, 1.0, np.nan])


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("run", "-o", "page.pdf"), "has to end in .html"),
        (("run", "-o", "nowhere/page.html"), "is no folder"),
        (("nowhere",), "nowhere does not exist"),
        (("empty",), "is no run directory"),
    ],
)
def test_wrong_words_are_told(run, shockgrid, words, told):
    Path("empty").mkdir()
    code, _, error = shockgrid("report", *words)
    assert code == 2 and told in error and len(error.splitlines()) == 1


@pytest.mark.parametrize("missing", ["plotly", "jinja2"])
def test_a_missing_library_is_named_with_its_extra(run, shockgrid, monkeypatch, missing):
    known = builtins.__import__

    def refuse(name, *rest, **more):
        if name.split(".")[0] == missing:
            raise ImportError(name)
        return known(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", refuse)
    code, _, error = shockgrid("report", "run", "--no-film", "--dpi", "20")
    assert code == 2 and missing in error and "shockgrid[report]" in error
    assert not Path("run/report.html").exists()
