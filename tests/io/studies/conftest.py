"""What tests of studies share: where their workers find the project."""

import os
from pathlib import Path

import pytest

from builders import ROOT

HERE = Path(__file__).resolve().parent


@pytest.fixture
def environment(monkeypatch):
    """Workers find the project and the tasks of this folder."""
    paths = os.pathsep.join([str(ROOT), str(HERE)])
    monkeypatch.setenv("PYTHONPATH", paths)
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
