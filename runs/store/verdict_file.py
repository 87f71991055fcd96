"""The verdict on a run, as it lies in its directory: verdict.json.

Its key `crc32` is the CRC-32 of all others, written without spaces in the order of their names.
"""

from __future__ import annotations

import json
import math
import zlib
from typing import Any

from regrid.errors import BadInput
from runs.store.directory import RunDirectory
from runs.store.files import write_atomically

SUM = "crc32"
KEYS = ("status", "name", "reason", "trust")


def write_verdict(directory: RunDirectory, verdict: dict[str, Any]) -> None:
    """Write a verdict; numbers that are not finite become null, which JSON has."""
    plain = _make_plain(verdict)
    text = json.dumps(plain | {SUM: _sum(plain)}, indent=1, ensure_ascii=False)
    write_atomically(directory.verdict, text + "\n")


def read_verdict(directory: RunDirectory) -> dict[str, Any] | None:
    """The verdict of a run; None where it has not ended, or was ended by force.

    Raises BadInput for a file that is no verdict, or not as it was written.
    """
    path = directory.verdict
    try:
        verdict = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except (OSError, ValueError, RecursionError) as error:
        raise BadInput(f"{path} is damaged: it cannot be read") from error
    if not isinstance(verdict, dict) or not all(key in verdict for key in KEYS):
        raise BadInput(f"{path} is damaged: a verdict has {', '.join(KEYS)}")
    if verdict.pop(SUM, None) != _sum(verdict):
        raise BadInput(f"{path} is not as it was written: edited or damaged")
    return verdict


def _sum(verdict: dict[str, Any]) -> str:
    text = json.dumps(verdict, sort_keys=True, separators=(",", ":"))
    return f"{zlib.crc32(text.encode('ascii')):08x}"


def remove_verdict(directory: RunDirectory) -> None:
    """Take the verdict away: the run goes on."""
    (directory.verdict).unlink(missing_ok=True)


def _make_plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _make_plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_make_plain(one) for one in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
