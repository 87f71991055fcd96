"""The material library and a user's own: every mistake in it is one clear sentence."""

import re

import pytest

from hydro.eos.materials import (
    LIBRARY,
    find_material,
    forget_read_files,
    read_materials,
)
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


def test_all_mistakes_are_told_at_once(write):
    text = GOOD.replace("c0 = 5220.0", "c1 = 5220.0").replace("s = 0.767", "s = 0")
    text = text.replace("rho0 = 4528", "rho0 = -1").replace("1.09", '"one"')
    with pytest.raises(BadInput) as mistakes:
        find_material(write(text.replace('source = "a report"\n', "")))
    lines = str(mistakes.value).splitlines()
    assert all(line.startswith("material 'Ti' in mine.toml: ") for line in lines)
    for words in ("`source` is missing", "no parameter 'c1'", "s is 0; it must be positive",
                  "rho0 is -1; it must be positive", "gruneisen is 'one'; it must be a number",
                  "c0 is missing"):  # fmt: skip
        assert sum(words in line for line in lines) == 1, words
    assert len(lines) == 6


def test_a_mistake_in_another_material_is_no_matter(write):
    """Only the one asked for is looked at; the wrong one is named when asked for itself."""
    write(GOOD + GOOD.replace("[Ti]", "[V]").replace("c0 = 5220.0", "c0 = -1"))
    assert find_material("mine.toml:Ti").rho0 == 4528.0
    with pytest.raises(BadInput, match=r"material 'V' in mine\.toml: .*c0 is -1"):
        find_material("mine.toml:V")


def test_a_missing_file_is_named(write):
    with pytest.raises(BadInput, match=r"there is no file 'other\.toml'"):
        find_material("other.toml:Ti")


def test_a_parameter_that_its_kind_calls_optional_may_be_left_out(write):
    text = """
[Ti]
eos = "jwl"
source = "a report"
rho0 = 1630.0
a = 371.2e9
b = 3.231e9
r1 = 4.15
r2 = 0.95
omega = 0.30
energy0 = 7.0e9
"""
    assert find_material(write(text)).eos.strength == 0.0
