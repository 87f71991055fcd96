"""The mpiexec of the environment, as it starts ranks anywhere."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest


def find_mpiexec(size: int = 3) -> list[str]:
    """The words before a command that is to run on `size` ranks; skips where there is no MPI."""
    pytest.importorskip("mpi4py", reason="mpi4py is not installed (extra [mpi])")
    beside = Path(sys.executable).with_name("mpiexec")
    command = str(beside) if beside.exists() else shutil.which("mpiexec")
    if command is None:
        pytest.skip("there is no mpiexec")
    words = [command, "-n", str(size)]
    told = subprocess.run([command, "--version"], capture_output=True, text=True).stdout
    if "Open MPI" in told or "OpenRTE" in told:
        words[1:1] = ["--oversubscribe", *(["--allow-run-as-root"] if os.geteuid() == 0 else [])]
    return words
