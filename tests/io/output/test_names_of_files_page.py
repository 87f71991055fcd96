"""Names on the page of files are in files that runs of packaged problems leave behind."""

from __future__ import annotations

import csv
import re
from fnmatch import fnmatch
from pathlib import Path

import h5py
import pytest

from builders import ROOT
from runs.cli.main import main

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


def list_names(folder: Path) -> set[str]:
    """Paths in a run's last dump, names of blocks as <name>, and attributes of groups."""
    names = set()
    with h5py.File(sorted((folder / "dumps").glob("*.h5"))[-1]) as file:
        blocks = list(file["blocks"])

        def note(path, entry):
            for block in blocks:
                path = re.sub(rf"^blocks/{block}(?=/|$)", "blocks/<name>", path)
            names.add(path)
            if isinstance(entry, h5py.Group):
                names.update(f"{path}/{name}" for name in entry.attrs)

        names.update(file.attrs)
        file.visititems(note)
    return names


def list_told() -> dict[str, list[str]]:
    """Groups of the page's outline of a dump, each with the names that stand in it."""
    outline = re.search(r"## A dump\n\n```\n(.*?)```", PAGE, re.DOTALL)[1]
    told, group = {}, ""
    for line in outline.splitlines():
        head, _, words = line.strip().partition("  ")
        if line.startswith("/"):
            group = head.strip("/")
            names = re.sub(r"^\s*attributes: ", "", words).split(",")
            told[group] = [] if "<key>" in head else [name.strip() for name in names]
        else:
            told[group] += [name.strip() for name in head.split(",")]
            told[group] += re.findall(r"; (\w+) at ", words)
    return told


def test_every_field_of_a_dump_is_on_the_page(folders):
    told = {f"blocks/<name>/{name}" for name in list_told()["blocks/<name>"]}
    for name in RUNS:
        fields = {path for path in list_names(folders / name) if path.startswith("blocks/<name>/")}
        assert fields - told == set()


def test_columns_of_the_history_are_those_of_the_page(folders):
    table = PAGE.partition("## The history")[2]
    first = "".join(line.split("|")[1] for line in table.splitlines() if line.startswith("| `"))
    told = re.findall(r"`([\w*]+)`", first)
    with open(folders / "flow" / "history.csv", encoding="utf-8") as file:
        columns = next(csv.reader(file))
    assert len(told) > 25
    # where lines slide, where they have tension, where lines come and go, where bodies meet
    elsewhere = {"pulled_pieces", "surface_energy", "cells"}
    elsewhere |= {"contacts_made", "contacts_opened", "contact_length"}
    strange = {one for one in told if not any(fnmatch(name, one) for name in columns)}
    assert strange == elsewhere
