"""Runs of one process that write their dumps as several would: one part after another."""

from __future__ import annotations

import runs.march.runner as runner
from runs.store.parts import Share, write_dump_in_parts


def cut_in_bands(evolution, parts: int) -> list[dict]:
    """Rows of every block for every part, as even as they go."""
    rows: list[dict] = [{} for _ in range(parts)]
    for block in evolution.blocks:
        cells = block.nodes.shape[1] - 1
        for k in range(parts):
            first, end = cells * k // parts, cells * (k + 1) // parts
            if end > first:
                rows[k][block.name] = first, end
    return rows


def deal_blocks(evolution, parts: int) -> list[dict]:
    """Whole blocks for the parts in turn."""
    rows: list[dict] = [{} for _ in range(parts)]
    for k, block in enumerate(evolution.blocks):
        rows[k % parts][block.name] = 0, block.nodes.shape[1] - 1
    return rows


class Gatherings:
    """`gather` for processes that come one after another, the first process last."""

    def __init__(self):
        self.told: list[dict] = []

    def of(self, rank: int):
        calls = iter(range(99))

        def gather(thing):
            number = next(calls)
            self.told += [{} for _ in range(number + 1 - len(self.told))]
            self.told[number][rank] = thing
            return [self.told[number][k] for k in sorted(self.told[number])]

        return gather


def write_in_parts(monkeypatch, parts: int, cut) -> None:
    """From now on runs write their dumps in parts, cut by `cut(evolution, parts)`."""

    def write(world, path, evolution, names, besides, output=None):
        rows, gatherings = cut(evolution, parts), Gatherings()
        for k in reversed(range(parts)):
            share = Share(k, parts, rows[k], gatherings.of(k))
            write_dump_in_parts(path, evolution, names, besides, output, share)

    monkeypatch.setattr(runner, "write_on_ranks", write)
    monkeypatch.setattr(runner.Runner, "_ranked", True)
