"""Names on the page of files are in files that runs of packaged problems leave behind."""

from __future__ import annotations

import csv
import re
from fnmatch import fnmatch

import h5py
import pytest

from builders import ROOT
from shockgrid.runs.cli.main import main

PAGE = (ROOT / "docs" / "files.md").read_text(encoding="utf-8")
RUNS = {
    "flow": ("interface-instability", "cells=8", "width=1"),
    "convection": ("heated-cavity", "cells=8"),
    "grid": ("grid-march", "ni=6", "nj=6"),
}


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Run directories of one step each."""
    base = tmp_path_factory.mktemp("files")
    for name, (problem, *settings) in RUNS.items():
        words = [word for setting in (*settings, "run.max_steps=1") for word in ("--set", setting)]
        assert main(["run", problem, *words, "-q", "-o", str(base / name)]) in (0, 3)
    return base


@pytest.mark.parametrize("name", RUNS)
def test_every_field_of_a_dump_is_on_the_page(folders, name):
    names = set()
    with h5py.File(sorted((folders / name / "dumps").glob("*.h5"))[-1]) as file:
        for block in file["blocks"].values():
            names |= {*block, *block.attrs}
    assert names <= set(re.findall(r"\w+", PAGE))


def test_columns_of_the_history_are_those_of_the_page(folders):
    table = PAGE.partition("## The history")[2]
    first = "".join(line.split("|")[1] for line in table.splitlines() if line.startswith("| `"))
    told = re.findall(r"`([\w*]+)`", first)
    with open(folders / "flow" / "history.csv", encoding="utf-8") as file:
        columns = next(csv.reader(file))
    assert len(told) > 25
    # where lines slide, where they have tension, where lines come and go, where blocks become one,
    # where bodies meet
    elsewhere = {"pulled_pieces", "surface_energy", "cells", "handover"}
    elsewhere |= {"contacts_made", "contacts_opened", "contact_length", "contact_overlap"}
    elsewhere |= {"contact_pushed_nodes", "contact_pushed_area"}
    elsewhere |= {"handover"}  # where both materials may go on one grid
    strange = {one for one in told if not any(fnmatch(name, one) for name in columns)}
    assert strange == elsewhere
