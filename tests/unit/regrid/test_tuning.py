"""The numbers of the barrier regridder: all in one place, few, each with its formula."""

import re
from dataclasses import fields
from pathlib import Path

import pytest

from builders import ROOT
from regrid.barrier.regridder import BarrierRegridder
from regrid.barrier.tuning import DEFAULT, Tuning
from regrid.errors import BadInput

MOST = 40
FIELD = re.compile(r"^    (\w+): [^=]+ = [^#]+# (.*)$", re.MULTILINE)


def test_numbers_are_few_and_each_names_its_formula():
    source = Path(ROOT / "regrid" / "barrier" / "tuning.py").read_text(encoding="utf-8")
    found = dict(FIELD.findall(source))
    assert list(found) == [field.name for field in fields(Tuning)] and len(found) <= MOST
    theory = Path(ROOT / "docs" / "theory" / "regridding.md").read_text(encoding="utf-8")
    for name, words in found.items():
        numbers = re.findall(r"R\d+\.\d+", words)
        assert numbers, name
        assert all(rf"\text{{({number})}}" in theory for number in numbers), name


def test_options_of_a_regridder_replace_its_tuning():
    assert BarrierRegridder().tuning == DEFAULT
    assert BarrierRegridder(epsilon=0.1, tuning=Tuning(floor=0.2)).tuning == Tuning(
        epsilon=0.1, floor=0.2
    )
    with pytest.raises(BadInput, match=r"strengthening .* must be 1 or more"):
        BarrierRegridder(tuning=Tuning(strengthening=0.5))
