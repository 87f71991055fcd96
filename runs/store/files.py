"""Writing a file so that a reader sees the old one or the new one, and knows whether it is whole.

Errors of the disk come out as BadInput with the file's name: a full disk, a folder that cannot be
written, are for the user to repair.

A dump has one checksum, the CRC-32 of all its bytes but the eight digits that tell it: in the
attribute `checksum` of the file's root, as text of fixed length, so that the HDF5 library reads it
like any other attribute and this module finds it without that library.  A file is judged before
anything in it is trusted.  Note: what changes a file on purpose (h5repack, an attribute added by
hand) changes the sum.
"""

from __future__ import annotations

import contextlib
import csv
import errno
import io
import os
import time
import zlib
from collections.abc import Iterable
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from shockgrid.regrid.errors import BadInput

fcntl: Any = None  # on Windows
msvcrt: Any = None  # everywhere else
with contextlib.suppress(ImportError):
    import fcntl
with contextlib.suppress(ImportError):
    import msvcrt

# s
OPEN_TRIES = 20
PAUSE_SECONDS = 0.05
SYSTEM = ("dev", "proc", "sys")  # folders at the root that hold no files of people
DUMPS = "dumps"  # folder of a run
LOCK = ".lock"
KEPT_NAMES = (  # files of a run but those in `dumps`; deck.toml, by which it is known, last
    "history.csv", "gauges.csv", "history.sums", "gauges.sums", "run.xmf", "summary.txt", "run.log",
    "problem.py", "verdict.json", "early-end.png", "early-end.txt", "problem.json", "deck.toml",
)  # fmt: skip
OWN_NAMES = (*KEPT_NAMES, LOCK)


def write_atomically(
    path: Path,
    content: bytes | str | Iterable[bytes | bytearray | memoryview],
    durable: bool = True,
) -> None:
    """Put `content`, or its parts, at `path`: temporary name, fsync, rename, fsync of the folder.

    What can be made again from other files need not be `durable`: it is spared the fsync.
    """
    check_replaceable(path)
    if isinstance(content, str):
        content = content.encode("utf-8")
    parts = [content] if isinstance(content, bytes) else content
    temporary = get_part(path)
    with disk_errors(path):
        try:
            with open(temporary, "wb") as file:
                file.writelines(parts)
                file.flush()
                if durable:
                    os.fsync(file.fileno())
            replace_file(temporary, path)
        except OSError:
            temporary.unlink(missing_ok=True)
            raise
        if durable:
            sync_folder(path.parent)


def make_csv(rows: Iterable[Iterable[Any]]) -> str:
    """Rows as the text of a CSV file; numbers with all their digits."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def get_part(path: Path) -> Path:
    """The temporary name under which a file is written."""
    return path.with_name(f".{path.name}.part")


def replace_file(source: Path, path: Path) -> None:
    """`os.replace`, tried for a second where Windows keeps a file that a reader has open.

    Raises OSError.
    """
    for _ in range(OPEN_TRIES):
        try:
            os.replace(source, path)
            return
        except PermissionError as error:
            if getattr(error, "winerror", None) is None:  # elsewhere waiting does not help
                raise
            time.sleep(PAUSE_SECONDS)
    os.replace(source, path)


def check_replaceable(path: Path) -> None:
    """Raise BadInput for what a file must not be put in place of: a folder, a device, a pipe.

    Note: a rename does not write into a device, it replaces it, /dev/null for all programs.
    """
    if not path.name or path.is_dir():
        raise BadInput(f"{path} is a folder, a file is needed")
    within = path.is_absolute() and path.parts[1] in SYSTEM and path.parts[1:3] != ("dev", "shm")
    if within or (path.exists() and not path.is_file()):
        raise BadInput(f"{path} is not a file but a device, a pipe or a socket; name a file")


def check_free(path: Path, force: bool = True) -> None:
    """Raise BadInput where a file that is asked for cannot or must not be written.

    A run keeps its own under some names, and what exists is replaced with `force` alone.
    """
    check_replaceable(path)
    home = path.parent.parent if path.parent.name == DUMPS else path.parent
    own = home != path.parent or path.name in OWN_NAMES
    if own and (home / "deck.toml").exists():
        raise BadInput(f"{path} is a file of the run in {home}; give another name")
    if path.exists() and not force:
        raise BadInput(f"{path} exists; --force replaces it, -o chooses another name")
    check_folder(path)


def check_folder(path: Path) -> None:
    """Raise BadInput where the folder of a file to be written does not exist."""
    if not path.parent.is_dir():
        raise BadInput(f"{path.parent} is not a folder, so {path.name} cannot be written")


def sync_folder(folder: Path) -> None:
    """Make the names in `folder` survive a power cut, where the system can do that."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:  # Windows opens no folders
        return
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


@contextmanager
def disk_errors(path: Path):
    """Turn an OSError met in the block into one sentence about `path`."""
    try:
        yield
    except OSError as error:
        raise BadInput(describe_disk_error(error, path)) from error


def describe_disk_error(error: OSError, path: Path) -> str:
    """One sentence: what could not be done with `path`, and what would help."""
    match error.errno:
        case errno.ENOSPC | errno.EDQUOT:
            return f"no space left for {path}; free some or choose another folder with -o"
        case errno.EACCES | errno.EPERM | errno.EROFS:
            return f"no permission for {path}; choose another folder with -o"
        case errno.ENOENT if not path.parent.is_dir():
            return f"{path}: the folder {path.parent} does not exist"
        case errno.ENOENT:
            return f"{path} does not exist"
        case errno.ENOTDIR | errno.EEXIST:
            return f"{path}: a part of this path is a file where a folder is needed"
        case errno.EISDIR:
            return f"{path} is a folder, a file is needed"
    return f"{path}: {error.strerror or error}"


HELD_LOCK = (errno.EAGAIN, errno.EWOULDBLOCK, errno.EACCES)  # by another; the last one over NFS


class NoLocks(Exception):
    """A file system that has no locks; in the words of the system."""


def try_lock(file: IO) -> bool:
    """Lock an open file for this process alone, without waiting; False where another has it.

    The lock is given up when the file is closed.  Raises NoLocks where the file system has none.
    """
    if fcntl is not None:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno in HELD_LOCK:
                return False
            raise NoLocks(error.strerror) from error
    elif msvcrt is not None:
        file.seek(0)
        try:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        except PermissionError:
            return False
    return True


CHECKSUM = "checksum"  # name of the attribute
SUM_HEAD = b"crc32 of all other bytes: "
CHECKSUM_DIGITS = 8
BLANK_CHECKSUM = (
    SUM_HEAD + b"0" * CHECKSUM_DIGITS
)  # the text of the attribute before the sum is known
SEARCHED_BYTES = 1 << 20  # bytes from a file's start in which the attribute lies
CHUNK_BYTES = 1 << 22  # bytes that are read at a time

judged: dict[tuple, str | None] = {}  # sums of the files that this process has read


def seal(image: bytes) -> list[memoryview | bytes]:
    """The bytes of a file with its checksum in place of the blank one, in parts that follow one
    another.  Raises ValueError where it has no attribute for it."""
    view = memoryview(image)
    place = bytes(view[:SEARCHED_BYTES]).find(SUM_HEAD)
    if place < 0:
        raise ValueError("a file without the attribute for its checksum")
    start = place + len(SUM_HEAD)
    head = view[:start]
    tail = view[start + CHECKSUM_DIGITS :]
    return [head, b"%08x" % zlib.crc32(tail, zlib.crc32(head)), tail]


def write_sealed(path: Path, image: bytes) -> None:
    """Put the bytes of a dump with a blank checksum at `path`, as `write_atomically`."""
    write_atomically(path, seal(image))


HDF5_HEAD = b"\x89HDF\r\n\x1a\n\0"  # of a file as dumps are written
OPEN_FLAG = 20  # place of the byte that is 1 while a program has the file open for writing


def _mark_closed(first: bytes) -> bytes:
    """The first bytes of a file as they are when no program has it open for writing."""
    if first.startswith(HDF5_HEAD) and first[OPEN_FLAG : OPEN_FLAG + 1] == b"\1":
        return first[:OPEN_FLAG] + b"\0" + first[OPEN_FLAG + 1 :]
    return first


def find_sum(path: Path) -> str | None:
    """The checksum of a file that has the bytes that were written; "" where it has others, None
    where it has no checksum.

    Each file is read once a process, as long as nobody writes it.  Raises BadInput where it cannot
    be read.
    """
    with disk_errors(path), open(path, "rb") as file:
        now = os.fstat(file.fileno())
        key = str(path.absolute()), now.st_ino, now.st_size, now.st_mtime_ns
        if key not in judged:
            first_bytes = _mark_closed(file.read(SEARCHED_BYTES))
            place = first_bytes.find(SUM_HEAD)
            start = place + len(SUM_HEAD)
            found = zlib.crc32(
                first_bytes[start + CHECKSUM_DIGITS :], zlib.crc32(first_bytes[:start])
            )
            while place >= 0 and (chunk := file.read(CHUNK_BYTES)):
                found = zlib.crc32(chunk, found)
            sound = first_bytes[start : start + CHECKSUM_DIGITS] == b"%08x" % found
            judged[key] = None if place < 0 else f"{found:08x}" if sound else ""
        return judged[key]
