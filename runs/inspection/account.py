"""What a run's history says in words: length, limits of dt, regridding, convexity, drifts, speed.

Where rows are lost, each sentence says of how many steps it speaks.

Used by the closing screen and by `shockgrid info`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from problems.evolution import Evolution


def count(number: int, thing: str) -> str:
    """`1 block`, `2 blocks`."""
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


def describe_run(
    history: Mapping[str, np.ndarray], cells: int, blocks: Sequence[str] = ()
) -> list[str]:
    """Lines about dt, regridding, speed and conservation: those that the history can tell.

    blocks: their names.
    """
    lines = []
    if limits := describe_limits(history):
        lines.append(f"dt limited{describe_known(history, 'dt')} by: {limits}")
    if fastest := describe_fastest(history, blocks):
        lines.append(f"fastest cell{describe_known(history, 'fastest_over_limit')}: {fastest}")
    if regrid := describe_regridding(history):
        lines.append(f"regridding{describe_known(history)}: {regrid}")
    if convexity := describe_convexity(history):
        lines.append(convexity)
    if contacts := describe_contacts(history):
        lines.append(contacts)
    if drifts := describe_drifts(history):
        totals = [name for name in history if name.startswith("total_")]
        known = describe_known(history, *totals[:1])
        lines.append(f"conservation, largest drift{known}: {drifts}")
    if speed := describe_speed(history, cells):
        lines.append(f"speed{describe_known(history)}: {speed}")
    return lines


def count_known(history: Mapping[str, np.ndarray], *names: str) -> tuple[int, int]:
    """How many steps have a row with what only a step tells, and how many the run has made.

    names: of columns, the first of which that the history has is looked at.  A history without any
    of them, nor a wall time or dt, is taken by its rows.
    """
    steps = history.get("step", np.zeros(0))
    if not len(steps):
        return 0, 0
    made = steps > 0
    for name in (*names, "seconds_step", "dt"):
        values = history.get(name)
        if values is not None and values.dtype.kind in "fi":
            return int((np.isfinite(values) & made).sum()), int(steps[-1])
    return int(made.sum()), int(steps[-1])


def count_lost(history: Mapping[str, np.ndarray]) -> int:
    """How many steps have no row, or one that was made again from a dump."""
    known, all_steps = count_known(history)
    return all_steps - known


def describe_known(history: Mapping[str, np.ndarray], *names: str) -> str:
    """` in 4 known steps of 88` where rows are lost, which have none of `names`; else ""."""
    if not count_lost(history):
        return ""
    known, all_steps = count_known(history, *names)
    return f" in {count(known, 'known step')} of {all_steps}" if known < all_steps else ""


def describe_seconds(seconds: float) -> str:
    """A wall time in the unit a person would choose."""
    if seconds < 100:
        return f"{seconds:.1f} s" if seconds >= 1 else f"{seconds:.2g} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes < 100 else f"{minutes // 60} h {minutes % 60} min"


def describe_limits(history: Mapping[str, np.ndarray]) -> str:
    """How often each limiter decided dt."""
    words = history.get("dt_limit")
    if words is None or words.dtype.kind != "U":
        return ""
    names, counts = np.unique(words[words != ""], return_counts=True)
    order = np.argsort(-counts)
    return ", ".join(f"{names[k]} {describe_share(counts[k] / counts.sum())}" for k in order)


def describe_fastest(history: Mapping[str, np.ndarray], blocks: Sequence[str]) -> str:
    """Where the cell of largest rate was mostly, and what not waiting for it has saved."""
    block, over = history.get("fastest_block"), history.get("fastest_over_limit")
    if block is None or over is None or not np.isfinite(over).any():
        return ""
    known = np.isfinite(over)
    cells = np.array([history[name][known] for name in ("fastest_block", "fastest_i", "fastest_j")])
    places, counts = np.unique(cells.astype(int), axis=1, return_counts=True)
    (number, i, j), often = places[:, counts.argmax()], counts.max() / known.sum()
    block = blocks[number] if number < len(blocks) else f"block {number}"
    told = f"{block}, i={i}, j={j} in {describe_share(often)} of the steps"
    # a step of the fastest cell's own would have been so many times shorter
    alone = round(float(np.sum(over[known])))
    shared = history.get("shared_cells", np.zeros(1))
    if alone > 1.02 * known.sum():
        most = count(int(np.nanmax(shared)), "cell")
        told += f"; {most} at most shared their states, else {alone} steps"
    return told


def describe_share(share: float) -> str:
    """A share in per cent; a small one is not called nothing."""
    return "<1%" if 0 < share < 0.01 else f"{share:.0%}"


def describe_regridding(history: Mapping[str, np.ndarray]) -> str:
    """Totals of the regridder's work and the worst cells of the run."""
    parts = []
    for name in ("iterations", "sub_moves", "rescues"):
        values = history.get(f"regrid_{name}")
        if values is not None and np.isfinite(values).any():
            parts.append(f"{int(np.nansum(values))} {name.replace('_', '-')}")
    for name, words, worst in (
        ("least_scaled_jacobian", "least scaled Jacobian", np.nanmin),
        ("worst_aspect", "worst aspect ratio", np.nanmax),
    ):
        values = history.get(name)
        if values is not None and np.isfinite(values).any():
            parts.append(f"{words} {worst(values):.3g}")
    return ", ".join(parts)


def describe_contacts(history: Mapping[str, np.ndarray]) -> str:
    """How many contacts of bodies were made and opened, and when the first of each."""
    told = []
    for name in ("made", "opened"):
        counts = history.get(f"contacts_{name}")
        if counts is None or not np.nan_to_num(counts).any():
            continue
        first = float(history["t"][np.flatnonzero(np.nan_to_num(counts) > 0)[0]])
        told.append(f"{int(np.nanmax(counts))} {name}, the first by t = {first:.4g} s")
    return f"contacts: {'; '.join(told)}" if told else ""


def describe_convexity(history: Mapping[str, np.ndarray]) -> str:
    """Whether every cell was convex in every step; if not, how many, in how many steps, since when.

    Cells at blocks' corners that the sides make triangles are counted apart.  Where rows are lost,
    of the known steps alone.

    Histories without `cells_not_convex` are judged by `least_scaled_jacobian`; "" without both.
    """
    count_bad, sine = history.get("cells_not_convex"), history.get("least_scaled_jacobian")
    if count_bad is not None:
        bad, name = np.nan_to_num(count_bad) > 0, "cells_not_convex"
    elif sine is not None:
        bad, name = sine <= 0.0, "least_scaled_jacobian"
    else:
        return ""
    flat = np.nan_to_num(history.get("cells_triangular", np.zeros(1)))
    known = describe_known(history, name)
    if not bad.any():
        if known and not count_known(history, name)[0]:
            return "convexity of cells: known of no step"
        told = f"every cell convex{known}" if known else "every cell convex in every step"
        if not flat.any():
            return told
        since, most = history["t"][int(np.argmax(flat > 0))], count(int(flat.max()), "triangle")
        return (
            f"{told}; at corners of blocks {most} at most, "
            f"in {count(int((flat > 0).sum()), 'step')}, first at t = {since:.6g} s"
        )
    most = "" if count_bad is None else f", at most {count(int(np.nanmax(count_bad)), 'cell')}"
    since = history["t"][int(np.argmax(bad))]
    steps = count(int(bad.sum()), "step")
    of = known.removeprefix(" in ") or bad.size
    return f"NOT CONVEX: in {steps} of {of}, first at t = {since:.6g} s{most}"


def measure_drifts(history: Mapping[str, np.ndarray]) -> dict[str, float]:
    """Largest relative change of each `total_*` over the run; see `compute_drifts`."""
    return {
        name: float(np.nanmax(np.abs(drift))) for name, drift in compute_drifts(history).items()
    }


def compute_drifts(history: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Change of each `total_*` since the start, less what came through the boundary.

    Relative to the largest size of the total; momentum, which may be zero, to the momentum of all
    mass at the speed that all energy would give it.
    """
    drifts = {}
    masses = [_find_largest(v) for n, v in history.items() if n.startswith("total_mass")]
    energy = _find_largest(history.get("total_energy", np.zeros(1)))
    usual_momentum = float(np.sqrt(2.0 * sum(masses) * energy))
    for name, values in history.items():
        if not name.startswith("total_") or values.dtype.kind not in "fi":
            continue
        known = np.isfinite(values)
        if known.sum() < 2:
            continue
        through = history.get("boundary_" + name.removeprefix("total_"))
        inside = values - np.nan_to_num(through) if through is not None else values
        size = np.nanmax(np.abs(values))
        if name.startswith("total_momentum"):
            size = max(size, usual_momentum)
        start = inside[np.flatnonzero(np.isfinite(inside))[0]]
        drifts[name.removeprefix("total_")] = (inside - start) / (size or 1.0)
    return drifts


def _find_largest(values: np.ndarray) -> float:
    """Largest size; 0 where nothing is known."""
    known = np.abs(values[np.isfinite(values)])
    return float(known.max()) if known.size else 0.0


def describe_drifts(history: Mapping[str, np.ndarray]) -> str:
    """Each conserved total with its relative drift."""
    drifts = measure_drifts(history)
    return ", ".join(f"{name.replace('_', ' ')} {drift:.1e}" for name, drift in drifts.items())


def describe_speed(history: Mapping[str, np.ndarray], cells: int) -> str:
    """Cell updates a second of wall time and the share of each phase."""
    step = history.get("seconds_step")
    if step is None or len(step) < 3 or not cells:
        return ""
    known = int(np.isfinite(step[2:]).sum())
    total = float(np.nansum(step[2:]))  # row 1 may have compiled its kernels
    if total <= 0:
        return ""
    text = f"{known * cells / total / 1e6:.3g} million cell updates a second"
    shares = []
    for name, values in history.items():
        if name.startswith("seconds_") and name != "seconds_step":
            share = float(np.nansum(values[2:])) / total
            shares.append(
                f"{name.removeprefix('seconds_').replace('_', ' ')} {describe_share(share)}"
            )
    return text + (f" ({', '.join(shares)})" if shares else "")


def count_cells(evolution: Evolution) -> int:
    """Cells of all blocks together."""
    return sum((b.nodes.shape[1] - 1) * (b.nodes.shape[2] - 1) for b in evolution.blocks)
