"""Packages, bounds and versions that stand in several files agree, and workflows can be read."""

from __future__ import annotations

import itertools
import json
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


def find_uses(workflow) -> list[str]:
    steps = itertools.chain(*(job["steps"] for job in workflow["jobs"].values()))
    return [step["uses"] for step in steps if "uses" in step]


@pytest.fixture(scope="module")
def workflows():
    yaml = pytest.importorskip("yaml", reason="PyYAML comes with the site's packages")
    return {path.name: yaml.safe_load(path.read_text(encoding="utf-8")) for path in WORKFLOWS}


@pytest.mark.parametrize("requirement", DIRECT, ids=str)
def test_the_oldest_packages_are_the_bounds_of_pyproject(requirement):
    """To the last digit of the bound: its first release may have been withdrawn."""
    (oldest,) = read_pins("oldest.txt")[canonicalize_name(requirement.name)]
    bound = find_bound(requirement)
    assert oldest >= bound
    assert oldest.release[: len(bound.release)] == bound.release


@pytest.mark.parametrize("requirement", DIRECT, ids=str)
def test_the_pinned_packages_are_allowed_by_pyproject(requirement):
    pinned = read_pins("lock.txt")[canonicalize_name(requirement.name)]
    assert all(version in requirement.specifier for version in pinned)


def test_every_pinned_package_has_a_hash_and_no_file_names_a_place():
    text = (ROOT / "requirements" / "lock.txt").read_text(encoding="utf-8")
    for entry in re.split(r"\n(?=[a-z])", text):
        if "==" in entry.splitlines()[0]:
            assert "--hash=sha256:" in entry, entry.splitlines()[0]
    for path in (ROOT / "requirements").iterdir():
        assert not re.search(r"://|--(extra-)?index|--find-links", path.read_text(encoding="utf-8"))


def test_pythons_of_the_matrix_are_those_of_the_classifiers(workflows):
    matrix = workflows["tests.yml"]["jobs"]["tests"]["strategy"]["matrix"]
    assert matrix["python"] == find_pythons()
    assert find_pythons()[0] == PROJECT["requires-python"].removeprefix(">=")
    systems = {name.partition("-")[0] for name in matrix["os"]}
    assert systems == {"ubuntu", "macos", "windows"}
    wheel = workflows["tests.yml"]["jobs"]["wheel"]["strategy"]["matrix"]
    assert wheel["os"] == matrix["os"]
    assert wheel["python"] == [find_pythons()[0], find_pythons()[-1]]


def test_the_oldest_packages_are_tried_with_the_oldest_python(workflows):
    steps = workflows["tests.yml"]["jobs"]["oldest"]["steps"]
    versions = [step["with"]["python-version"] for step in steps if "python-version" in str(step)]
    assert versions == [find_pythons()[0]]
    assert "requirements/oldest.txt" in json.dumps(steps)


def test_workflows_may_read_alone_and_end_in_bounded_time(workflows):
    assert len(workflows) == len(WORKFLOWS) >= 2
    for name, workflow in workflows.items():
        assert workflow["permissions"] == {"contents": "read"}, name
        assert all("timeout-minutes" in job for job in workflow["jobs"].values()), name
        assert all(re.fullmatch(r"[\w/-]+@v\d+", use) for use in find_uses(workflow)), name


def test_make_targets_and_extras_that_workflows_call_are_there(workflows):
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for name, workflow in workflows.items():
        steps = itertools.chain(*(job["steps"] for job in workflow["jobs"].values()))
        for step in steps:
            for words in re.findall(r"\bmake ([a-z ]+)", step.get("run", "")):
                for target in words.split():
                    assert re.search(rf"^{target}:", makefile, re.MULTILINE), (name, target)
            for extras in re.findall(r"\.\[([a-z,]+)\]", step.get("run", "")):
                assert set(extras.split(",")) <= EXTRAS.keys(), (name, extras)
