"""`check` and `run --dry-run` look at a deck without compiling a kernel."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from builders import ROOT
from shockgrid.regrid.compilation.first_calls import MOST_NUMBERS, interpreted
from shockgrid.regrid.jit import kernel
from shockgrid.regrid.measure.quality import compute_corner_areas

LOOK = """
import json
import sys
import click.testing
from numba.core.event import install_recorder
from shockgrid.problems.registry import OWN
from shockgrid.runs.cli.main import cli
from shockgrid.runs.deck.reading import packaged_decks, read_deck

runner, told = click.testing.CliRunner(), {}
for name in sorted({*packaged_decks(), *OWN} if "all" in sys.argv else OWN):
    if read_deck(name).deck.gauge:
        continue  # is asked for by blocks that can march
    for words in (["check", name], ["run", name, "--dry-run"]):
        with install_recorder("numba:compile") as recorder:
            done = runner.invoke(cli, words, standalone_mode=False)
        told[" ".join(words)] = [repr(done.exception), len(recorder.buffer), done.output]
print(json.dumps(told))
"""


@pytest.mark.parametrize("which", ["own", pytest.param("all", marks=pytest.mark.slow)])
def test_no_deck_compiles_a_kernel_when_it_is_looked_at(tmp_path, which):
    environment = os.environ | {"SHOCKGRID_CACHE_DIR": str(tmp_path / "cache")}
    done = subprocess.run(
        [sys.executable, "-c", LOOK, which],
        capture_output=True, text=True, cwd=ROOT, env=environment, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout.splitlines()[-1])
    assert len(told) > 35
    assert {words for words, (error, *_) in told.items() if error != "None"} == set()
    assert {words: n for words, (_, n, *_) in told.items() if n} == {}
    assert all("cost: memory about" in told[words][2] for words in told if "--dry-run" in words)


def make_divide():
    """A kernel of its own for each test."""

    @kernel
    def divide(values, divisor):
        for k in range(values.size):
            values[k] = values[k] / divisor
        return values

    return divide


def test_a_kernel_that_is_looked_at_is_no_compiled_one():
    divide = make_divide()
    values = np.arange(3.0)
    with interpreted():
        assert divide(values, 2.0).tolist() == [0.0, 0.5, 1.0]
        assert np.isnan(divide(np.zeros(1), values[0])).all()  # no warning, no error
        assert not divide.signatures
    assert divide(values, 2.0).tolist() == [0.0, 0.25, 0.5]
    assert len(divide.signatures) == 1


def test_large_arrays_are_not_left_to_python():
    divide = make_divide()
    with interpreted():
        divide(np.ones(MOST_NUMBERS + 1), 2.0)
    assert len(divide.signatures) == 1


@pytest.mark.parametrize("shape", [(3, 4), (7, 2)])
def test_python_gives_the_numbers_of_the_kernel(shape):
    rng = np.random.default_rng(7)
    ni, nj = shape
    nodes = np.array(np.meshgrid(np.arange(ni + 1.0), np.arange(nj + 1.0), indexing="ij"))
    nodes += rng.uniform(-0.3, 0.3, nodes.shape)
    with interpreted():
        seen = compute_corner_areas(nodes)
    np.testing.assert_array_equal(seen, compute_corner_areas(nodes))
