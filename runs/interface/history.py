"""The history of a run as arrays by name, handed on to xarray and pandas where they are wanted."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from types import ModuleType
from typing import Any

import numpy as np

from regrid.errors import BadInput, suggest


class NoColumn(BadInput, KeyError):
    """A column that the history does not have; the sentence names those that are like it."""

    def __str__(self) -> str:
        return str(self.args[0])


class History(dict[str, np.ndarray]):
    """Columns of the history by name, (steps + 1,) each; `history.t` is `history["t"]`.

    Row 0 is the start, where only some columns have a value (nan, "" in a column of words).
    `units` maps columns to their SI unit, as far as it is known.  An unknown name raises
    AttributeError or, in brackets, BadInput, which here is a KeyError too.
    """

    def __init__(
        self, columns: Mapping[str, np.ndarray], units: Mapping[str, str], name: str = "history"
    ):
        super().__init__(columns)
        self.units = {key: unit for key, unit in units.items() if key in columns}
        self.name = name

    def __missing__(self, name: str) -> np.ndarray:
        raise NoColumn(f"the history has no column {name!r}{suggest(name, self)}")

    def __getattr__(self, name: str) -> np.ndarray:
        try:
            return self[name]
        except KeyError as error:
            raise AttributeError(str(error)) from None

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self})

    def __repr__(self) -> str:
        rows = len(next(iter(self.values()), ()))
        return f"<history of {self.name}: {rows} rows, {len(self)} columns: {', '.join(self)}>"

    def to_xarray(self) -> Any:
        """An xarray.Dataset over `step`, with `t` beside it and units as attributes.

        Raises BadInput where xarray is not installed.
        """
        xarray = _load("xarray")
        data = {
            name: ("step", values, {"units": self.units[name]} if name in self.units else {})
            for name, values in self.items()
        }
        return xarray.Dataset(data).set_coords(["step", "t"])

    def to_pandas(self) -> Any:
        """A pandas.DataFrame with a row a step, `step` being its index.

        Raises BadInput where pandas is not installed.
        """
        return _load("pandas").DataFrame(dict(self)).set_index("step")


def _load(package: str) -> ModuleType:
    try:
        return importlib.import_module(package)
    except ImportError as error:
        words = f"{package} is not installed here: python -m pip install {package}"
        raise BadInput(f"to_{package} needs {package}, and {words}") from error
