"""What the site adds to the pages; the building of the site itself is `make docs`."""

from __future__ import annotations

import importlib.util

import pytest

import shockgrid
from builders import ROOT


@pytest.fixture(scope="module")
def build():
    pytest.importorskip("mkdocs")
    pytest.importorskip("pylatexenc")
    spec = importlib.util.spec_from_file_location("site_build", ROOT / "docs/site/build.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_public_name_has_a_line(build):
    lines = build.describe_names().splitlines()[2:]
    told = {line.split("`")[1].removeprefix("sg."): line.split(" | ")[1] for line in lines}
    assert told.keys() == shockgrid.MODULES.keys()
    assert all(len(words) > 12 for words in told.values()), told


@pytest.mark.parametrize(
    ("tex", "plain"),
    [
        (r"<p>at \(k\,a_0 = 0.5\)</p>", "<p>at k a_0 = 0.5</p>"),
        (r"\[ \frac{\partial \rho}{\partial t} \le \Delta\lambda_{ij} \]", "∂ρ/∂t ≤ Δλ_ij"),
        (r"\(p_\mathrm{H}\) and \(\sqrt{x}\)", "p_H and √(x)"),
        ("a price of $5 and a set {1}", "a price of $5 and a set {1}"),
    ],
)
def test_hits_of_the_search_have_plain_formulas(build, tex, plain):
    assert build.clean_entry("theory/flow/", tex).replace(" ", "") == plain.replace(" ", "")


def test_hits_of_notebooks_and_of_the_reference(build):
    assert build.clean_entry("notebooks/film/", r"$c^2$ of $\rho$") == "c^2 of ρ"
    entry = "<p>What.</p> Source code in <code>a.py</code> <pre>x</pre>"
    assert build.clean_entry("reference/runs/", entry) == "<p>What.</p> "


@pytest.mark.parametrize(
    "words",
    [
        "reshock", "free-surface velocity", "VISAR", "spall", "checkpoint", "slide line",
        "mesh refinement", "phase inversion", "parameter study", "movie", "boundary conditions",
        "initial conditions", "tracer", "ALE", "cavitation", "Slurm",
    ],
)  # fmt: skip
def test_words_of_other_codes_lead_somewhere(words):
    pages = (ROOT / "docs").rglob("*.md")
    assert any(words.lower() in page.read_text().lower() for page in pages)
