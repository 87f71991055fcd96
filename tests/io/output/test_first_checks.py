"""`check` and `run --dry-run` refuse what a run refuses, with the same sentence."""

from __future__ import annotations

from pathlib import Path

import pytest

COMPILING = "compiling kernels, once on this machine: a minute, several on a busy one ...\n"
HEAD = 'problem = "interface-instability"\ncells = 16\nlengths = [2, 2]\n'
REFUSED = [
    ('[regrid]\nname = "barier"', "there is none called 'barier'; did you mean 'barrier'?"),
    ("[regrid]\noptions = {family = 3}", "family 3 must be 'auto', 'i', 'j'"),
    ("[regrid]\noptions = {famly = 'i'}", "has no option 'famly'; did you mean 'family'?"),
    ("[output]\ntimes = [0.1, 99.0]", "output.times has 99, which is after the end of the run"),
    ('[output]\nfields = ["rhoo"]', "did you mean 'rho'?"),
    ('[output]\ncolumns = ["none"]', "no installed package has a group of history columns 'none'"),
    (
        '[[gauge]]\nname = "far"\nat = [99.0, 0.1]\nmoves = true',
        "gauge 'far' moves with the material, but at [99, 0.1] there is none",
    ),
]


@pytest.mark.parametrize(("lines", "words"), REFUSED)
def test_check_says_what_a_run_would(shockgrid, lines, words):
    Path("mine.toml").write_text(HEAD + lines)
    for command in (["check"], ["run", "--dry-run"], ["run", "-q", "-o", "never"]):
        code, out, error = shockgrid(*command, "mine.toml")
        assert (code, out) == (2, ""), command
        error = error.removeprefix(COMPILING)  # where it has to look into cells, the first time
        assert words in error and error.startswith("shockgrid: mine.toml: "), error
        assert error.count("\n") == 1 and not Path("never").exists()


def test_what_a_run_takes_passes(shockgrid):
    lines = '[output]\nfields = ["rho"]\ntimes = [0.1]\n[[gauge]]\nname = "a"\nat = [99.0, 0.1]'
    Path("mine.toml").write_text(HEAD + lines)
    assert shockgrid("check", "mine.toml")[0] == 0
    assert shockgrid("run", "--dry-run", "mine.toml")[0] == 0
