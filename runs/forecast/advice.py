"""What may help a run whose time step has become short, by what its step is limited by.

One table: what a run says of itself.  The settings are those that have helped in such runs.
"""

from __future__ import annotations

SMALL_CELLS = "run.small_cells=0.1 lets more squeezed cells share their states"
THICKER = "regrid.epsilon=1e-2 keeps cells thicker"
FEWER = "fewer cells"
END = "run.t_end ends the run before"

SETTINGS: dict[str, tuple[str, ...]] = {
    "hot": (FEWER, END),
    "crushed": (FEWER, END),
    "stretching": ("run.cfl=0.3", FEWER, END),
    "corner": (SMALL_CELLS, "other cells change the angles at the corner", END),
    "sliding": (SMALL_CELLS, FEWER, END),
    "roll": (SMALL_CELLS, THICKER, FEWER, END),
    "neck": (SMALL_CELLS, THICKER, FEWER, END),
    "film-wall": (SMALL_CELLS, THICKER, FEWER, END),
    "film-axis": (SMALL_CELLS, THICKER, FEWER, END),
    "bend": (SMALL_CELLS, THICKER, FEWER, END),
    "line": (SMALL_CELLS, FEWER, END),
    "thin": (SMALL_CELLS, THICKER, FEWER, END),
    "axis": (SMALL_CELLS, FEWER, END),
    "wall": (SMALL_CELLS, FEWER, END),
    "inside": (SMALL_CELLS, THICKER, FEWER, END),
}


def describe_settings(meaning: str) -> str:
    """The settings for one of the meanings of `runs.forecast.meaning`, in a line."""
    return "; ".join(SETTINGS.get(meaning, (FEWER, END)))
