"""The table of a study: one row a point, as arrays, CSV, and HDF5 that xarray opens.

`study.h5` is laid out as NetCDF-4: where the points are a product each quantity is an array over
the varied keys, which are dimension scales; points given one by one lie along `point`.  A number
that there is not is NaN.  The trap: a key may hold words or tables; its scale then is text.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from regrid.errors import suggest
from runs.store.files import write_atomically
from runs.store.provenance import find_provenance
from runs.study.computing import Result
from runs.study.definition import Definition
from runs.study.points import write_value

FORMAT, FORMAT_VERSION = "shockgrid study", 1
FIXED = (
    "run",
    "state",
    "cautions",
    "step",
    "t",
    "seconds",
)  # columns of every study, after what is varied
LONG_NAMES = {
    "run": "folder in runs",
    "state": "how the run ended",
    "cautions": "where not to trust the run",
    "step": "steps made",
    "t": "time at the end",
    "seconds": "wall time of the steps",
}
NOT_RUN = "not run"


class Table(dict[str, np.ndarray]):
    """Columns by name; the KeyError of a name that is none says which is nearest."""

    def __missing__(self, name: str) -> np.ndarray:
        raise KeyError(f"the table has no column {name!r}{suggest(str(name), self)}")


def find_names(results: Sequence[Result | None]) -> tuple[list[str], list[str], list[str]]:
    """Names of the problem's results, of its errors and of its measurements, in their order."""
    known = [result for result in results if result is not None]

    def gather(part: str) -> list[str]:
        return list(dict.fromkeys(name for result in known for name in getattr(result, part)))

    return gather("computed"), gather("errors"), gather("values")


def make_table(definition: Definition, results: Sequence[Result | None]) -> Table:
    """Columns (n,) of the n points: the varied keys, FIXED, then numbers.

    Of a result `x` there are `x` and `x_theory`; errors and measurements have their own names.
    """
    table = Table()
    for key in definition.keys:
        table[key] = make_column([dict(point.values)[key] for point in definition.points])
    table["run"] = np.array([point.name for point in definition.points], dtype=str)
    table["state"] = np.array([describe_state(result) for result in results], dtype=str)
    cautions = [" | ".join(result.cautions) if result else "" for result in results]
    table["cautions"] = np.array(cautions, dtype=str)
    for name, kind in (("step", np.int64), ("t", float), ("seconds", float)):
        table[name] = np.array([getattr(r, name) if r else 0 for r in results], dtype=kind)
    computed, errors, values = find_names(results)
    parts = [("computed", name, name) for name in computed]
    parts += [("theory", name, f"{name}_theory") for name in computed]
    parts += [("errors", name, name) for name in errors]
    parts += [("values", name, name) for name in values]
    for part, name, column in sorted(parts, key=lambda one: _order(one, computed)):
        if column not in table:
            table[column] = np.array([_get(result, part, name) for result in results])
    return table


def _order(one: tuple[str, str, str], computed: list[str]) -> tuple[int, int]:
    """A result, its theory and its error stand side by side."""
    part, name, _ = one
    stem = name.removesuffix("_error")
    if stem in computed and part != "values":
        return computed.index(stem), ("computed", "theory", "errors").index(part)
    return len(computed), ("errors", "values").index(part) if part in ("errors", "values") else 2


def _get(result: Result | None, part: str, name: str) -> float:
    value = getattr(result, part).get(name) if result is not None else None
    return np.nan if value is None else float(value)


def describe_state(result: Result | None) -> str:
    """How a run ended, in its own words; a failure in its sentence."""
    if result is None:
        return NOT_RUN
    return f"failed: {result.failure}" if result.failure else result.reason


def make_column(values: Sequence[Any]) -> np.ndarray:
    """Values of a key: whole numbers, floats, or text (tables and lists as TOML)."""
    kinds = {type(value) for value in values}
    if kinds == {int}:
        return np.array(values, dtype=np.int64)
    if kinds <= {int, float}:
        return np.array(values, dtype=float)
    return np.array([v if isinstance(v, str) else write_value(v) for v in values], dtype=str)


def write_csv(path: Path, table: dict[str, np.ndarray]) -> None:
    """One line a point; a number that there is not is an empty field."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table)
    for row in zip(*table.values(), strict=True):
        writer.writerow([_write_cell(value) for value in row])
    write_atomically(path, text.getvalue())


def _write_cell(value: Any) -> str:
    if isinstance(value, np.floating):
        return "" if np.isnan(value) else repr(float(value))
    return str(value)


def write_hdf5(
    path: Path, definition: Definition, table: dict[str, np.ndarray], units: dict[str, str]
) -> None:
    """Write the table; `units` of quantities, "1" where they are not known."""
    with h5py.File("study", "w", driver="core", backing_store=False) as file:
        file.attrs["format"] = FORMAT
        file.attrs["format_version"] = FORMAT_VERSION
        file.attrs["study"] = definition.to_toml()
        file.create_group("provenance").attrs.update(find_provenance(definition.to_toml()))
        scales = {key: make_column(list(values)) for key, values in definition.vary.items()}
        if not scales:
            scales = {"point": np.arange(len(definition.points))}
        for name, values in scales.items():
            _write(file, name, values, units).make_scale(name)
        shape = tuple(len(values) for values in scales.values())
        for name, values in table.items():
            if name in scales:
                continue
            data = _write(file, name, values.reshape(shape), units)
            for axis, scale in enumerate(scales):
                data.dims[axis].attach_scale(file[scale])
        file.flush()
        image = file.id.get_file_image()
    write_atomically(path, image)


def _write(file: h5py.File, name: str, values: np.ndarray, units: dict[str, str]) -> h5py.Dataset:
    if values.dtype.kind == "U":
        data = file.create_dataset(name, data=values.astype(object), dtype=h5py.string_dtype())
    else:
        data = file.create_dataset(name, data=values)
        data.attrs["units"] = "s" if name in ("t", "seconds") else units.get(name, "1")
    data.attrs["long_name"] = LONG_NAMES.get(name, name.replace("_", " "))
    return data
