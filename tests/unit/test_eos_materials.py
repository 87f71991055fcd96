"""The material library and a user's own: every mistake in it is one clear sentence."""

import pytest

from hydro.materials import LIBRARY, MATERIALS, find_material, read_materials
from regrid.errors import BadInput

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
    read_materials.cache_clear()

    def make(text):
        (tmp_path / "mine.toml").write_text(text)
        return "mine.toml:Ti"

    return make


def test_every_material_says_where_its_numbers_come_from():
    assert set(read_materials(LIBRARY)) == set(MATERIALS)
    for name, material in MATERIALS.items():
        assert len(material.source) > 10, name
        assert material.eos.sound_speed(material.rho0, 1e5) > 0.0, name


def test_a_material_of_one_s_own(write):
    material = find_material(write(GOOD))
    assert (material.rho0, material.eos.c0, material.source) == (4528.0, 5220.0, "a report")


@pytest.mark.parametrize(
    "old, new, words",
    [
        ('"mie-gruneisen"', '"mie-grueneisen"', "did you mean 'mie-gruneisen'"),
        ('source = "a report"', "", "say where its numbers come from"),
        ("c0 = 5220.0", "c1 = 5220.0", "has no parameter 'c1'; did you mean 'c0'"),
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


def test_a_missing_file_is_named(write):
    with pytest.raises(BadInput, match=r"there is no file 'other\.toml'"):
        find_material("other.toml:Ti")
