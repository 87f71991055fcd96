"""HDF5 files opened for reading, wherever they lie and whoever else has them open.

The HDF5 library locks a file that it reads.  A file system may have no locks, and a file may be
open for writing in another program: either would make a sound file look like a damaged one.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import h5py


def open_hdf5(path: str | Path) -> h5py.File:
    """The file, open for reading without a lock.  Raises OSError where it cannot be read."""
    import h5py  # slow to load

    try:
        return h5py.File(path, "r", locking=False)
    except OSError:  # no HDF5 file, or this process has it open with a lock, or for writing
        file = open(path, "rb")
        try:
            return h5py.File(file, "r")  # by Python, so that the library knows of no other
        except BaseException:
            file.close()
            raise
