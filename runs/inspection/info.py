"""What `shockgrid info` says about a run directory or a single dump."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from problems.deck import Gauge
from problems.evolution import get_material
from problems.problem_file import read_head
from problems.registry import PROBLEMS, summary_line
from regrid.errors import BadInput
from runs.inspection.account import count, describe_known, describe_run, describe_seconds
from runs.inspection.cautions import HEAD, describe_cautions, describe_gaps
from runs.inspection.units import describe_time
from runs.inspection.verdict import describe_verdict, judge
from runs.store.directory import RunDirectory
from runs.store.guards import read_stored_deck
from runs.store.provenance import describe_provenance
from runs.store.reader import Dump, RunData

DAMAGED = "damaged: "  # head of a line about a file that is not as it was written


def describe(path: str) -> str:
    """All lines about a run directory, or about one HDF5 file."""
    return describe_directory(path) if Path(path).is_dir() else describe_file(Path(path))


def find_deck(path: str) -> str:
    """The text of the deck that a dump keeps, or the last dump of a run directory."""
    if not Path(path).is_dir():
        return Dump(path).deck_text
    found = read_stored_deck(RunDirectory(path))
    if found is None:
        raise BadInput(f"{path} has no dump that can be read")
    return found.text


def describe_file(path: Path) -> str:
    """What one dump holds."""
    dump = Dump(path)
    t = describe_time(dump.t, dump.t_unit)
    lines = [f"{path}: {dump.problem}, step {dump.step}, {t} of {dump.t_end:.6g}"]
    made = describe_provenance(dump.provenance) if dump.provenance else []
    return "\n".join([*lines, *describe_blocks(dump), *made])


def describe_blocks(dump: Dump) -> list[str]:
    """Blocks with their cells and extent, then the range of every field in every block."""
    lines = []
    for block in dump.blocks:
        ni, nj = block.nodes.shape[1] - 1, block.nodes.shape[2] - 1
        low, high = block.nodes.min(axis=(1, 2)), block.nodes.max(axis=(1, 2))
        lines.append(
            f"block {block.name}{other_name(block)}: {ni} x {nj} cells, "
            f"{block.axes[0]} {low[0]:.4g} to {high[0]:.4g} m, "
            f"{block.axes[1]} {low[1]:.4g} to {high[1]:.4g} m"
        )
        width = max((len(name) for name in block.cell_fields), default=0)
        for name, values in block.cell_fields.items():
            unit = (
                block.units[name].replace("1", "")
                if block.units[name] == "1"
                else block.units[name]
            )
            bad = np.count_nonzero(~np.isfinite(values))
            note = f", {bad} not finite" if bad else ""
            lines.append(
                f"  {name:{width}}  {np.nanmin(values):12.6g} to {np.nanmax(values):12.6g}"
                f" {unit:8} {block.long_names[name]}{note}"
            )
    return lines


def other_name(block) -> str:
    """The material in brackets, where it says more than the block's name."""
    material = get_material(block)
    return f" ({material})" if material != block.name else ""


def say_restart(run: RunData) -> str:
    """How a run goes on; the usual command where its problem cannot be made."""
    try:
        return run.problem.say_restart(run.directory.quoted)
    except BadInput:
        return f"shockgrid restart {run.directory.quoted}"


def describe_problem(run: RunData) -> str:
    """The first line of the problem's words in brackets; "" where it has none."""
    if run.problem_name in PROBLEMS:
        return f" ({summary_line(run.problem_name)})"
    if run.directory.problem_copy.exists():
        words = read_head(run.directory.problem_copy).splitlines()
        return f" ({words[0]})" if words else ""
    return ""


def describe_directory(path: str) -> str:
    """What was run, how far it came, how well it kept, and what there is to look at."""
    run = RunData(path, lenient=True)
    lines = [f"{run.path}: {run.problem_name}{describe_problem(run)}"]
    quoted = run.directory.quoted
    try:
        history, gaps = run.history, run.history_gaps
    except BadInput as error:
        run.skipped.append(str(error))
        history, gaps = {}, []
    if run.dumps:
        last = run.dumps[-1]
        state = last.finished or "not finished"
        t = float(history["t"][-1]) if len(history.get("t", ())) else last.t
        step = int(history["step"][-1]) if len(history.get("step", ())) else last.step
        lines.append(
            f"{state}: step {step}, {describe_time(t, last.t_unit)} of {last.t_end:.6g} "
            f"({t / last.t_end:.0%})"
        )
        if not last.finished:
            point = run.restart_step
            there = f"last restart point: step {point} ({say_restart(run)})"
            lines.append("no restart point yet" if point is None else there)
    else:
        lines.append("no dump that can be read")
    lines += _describe_verdict(run)
    lines += ["", *describe_settings(run)]
    if history:
        cells, names = 0, []
        if run.dumps:
            names = [block.name for block in run.dumps[-1].blocks]
            cells = sum(
                (b.nodes.shape[1] - 1) * (b.nodes.shape[2] - 1) for b in run.dumps[-1].blocks
            )
        lines += ["", *describe_history(history), *describe_run(history, cells, names)]
        lines += _find_threads(run)
    if run.dumps:
        first, last, number = run.dumps[0], run.dumps[-1], len(run.outputs)
        newer = " and a newer restart point" if len(run.dumps) > number else ""
        words = f"t = {first.t:.6g} to {describe_time(last.t, last.t_unit).removeprefix('t = ')}"
        lines += ["", f"{count(number, 'dump')}{newer}, {words}; in the last:"]
        lines += describe_blocks(run.dumps[-1])
        if run.dumps[-1].provenance:
            lines += ["", *describe_provenance(run.dumps[-1].provenance)]
    try:
        cautions = [HEAD + sentence for sentence in describe_gaps(gaps)]
        cautions += describe_cautions(run.problem, history)
        lines += ["", *cautions] if cautions else []
        figures = ", ".join(run.problem.figures())
    except BadInput as error:
        figures = ""
        lines.append(f"the deck does not suit this version of the problem: {error}")
    if figures:
        lines += [
            "",
            f"pictures of this problem: {figures} (shockgrid plot {quoted} --what NAME)",
        ]
    return "\n".join([*lines, *run.said, *_list_damage(run)])


def _list_damage(run: RunData) -> list[str]:
    """What is damaged, a line each; those restart points that nothing else reads are looked at."""
    known = [dump.path for dump in run.dumps]
    for _, path in run.directory.list_points():
        if path not in known:
            try:
                Dump(path)
            except BadInput as error:
                run.skipped.append(str(error))
    return [DAMAGED + sentence for sentence in dict.fromkeys(run.skipped)]


def _describe_verdict(run: RunData) -> list[str]:
    """The verdict; of a run that has not ended, what its history tells so far."""
    try:
        verdict = run.verdict
    except BadInput as error:
        run.skipped.append(str(error))
        return ["no verdict: its file is damaged"]
    try:
        if verdict is None and len(run.history.get("step", ())) > 1:
            cells = sum(math.prod(n - 1 for n in b.nodes.shape[1:]) for b in run.dumps[-1].blocks)
            reason = "it marches on, or was ended by force"
            verdict = judge("unfinished", reason, run.history, cells, run.problem)
        return [describe_verdict(verdict)] if verdict else []
    except (BadInput, IndexError) as error:
        return [f"no verdict: {error}"]


def _find_threads(run: RunData) -> list[str]:
    """What the closing screen said of threads, where there is one."""
    try:
        screen = run.directory.summary.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return []
    return [line for line in screen if line.startswith("threads: ")]


def describe_settings(run: RunData) -> list[str]:
    """Those keys of the deck that differ from the problem's defaults."""
    try:
        default = type(run.deck)()
    except BadInput:
        return []
    changed = dict(_differences(run.deck, default, ""))
    if not changed:
        return ["deck: all defaults"]
    return ["deck, where not default:"] + [f"  {key} = {value}" for key, value in changed.items()]


def _differences(deck, default, prefix: str):
    for name in deck.__struct_fields__:
        value, usual = getattr(deck, name), getattr(default, name)
        if value == usual:
            continue
        if hasattr(value, "__struct_fields__") and type(value) is type(usual):
            yield from _differences(value, usual, f"{prefix}{name}.")
        else:
            yield prefix + name, _say_gauges(value) if name == "gauge" else value


def _say_gauges(gauges: Sequence[Gauge]) -> str:
    """Names and places [m] of gauges."""
    words = []
    for gauge in gauges:
        x, y = gauge.at
        line = f"{gauge.name} at [{x:g}, {y:g}]"
        if gauge.to is not None:
            line += f" to [{gauge.to[0]:g}, {gauge.to[1]:g}], {gauge.count} points"
        words.append(line + ", moving" * gauge.moves)
    return "; ".join(words)


def describe_history(history: dict[str, np.ndarray]) -> list[str]:
    """Steps, range of dt, wall time."""
    if not len(history["step"]):
        return ["no row of the history is known"]
    lines = [f"{int(history['step'][-1])} steps"]
    dt = history.get("dt", np.zeros(0))
    if np.isfinite(dt).any():
        known = describe_known(history, "dt")
        lines[0] += f", dt {np.nanmin(dt):.3g} to {np.nanmax(dt):.3g} s{known}"
    if np.isfinite(history.get("seconds_step", np.zeros(0))).any():
        known = describe_known(history) or " in the steps"
        lines[0] += f", {describe_seconds(float(np.nansum(history['seconds_step'])))}{known}"
    return lines
