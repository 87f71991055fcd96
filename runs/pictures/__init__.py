"""Pictures of a run: fields, history, interfaces.

May import: `runs.deck`, `runs.store`, `runs.inspection` and all below them.

Importing this package loads matplotlib and ignores the variable MPLBACKEND: a notebook's kernel
sets it to a backend that the Python of a command may lack, and matplotlib then refuses to load.
Nothing here needs a backend.  Raises BadInput where matplotlib cannot be loaded.
"""

from __future__ import annotations

import contextlib
import os
import sys

from shockgrid.regrid.errors import BadInput

BACKEND = "MPLBACKEND"


def _load_matplotlib() -> None:
    if "matplotlib" in sys.modules:
        return
    wanted = os.environ.pop(BACKEND, None)
    try:
        import matplotlib
    except Exception as error:  # a broken installation may raise anything
        reason = str(error).partition("\n")[0] or type(error).__name__
        raise BadInput(
            f"pictures need matplotlib, which cannot be loaded here: {reason}"
        ) from error
    finally:
        if wanted is not None:
            os.environ[BACKEND] = wanted
    if wanted:
        with contextlib.suppress(ValueError):  # a backend that is not there
            matplotlib.rcParams["backend"] = wanted


_load_matplotlib()
