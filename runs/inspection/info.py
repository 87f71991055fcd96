"""What `shockgrid info` prints about a run directory or a single dump."""

from __future__ import annotations

import contextlib
import os
import zlib
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

import h5py
import msgspec
import numpy as np

from shockgrid.problems.deck import DIGESTS
from shockgrid.problems.evolution import get_material
from shockgrid.problems.problem_file import read_head
from shockgrid.problems.registry import PROBLEMS, summary_line
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.hdf5_files import open_hdf5
from shockgrid.runs.deck.checking import find_changes
from shockgrid.runs.inspection.account import (
    describe_cautions,
    describe_run,
    describe_verdict,
    judge,
)
from shockgrid.runs.quantities import add_unit, count, describe_seconds, describe_time
from shockgrid.runs.store.directory import RunDirectory, read_stored_deck
from shockgrid.runs.store.files import find_sum
from shockgrid.runs.store.provenance import describe_provenance
from shockgrid.runs.store.reader import Dump, RunData

DAMAGED = "damaged: "  # head of a line about a file that is not as it was written


def describe(path: str) -> str:
    """All lines about a run directory, or about one HDF5 file."""
    return describe_directory(path) if Path(path).is_dir() else describe_file(Path(path))


def find_deck(path: str) -> str:
    """The text of the deck stored in a dump, or in the last dump of a run directory."""
    if not Path(path).is_dir():
        return Dump(path).deck_text
    found = read_stored_deck(RunDirectory(path))
    if found is None:
        raise BadInput(f"{path} has no dump that can be read")
    return found.text


def describe_file(path: Path) -> str:
    """The contents of one dump."""
    dump = Dump(path)
    t = describe_time(dump.t, dump.t_unit)
    lines = [f"{path}: {dump.problem}, step {dump.step}, {t} of {dump.t_end:.6g}"]
    made = describe_provenance(dump.provenance) if dump.provenance else []
    return "\n".join([*lines, *describe_blocks(dump), *made])


def describe_blocks(dump: Dump) -> list[str]:
    """Blocks with their cells and extent, then the range of every field in every block."""
    lines = []
    for block in dump.blocks:
        ni, nj = block.cells
        nodes = block.nodes
        low, high = nodes.min(axis=(1, 2)), nodes.max(axis=(1, 2))
        lines.append(
            f"block {block.name}{other_name(block)}: {ni} x {nj} cells, "
            f"{block.axes[0]} {low[0]:.4g} to {add_unit(high[0], dump.length_unit, 4)}, "
            f"{block.axes[1]} {low[1]:.4g} to {add_unit(high[1], dump.length_unit, 4)}"
        )
        width = max((len(name) for name in block.cell_fields), default=0)
        for name, values in block.cell_fields.items():
            unit = "" if block.units[name] == "1" else block.units[name]
            bad = np.count_nonzero(~np.isfinite(values))
            note = f", {bad} not finite" if bad else ""
            lines.append(
                f"  {name:{width}}  {np.nanmin(values):12.6g} to {np.nanmax(values):12.6g}"
                f" {unit:8} {block.long_names[name]}{note}"
            )
    return lines


def other_name(block) -> str:
    """The material in brackets, if it differs from the block's name."""
    material = get_material(block)
    return f" ({material})" if material != block.name else ""


def say_restart(run: RunData) -> str:
    """The command that continues a run; the usual one if its problem cannot be built."""
    try:
        return run.problem.say_restart(run.directory.quoted)
    except BadInput:
        return f"shockgrid restart {run.directory.quoted}"


def describe_problem(run: RunData) -> str:
    """The first line of the problem's docstring in brackets; "" if it has none."""
    if run.problem_name in PROBLEMS:
        return f" ({summary_line(run.problem_name)})"
    if run.directory.problem_copy.exists():
        source_lines = read_head(run.directory.problem_copy).splitlines()
        return f" ({source_lines[0]})" if source_lines else ""
    return ""


def describe_state(last: Dump, history: Mapping[str, np.ndarray]) -> str:
    """How far a run got, from its history or else from its last dump."""
    t = last.t
    step = last.step
    if len(history.get("t", ())):
        t = history["t"][-1]
        step = int(history["step"][-1])
    ending = last.finished or "not finished"
    t_end = last.t_end
    return (
        f"{ending}: step {step}, {describe_time(t, last.t_unit)} of {t_end:.6g} ({t / t_end:.0%})"
    )


def describe_directory(path: str) -> str:
    """The problem, how far the run got, its conservation errors, and its pictures."""
    run = RunData(path, lenient=True)
    lines = [f"{run.path}: {run.problem_name}{describe_problem(run)}"]
    quoted = run.directory.quoted
    try:
        history: Mapping[str, np.ndarray] = run.history
    except BadInput as error:
        run.skipped.append(str(error))
        history = {}
    last = run.dumps[-1] if run.dumps else None
    lines.append(describe_state(last, history) if last else "no dump that can be read")
    if last and not last.finished:
        point = run.restart_step
        there = f"last restart point: step {point} ({say_restart(run)})"
        lines.append("no restart point yet" if point is None else there)
    try:
        verdict = find_verdict(run)
        lines += [describe_verdict(verdict)] if verdict else []
    except BadInput as error:
        lines.append(f"no verdict: {error}")
    lines += ["", *describe_settings(run)]
    if history:
        names = [block.name for block in last.blocks] if last else []
        cells = last.cells if last else 0
        marched = describe_history(history, last.t_unit if last else "s")
        lines += ["", *marched, *describe_run(history, cells, names)]
    if last:
        first = run.dumps[0]
        number = len(run.outputs)
        newer = " and a newer restart point" if len(run.dumps) > number else ""
        lines += [
            "",
            f"{count(number, 'dump')}{newer}, "
            f"t = {first.t:.6g} to {describe_time(last.t, last.t_unit).removeprefix('t = ')}"
            "; in the last:",
        ]
        lines += describe_blocks(last)
        lines += ["", *describe_provenance(last.provenance)] if last.provenance else []
    try:
        cautions = describe_cautions(run.problem, history)
        lines += ["", *cautions] if cautions else []
        if figures := ", ".join(run.problem.figures()):
            lines += [
                "",
                f"pictures of this problem: {figures} (shockgrid plot {quoted} --what NAME)",
            ]
    except BadInput as error:
        lines.append(f"no results of the problem: its deck cannot be used any more: {error}")
    return "\n".join([*lines, *run.said, *_list_damage(run)])


def _list_damage(run: RunData) -> list[str]:
    """A line for each damaged file, restart points included."""
    known = [dump.path for dump in run.dumps]
    for _, path in run.directory.list_points():
        if path not in known:
            try:
                Dump(path)
            except BadInput as error:
                run.skipped.append(str(error))
    return [DAMAGED + sentence for sentence in dict.fromkeys(run.skipped)]


def find_verdict(run: RunData) -> dict[str, Any] | None:
    """The verdict; for an unfinished run the verdict on its history so far; None without a history.

    Raises BadInput if a file is damaged; a damaged verdict is listed in `run.skipped`.
    """
    try:
        verdict = run.verdict
    except BadInput as error:
        run.skipped.append(str(error))
        raise BadInput("its file is damaged") from error
    if verdict is None and len(run.history.get("step", ())) > 1 and run.dumps:
        reason = "it is still running, or was killed"
        cells = run.dumps[-1].cells
        return judge("unfinished", reason, run.history, cells, run.problem)
    return verdict


def describe_settings(run: RunData) -> list[str]:
    """The keys of the deck that differ from the problem's defaults."""
    try:
        usual, now = (msgspec.to_builtins(deck) for deck in (type(run.deck)(), run.deck))
    except BadInput:
        return []
    del now[DIGESTS]  # of files whose names are shown
    del usual[DIGESTS]
    changed = {one.key: one.now for one in find_changes(usual, now)}
    if "gauge" in changed:
        changed["gauge"] = ", ".join(gauge.name for gauge in run.deck.gauge)
    lines = [f"  {key} = {value}" for key, value in changed.items()]
    return ["deck, where not default:", *lines] if lines else ["deck: all defaults"]


def describe_history(history: Mapping[str, np.ndarray], t_unit: str = "s") -> list[str]:
    """Steps, range of dt, wall time."""
    if not len(history["step"]):
        return ["the history has no rows"]
    lines = [f"{int(history['step'][-1])} steps"]
    dt = history.get("dt", np.zeros(0))
    if np.isfinite(dt).any():
        lines[0] += f", dt {np.nanmin(dt):.3g} to {add_unit(np.nanmax(dt), t_unit, 3)}"
    if np.isfinite(history.get("seconds_step", np.zeros(0))).any():
        lines[0] += f", {describe_seconds(float(np.nansum(history['seconds_step'])))} in the steps"
    return lines


LONGEST_SHOWN_TEXT = 60  # characters of a text that are shown
SAID = ("units", "long_name")  # attributes that the line of a dataset shows
SCALES = ("CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST", "_Netcdf4Dimid")  # HDF5's own


def inspect(file: str | os.PathLike) -> str:
    """Describe the tree of an HDF5 file: shape, type, range, unit and bad values of each array.

    file: a file or a dump of an opened run.  A file with a wrong checksum is read in a separate
    process, because it may crash the HDF5 library.  Raises BadInput then, and for other files.
    """
    path = Path(file)
    if not path.is_file() or find_sum(path) != "":
        return describe_tree(path)
    try:
        with ProcessPoolExecutor(1) as apart:
            return apart.submit(describe_tree, path).result()
    except BrokenProcessPool:
        raise BadInput(
            f"{path} is damaged: its tree cannot be read (HDF5's library crashes)"
        ) from None


def describe_tree(path: Path) -> str:
    """As `inspect`, in this process."""
    with open_tree(path) as tree:
        head = f"{path}: {path.stat().st_size} bytes"
        if (found := find_sum(path)) is not None:
            head += f", checksum {'as stored' if found else 'NOT AS STORED'}"
        lines = [head]
        items = list_items(tree)
        for folder in (name for name, item in items.items() if isinstance(item, h5py.Group)):
            arrays = {n: i for n, i in items[folder].items() if isinstance(i, h5py.Dataset)}
            width = max(map(len, arrays), default=0)
            lines += [f"{folder}/"] * (folder != "/")
            lines += [f"  {line}" for line in describe_attributes(items[folder])]
            for name, data in arrays.items():
                lines.append(f"  {name:{width}}  {describe_array(data)}")
                lines += [f"    {line}" for line in describe_attributes(data, SAID)]
    return "\n".join(lines)


@contextlib.contextmanager
def open_tree(path: Path) -> Iterator[h5py.File]:
    """The file, open for reading; BadInput if it is missing, not HDF5 or damaged."""
    if not path.is_file():
        contents = (
            "is not an HDF5 file; `shockgrid info` describes runs"
            if path.is_dir()
            else "does not exist"
        )
        raise BadInput(f"{path} {contents}")
    try:
        file = open_hdf5(path)
    except OSError as error:
        raise BadInput(
            f"{path} is not a readable HDF5 file (truncated, damaged or a different format)"
        ) from error
    with file:
        try:
            yield file
        except (RuntimeError, OSError, KeyError, ValueError, TypeError) as error:  # of the library
            if find_sum(path):
                raise
            reason = str(error).partition("\n")[0]
            raise BadInput(f"{path} is damaged: its tree cannot be read ({reason})") from error


def list_items(file: h5py.File) -> dict[str, h5py.Group | h5py.Dataset]:
    """Everything in the file by its path, the root "/" first."""
    found: dict[str, h5py.Group | h5py.Dataset] = {"/": file}
    file.visititems(lambda name, item: found.__setitem__(f"/{name}", item))
    return found


def describe_attributes(item: h5py.Group | h5py.Dataset, said: Sequence[str] = ()) -> list[str]:
    """A line for each attribute that is not shown otherwise."""
    names = [name for name in item.attrs if name not in (*SCALES, *said)]
    return [f"@{name} = {_say_value(item.attrs[name])}" for name in names]


def describe_array(data: h5py.Dataset) -> str:
    """Shape, type, range, unit, name, values that are not finite, checksum of an array."""
    try:
        values = data[()]
    except (OSError, RuntimeError) as error:
        return f"CANNOT BE READ ({str(error).splitlines()[0]})"
    unit, name = (str(data.attrs.get(key, "")) for key in ("units", "long_name"))
    unit = "" if unit == "1" else unit
    if not isinstance(values, np.ndarray):
        return " ".join(word for word in (_say_value(values), unit, name) if word)
    extent = "" if values.size else "empty"
    remarks = []
    if values.dtype.kind in "fiub":
        finite = values[np.isfinite(values)]
        nans = int(np.isnan(values).sum())
        if values.size:
            extent = (
                f"{finite.min():.7g} to {finite.max():.7g}" if finite.size else "nothing finite"
            )
        infinite = values.size - finite.size - nans
        remarks = [f"{nans} NaN"] * bool(nans) + [f"{infinite} infinite"] * bool(infinite)
        remarks.append(f"crc32 {zlib.crc32(np.ascontiguousarray(values).data):08x}")
    head = " ".join(word for word in (f"{values.shape} {values.dtype}", extent, unit) if word)
    return ", ".join(word for word in (head, name, *remarks) if word)


def _say_value(value: Any) -> str:
    if value is None:
        return "missing"
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    if isinstance(value, str):
        lines = value.splitlines()
        if len(lines) > 1 or len(value) > 4 * LONGEST_SHOWN_TEXT:
            return f"text, {count(len(lines), 'line')}: {lines[0][:LONGEST_SHOWN_TEXT]} ..."
        return repr(value)
    if isinstance(value, np.generic):
        value = value.item()
    return repr(value)
