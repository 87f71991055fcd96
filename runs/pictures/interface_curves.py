"""Interfaces as curves, at every dump of a run: x, y and the length along them, as CSV and HDF5.

A curve has the nodes of the first block of its two materials.  Pieces that meet end to end are one
curve; of several between the same materials each has a number.

    interfaces.csv   step, t, interface, x, y, s: a row a node
    interfaces.h5    /step_000123 (attributes step, t) /interface_<a>_<b> / x, y, s
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from regrid.errors import BadInput
from runs.pictures.outlines import trace_outline
from runs.store.files import check_not_of_a_run, write_atomically
from runs.store.reader import Dump, RunData

CLOSE = 1e-9  # of the interfaces' extent: ends so near are one point
FORMAT = "shockgrid interfaces"


@dataclass(frozen=True)
class Curve:
    """One interface at one time: its name and its nodes (2, n) [m]."""

    name: str
    nodes: np.ndarray

    @property
    def length(self) -> np.ndarray:
        """Length s (n,) [m] along the curve, from its first node."""
        steps = np.hypot(*np.diff(self.nodes, axis=1))
        return np.concatenate([[0.0], np.cumsum(steps)])


def find_curves(blocks: Sequence) -> list[Curve]:
    """All interfaces of some blocks, by their materials' names in the blocks' order."""
    found: dict[tuple[str, str], list[np.ndarray]] = {}
    for pair, line in trace_outline(blocks)[0]:
        pair = pair if pair[::-1] not in found else pair[::-1]
        found.setdefault(pair, []).append(line)
    curves = []
    for pair, lines in found.items():
        name = "interface_" + "_".join(word.replace("/", "-") for word in pair)
        joined = _join(lines)
        for number, nodes in enumerate(joined, start=1):
            curves.append(Curve(f"{name}_{number}" if len(joined) > 1 else name, nodes))
    return curves


def _join(lines: list[np.ndarray]) -> list[np.ndarray]:
    """Lines that meet end to end as one, until none is left that meets another."""
    near = CLOSE * max(float(np.ptp(line, axis=1).max()) for line in lines)
    waiting, joined = list(lines), []
    while waiting:
        line = waiting.pop(0)
        while (number := _find_next(line, waiting, near)) is not None:
            line = _append(line, waiting.pop(number), near)
        joined.append(line)
    return joined


def _find_next(line: np.ndarray, others: list[np.ndarray], near: float) -> int | None:
    ends = line[:, [0, -1]]
    for number, other in enumerate(others):
        gaps = np.hypot(*(ends[:, :, None] - other[:, None, [0, -1]]))
        if gaps.min() <= near:
            return number
    return None


def _append(line: np.ndarray, other: np.ndarray, near: float) -> np.ndarray:
    """Both lines as one; it keeps the direction of the first."""
    for forward in (other, other[:, ::-1]):
        if np.hypot(*(line[:, -1] - forward[:, 0])) <= near:
            return np.hstack([line, forward[:, 1:]])
        if np.hypot(*(line[:, 0] - forward[:, -1])) <= near:
            return np.hstack([forward[:, :-1], line])
    raise AssertionError("lines that meet")


def export_interfaces(directory: str, output: str | None = None) -> list[Path]:
    """Write the interfaces at all dumps of a run; returns the files.

    `output`: a file ending in .csv or .h5, left out: interfaces.csv and interfaces.h5 in the run's
    directory.  Raises BadInput for another ending, and where there is no dump or no interface.
    """
    run = RunData(directory)
    paths = [Path(output)] if output else [run.path / f"interfaces.{end}" for end in ("csv", "h5")]
    for path in paths:
        if path.suffix not in WRITERS:
            raise BadInput(f"-o {path}: curves are written to a file ending in .csv or .h5")
        check_not_of_a_run(path)
    if not run.dumps:
        raise BadInput(f"{run.path} has no dump that can be read")
    moments = [(dump, find_curves(dump.blocks)) for dump in run.dumps]
    if not any(curves for _, curves in moments):
        raise BadInput(f"{run.path} has no interface: all its blocks are of one material")
    for path in paths:
        write_atomically(path, WRITERS[path.suffix](moments))
    return paths


Moments = Sequence[tuple[Dump, Sequence[Curve]]]


def _list_rows(moments: Moments) -> Iterator[list]:
    yield ["step", "t", "interface", "x", "y", "s"]
    for dump, curves in moments:
        for curve in curves:
            for x, y, s in zip(*curve.nodes.tolist(), curve.length.tolist(), strict=True):
                yield [dump.step, repr(dump.t), curve.name, repr(x), repr(y), repr(s)]


def _make_csv(moments: Moments) -> bytes:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(_list_rows(moments))
    return text.getvalue().encode("utf-8")


def _make_hdf5(moments: Moments) -> bytes:
    with h5py.File("interfaces", "w", driver="core", backing_store=False) as file:
        file.attrs["format"] = FORMAT
        file.attrs["format_version"] = 1
        for dump, curves in moments:
            moment = file.create_group(f"step_{dump.step:06d}")
            moment.attrs["step"], moment.attrs["t"] = dump.step, dump.t
            for curve in curves:
                group = moment.create_group(curve.name)
                words = (*dump.axes, "length along the curve")
                columns = zip("xys", (*curve.nodes, curve.length), words, strict=True)
                for name, values, long_name in columns:
                    data = group.create_dataset(name, data=values)
                    data.attrs["units"], data.attrs["long_name"] = "m", long_name
        file.flush()
        return file.id.get_file_image()


WRITERS = {".csv": _make_csv, ".h5": _make_hdf5}
