"""What may help a run whose time step has become short, by what its step is limited by.

The settings are those of `runs.early_end.causes`: each has helped in such runs.
"""

from __future__ import annotations

from runs.early_end.causes import FEWER_CELLS, MORE_BARRIER, MORE_SHARING, SMALLER_CFL, Setting

END = "run.t_end ends the run before"

FLATTENED = (MORE_SHARING, MORE_BARRIER, FEWER_CELLS)  # cells that the inside of a grid made flat
BESIDE = (MORE_SHARING, FEWER_CELLS)  # those that a line itself made flat
SETTINGS: dict[str, tuple[Setting, ...]] = {
    "hot": (FEWER_CELLS,),
    "crushed": (FEWER_CELLS,),
    "stretching": (SMALLER_CFL, FEWER_CELLS),
    "tension": (FEWER_CELLS,),
    "touch": (FEWER_CELLS,),
    "corner": BESIDE,
    "sliding": BESIDE,
    "roll": FLATTENED,
    "neck": FLATTENED,
    "film-wall": FLATTENED,
    "film-axis": FLATTENED,
    "bend": FLATTENED,
    "line": BESIDE,
    "thin": FLATTENED,
    "axis": BESIDE,
    "wall": BESIDE,
    "inside": FLATTENED,
}


def describe_settings(meaning: str) -> str:
    """The settings for one of the meanings of `runs.forecast.meaning`, in a line."""
    settings = SETTINGS.get(meaning, (FEWER_CELLS,))
    words = [f"{setting.described.replace('`', '')}: {setting.words}" for setting in settings]
    return "; ".join([*words, END])
