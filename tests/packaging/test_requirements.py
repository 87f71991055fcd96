"""Packages, bounds and versions that stand in several files agree, and workflows can be read."""

from __future__ import annotations

import re
import tomllib

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

from builders import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]
DIRECT = [Requirement(words) for words in (*PROJECT["dependencies"], *EXTRAS["report"])]
PIN = re.compile(r"^([a-zA-Z0-9_.-]+)==([^\s;\\]+)", re.MULTILINE)
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))


def read_pins(name: str) -> dict[str, list[Version]]:
    text = (ROOT / "requirements" / name).read_text(encoding="utf-8")
    pins: dict[str, list[Version]] = {}
    for found, version in PIN.findall(text):
        pins.setdefault(canonicalize_name(found), []).append(Version(version))
    return pins


def find_bound(requirement: Requirement) -> Version:
    """The lower bound of a requirement, of which there has to be one."""
    bounds = [part.version for part in requirement.specifier if part.operator == ">="]
    assert len(bounds) == 1, f"{requirement} has no lower bound"
    return Version(bounds[0])


def find_pythons() -> list[str]:
    words = "Programming Language :: Python :: "
    return [line.removeprefix(words) for line in PROJECT["classifiers"] if line.startswith(words)]


@pytest.fixture(scope="module")
def workflows():
    yaml = pytest.importorskip("yaml", reason="PyYAML comes with the site's packages")
    return {path.name: yaml.safe_load(path.read_text(encoding="utf-8")) for path in WORKFLOWS}


@pytest.mark.parametrize("requirement", DIRECT, ids=str)
def test_the_oldest_packages_are_the_bounds_of_pyproject(requirement):
    (oldest,) = read_pins("oldest.txt")[canonicalize_name(requirement.name)]
    bound = find_bound(requirement)
    assert oldest >= bound
    assert oldest.release[: len(bound.release)] == bound.release


@pytest.mark.parametrize("requirement", DIRECT, ids=str)
def test_the_pinned_packages_are_allowed_by_pyproject(requirement):
    pinned = read_pins("lock.txt")[canonicalize_name(requirement.name)]
    assert all(version in requirement.specifier for version in pinned)


def test_pythons_of_the_matrix_are_those_of_the_classifiers(workflows):
    matrix = workflows["weekly.yml"]["jobs"]["tests"]["strategy"]["matrix"]
    assert matrix["python"] == find_pythons()
    assert find_pythons()[0] == PROJECT["requires-python"].removeprefix(">=")
    systems = {name.partition("-")[0] for name in matrix["os"]}
    assert systems == {"ubuntu", "macos", "windows"}
    wheel = workflows["weekly.yml"]["jobs"]["wheel"]["strategy"]["matrix"]
    assert wheel["os"] == matrix["os"]
    assert wheel["python"] == [find_pythons()[0], find_pythons()[-1]]
