"""What all tests share: hypothesis without chance in CI, the flag that renews stored baselines."""

from __future__ import annotations

import os

import pytest
from hypothesis import settings

settings.register_profile("ci", derandomize=True, deadline=None, print_blob=True)
settings.register_profile("dev", deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "dev"))


def pytest_addoption(parser):
    parser.addoption(
        "--update-baselines",
        action="store_true",
        help="write the baselines of tests/regression instead of comparing with them",
    )


@pytest.fixture
def update_baselines(request) -> bool:
    """Whether to write a baseline instead of comparing with it."""
    return request.config.getoption("--update-baselines")
