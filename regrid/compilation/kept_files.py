"""Files of the cache: each begins with a checksum, and its name says what determines its contents.

They hold machine code of kernels (`machine_code`) and numbers that take long to compute
(`remember`).
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import pickle
import sys
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import Any

import llvmlite
import numba
import numpy as np

from shockgrid.regrid.compilation.contents import PACKAGES
from shockgrid.regrid.compilation.first_calls import is_interpreting
from shockgrid.regrid.compilation.processor import find_machine

ROOT = Path(__file__).resolve().parents[2]  # the folder in which the packages lie
VERSIONS = numba.__version__, llvmlite.__version__, np.__version__, sys.version
KEPT_FILES = 6000  # of the cache: when there are more, half of them go


def find_cache() -> Path:
    """The folder of the cache."""
    home = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    return Path(os.environ.get("SHOCKGRID_CACHE_DIR") or os.path.join(home, "shockgrid"))


def find_kept(name: str, *causes: str) -> Path:
    """The file of the cache for what these words, the compiler and the processor determine."""
    key = hashlib.sha256(repr((causes, find_machine(), VERSIONS)).encode()).hexdigest()
    return find_cache() / "kernels" / f"{name}-{key[:24]}.kept"


def compute_checksum(contents: bytes) -> bytes:
    """What a file of the cache begins with: SHA-256 of all bytes after it."""
    return hashlib.sha256(contents).digest()


def read_kept(path: Path) -> bytes:
    """What `keep` has put into a file of the cache.

    Machine code of which one bit is wrong runs, and its numbers look sound: nothing of a file is
    used before all of it is known to be as it was written.  Raises OSError where there is no file
    that can be read, ValueError where it is damaged or cut off.
    """
    stored = path.read_bytes()
    size = hashlib.sha256().digest_size
    checksum = stored[:size]
    contents = stored[size:]
    if checksum != compute_checksum(contents):
        raise ValueError(f"{path} is damaged")
    return contents


def keep(path: Path, contents: bytes) -> None:
    """Write a file of the cache; where nothing can be written the run goes on without."""
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = path.with_name(uuid.uuid4().hex)
        temporary.write_bytes(compute_checksum(contents) + contents)
        temporary.replace(path)
        files = list(path.parent.iterdir())
        if len(files) > KEPT_FILES:
            for old in sorted(files, key=os.path.getmtime)[: -KEPT_FILES // 2]:
                old.unlink()


@functools.cache
def digest_sources() -> str:
    """Digest of all files of the packages: what is computed with them may differ with it."""
    folders = [ROOT / package.rpartition(".")[2] for package in PACKAGES]
    files = sorted(file for folder in folders for file in folder.rglob("*.py"))
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()


def remember(name: str, inputs: Any, compute: Callable[[], Any]) -> Any:
    """What `compute` gives; it stays in the cache until a file of the packages changes.

    inputs: all that it depends on beside them, as pickle writes it.
    """
    digest = hashlib.sha256(pickle.dumps(inputs)).hexdigest()
    path = find_kept(name, digest_sources(), digest)
    with contextlib.suppress(OSError, ValueError):
        return pickle.loads(read_kept(path))
    result = compute()
    if not is_interpreting():  # there the last bits may be others
        keep(path, pickle.dumps(result))
    return result
