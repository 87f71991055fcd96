"""Files that shockgrid 0.1 wrote, kept here as they were, are still read."""

from __future__ import annotations

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest

import shockgrid as sg
from runs.store.checksum import is_sound

KEPT = Path(__file__).parent / "files_of_0_1"


@pytest.fixture
def old(toy):
    shutil.copytree(KEPT, toy / "old")
    return toy / "old"


def test_info_and_compare(shockgrid, old):
    code, text, error = shockgrid("info", "old")
    assert (code, error) == (0, "")
    assert "interface-instability" in text and "step 6, t = 0.0685962 s" in text
    assert "block first: 34 x 4 cells" in text and "2 dumps" in text
    code, text, _ = shockgrid("compare", "old", "old")
    assert code == 0 and "no difference" in text


def test_the_numbers_are_those_that_were_written(old):
    run = sg.open(old)
    assert run.history.step.tolist() == list(range(7)) and run.dumps[-1].step == 6
    assert run.dumps[-1].t == run.history.t[-1]
    for dump in run.dumps:
        assert is_sound(dump.path) is None  # no checksum then
        with h5py.File(dump.path) as file:
            assert file.attrs["format_version"] == 1 and "t_unit" not in file.attrs
            stored = file["state/first/state"][()]
        np.testing.assert_array_equal(stored[0], dump["first"].rho)
    mass = [name for name in run.history if name.startswith("total_mass")]
    assert mass and all(np.ptp(run.history[name]) < 1e-14 for name in mass)
