"""Studies refused before anything is made, words from Python, and what a study says of its runs."""

from __future__ import annotations

import csv
import signal
import sys
from pathlib import Path

import pytest

from regrid.errors import BadInput
from runs.study.study import study

TOY = ("study", "toy", "--set", "shape=flat", "--set", "run.t_end=0.02", "--jobs", "1", "-q")
SHORT = {"shape": "flat", "run.t_end": 0.02}
HOT = {**SHORT, "start.kind": "hot"}


def test_a_study_of_another_deck_leaves_a_folder_alone(shockgrid, toy):
    assert shockgrid(*TOY, "--vary", "cells=4,6", "-o", "s")[0] == 0
    before = {path.name: path.read_bytes() for path in Path("s").iterdir() if path.is_file()}
    other = ("study", "riemann", "--vary", "cells=20,30", "-o", "s")
    for words in (other, (*other, "--dry-run")):
        code, _, err = shockgrid(*words)
        assert code == 2 and err.count("\n") == 1
        assert "a study of toy, not of riemann" in err and "another folder with -o" in err
    with pytest.raises(BadInput, match="a study of toy, not of riemann"):
        study("riemann", {"cells": [20, 30]}, "s")
    after = {path.name: path.read_bytes() for path in Path("s").iterdir() if path.is_file()}
    assert after == before
    code, out, _ = shockgrid(*TOY, "--vary", "cells=6,8", "-o", "s")
    assert code == 0 and "1 computed now, 1 there already" in out


def test_a_deck_file_that_was_moved_is_the_same_deck(shockgrid, toy):
    deck = Path("a/mine.toml")
    deck.parent.mkdir()
    deck.write_text('problem = "toy"\nshape = "flat"\nrun.t_end = 0.02\n')
    words = ("--vary", "cells=4,6", "-o", "s", "--jobs", "1", "-q")
    assert shockgrid("study", str(deck), *words)[0] == 0
    Path("other.toml").write_text(deck.read_text())
    code, _, err = shockgrid("study", "other.toml", *words)
    assert code == 2 and "a/mine.toml" in err and "other.toml" in err
    deck.rename("mine.toml")
    code, out, _ = shockgrid("study", "mine.toml", *words)
    assert code == 0 and "2 there already" in out


def test_python_takes_the_words_of_vary(toy):
    made = study("toy", {"cells": "4,6", "start.temperature": "1:2:2"}, "s", settings=HOT)
    assert made.table["cells"].tolist() == [4, 4, 6, 6]
    assert made.table["start.temperature"].tolist() == [1, 2, 1, 2]
    assert not made.failures
    one = study("toy", {"cells": 4}, "t", settings=SHORT)
    assert one.table["cells"].tolist() == [4]
    assert study("t").table["run"].tolist() == ["cells=4"]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("toy", "--vary", "cels=4,6"), "there is no key 'cels'; did you mean 'cells'?"),
        (("toy", "--vary", "cells=4,6", "--set", "densty=2"), "did you mean 'density'?"),
        (("toys", "--vary", "cells=4,6"), "there is no problem or deck 'toys'"),
        (("toy", "--vary", "start.temperature=1:2"), "a range is A:B:N"),
        (("toy", "--vary", "density=-1,-2"), "all 2 points are wrong; density=-1: "),
        (("toy", "--vary", "cells=5,7"), "all 2 points are wrong; cells=5: "),
        (("toy", "--vary", "cells=4,6", "--of", "nosuch"), "--of nosuch: no run has it; there are"),
        (("toy", "--vary", "cells=4,6", "--refine", "density"), "it is not varied"),
    ],
)
@pytest.mark.parametrize("dry", [False, True])
def test_what_is_wrong_at_all_points_makes_no_folder(shockgrid, toy, words, told, dry):
    code, _, err = shockgrid("study", *words, "-o", "s", "--jobs", "1", *["--dry-run"] * dry)
    assert code == 2 and err.count("\n") == 1
    assert told in err
    assert not Path("s").exists()


def test_python_refuses_what_is_wrong_at_all_points(toy):
    for vary, more in (({"cels": [4, 6]}, {}), ({"cells": [4, 6]}, {"shown": ["nosuch"]})):
        with pytest.raises(BadInput, match=r"'cells'|hottest"):
            study("toy", vary, "s", **more)
    assert not Path("s").exists()


def test_a_value_that_is_wrong_at_one_point_fails_it_alone(shockgrid, toy):
    words = (*TOY, "--vary", "density=-1,1", "-o", "s")
    code, out, _ = shockgrid(*words, "--of", "hottest")
    assert code == 3 and "2 runs: 1 computed now, 0 there already, 1 failed" in out


def test_cautions_of_runs_are_told(shockgrid, toy):
    words = (*TOY, "--vary", "density=1,20,30", "-o", "s")
    for told in ("3 computed now", "3 there already"):
        code, out, _ = shockgrid(*words)
        assert code == 0 and told in out
        assert "caution: 2 of 3 runs" in out
        assert "in 2 runs, such as: density 20 was never tried; take 10 or less" in out
        assert "in 2 runs: it was hot" in out
    made = study("s")
    closing = Path("s/runs/density=20/summary.txt").read_text()
    assert list(made.cautions) == ["density=20", "density=30"]
    assert all(f"caution: {sentence}" in closing for sentence in made.cautions["density=20"])
    rows = list(csv.DictReader(Path("s/study.csv").read_text().splitlines()))
    assert [row["cautions"] for row in rows] == [
        "",
        "density 20 was never tried; take 10 or less | it was hot",
        "density 30 was never tried; take 10 or less | it was hot",
    ]


def test_names_and_packages_that_are_missing_are_told(toy, monkeypatch):
    made = study("toy", {"cells": [4, 6]}, "s", settings=SHORT)
    with pytest.raises(KeyError, match="no column 'hotest'; did you mean 'hottest'"):
        made.table["hotest"]
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(BadInput, match="pip install xarray h5netcdf"):
        made.to_xarray()


def test_folders_say_what_they_are(shockgrid, toy):
    assert shockgrid(*TOY, "--vary", "cells=4,6", "-o", "s")[0] == 0
    Path("empty").mkdir()
    for words, told in (
        (("study", "empty"), "empty is no study: there is no study.toml"),
        (("study", "empty", "--vary", "cells=4", "-o", "t"), "empty is no study"),
        (("study", "s/runs/cells=4"), "cells=4 is no study: it is a run"),
        (("plot", "s"), "s is a study, no run: its runs lie in s/runs"),
        (("info", "s"), "s is a study, no run"),
        (("compare", "s", "s/runs/cells=4"), "s is a study, no run"),
    ):
        code, _, err = shockgrid(*words)
        assert code == 2 and told in err and err.count("\n") == 1


def test_a_stopped_study_says_how_to_go_on(toy):
    def stop(number, frame):
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, 0.5)
    try:
        with pytest.raises(KeyboardInterrupt, match=r"stopped with 2 runs to do; .*goes on"):
            study("toy", {"cells": [4, 6]}, "s", settings={**SHORT, "pause": 10.0})
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
