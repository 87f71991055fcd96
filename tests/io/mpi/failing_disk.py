"""The command line, on a rank whose disk fails or that dies when it writes a file of a name.

In the environment: FAILING_RANK, FAILING_FILE (a part of its name), FAILING_BY ("disk" or "death").
"""

from __future__ import annotations

import os
import signal
import sys

from runs.cli.main import main
from runs.ranks.started import find_rank

sync = os.fsync


def fail(descriptor: int) -> None:
    """An fsync that does not come back from the file of that name."""
    there = os.readlink(f"/proc/self/fd/{descriptor}")
    if os.environ["FAILING_FILE"] in there and find_rank() == int(os.environ["FAILING_RANK"]):
        if os.environ["FAILING_BY"] == "death":
            os.kill(os.getpid(), signal.SIGKILL)
        raise OSError(28, "No space left on device")
    sync(descriptor)


if __name__ == "__main__":
    os.fsync = fail
    sys.exit(main())
