"""The material library and a user's own: every mistake in it is one clear sentence."""

import re

import pytest

from hydro.eos.materials import LIBRARY, find_material, forget_read_files, read_materials
from regrid.errors import BadInput

# initials and a name, and after them a year in brackets or the like
SOURCE = re.compile(r"[A-Z]\. (?:[A-Z]\. )*[A-Z][a-z]+\b.*\b(?:19|20)\d\d\b", re.DOTALL)
VAGUE = re.compile(r"second-hand|memory|usual choice|public tables")

GOOD = """
[Ti]
eos = "mie-gruneisen"
source = "a report"
rho0 = 4528
c0 = 5220.0
s = 0.767
gruneisen = 1.09
strength = 3.0e9
"""


@pytest.fixture
def write(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    forget_read_files()

    def make(text):
        (tmp_path / "mine.toml").write_text(text)
        return "mine.toml:Ti"

    return make


def test_every_material_says_where_its_numbers_come_from():
    for name, material in read_materials(LIBRARY).items():
        assert SOURCE.search(material.source), f"{name}: no author with a year in its source"
        assert not VAGUE.search(material.source), name
        assert material.eos.sound_speed(material.rho0, 1e5) > 0.0, name


def test_a_material_of_one_s_own(write):
    material = find_material(write(GOOD))
    assert (material.rho0, material.eos.c0, material.source) == (4528.0, 5220.0, "a report")


@pytest.mark.parametrize(
    "old, new, words",
    [
        ('"mie-gruneisen"', '"mie-grueneisen"', "did you mean 'mie-gruneisen'"),
        ('source = "a report"', "", "say where its numbers come from"),
        ("c0 = 5220.0", "c1 = 5220.0", "has no parameter 'c1' .it has: rho0, c0"),
        ("c0 = 5220.0", "", "c0 is missing"),
        ("c0 = 5220.0", 'c0 = "5 km/s"', "it must be a number in SI units"),
        ("c0 = 5220.0", "c0 = -1", "c0 is -1"),
        ("c0 = 5220.0", "c0 = ", "cannot be read"),
        ("[Ti]", "[V]", "there is no material 'mine.toml:Ti'"),
    ],
)
def test_mistakes_are_named(write, old, new, words):
    name = write(GOOD.replace(old, new))
    with pytest.raises(BadInput, match=words):
        find_material(name)
