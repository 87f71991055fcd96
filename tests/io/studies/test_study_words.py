"""Studies refused before anything is made, words from Python, and what a study says of its runs."""

from __future__ import annotations

from pathlib import Path

import pytest

from regrid.errors import BadInput
from runs.study.study import study

TOY = ("study", "toy", "--set", "shape=flat", "--set", "run.t_end=0.02", "--jobs", "1", "-q")


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
