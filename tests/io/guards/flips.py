"""One bit of one file of a run turned over, and what the commands make of it."""

from __future__ import annotations

import random
import shutil
from pathlib import Path

from runs.cli.main import main

STEPS = ("--set", "run.max_steps=26")
RUN = ("run", "toy", "-q", "--set", "cells=4", "--set", "output.dumps=3", "--set", "run.t_end=0.2")


def make_runs(shockgrid) -> None:
    """A stopped run `base`, and the same run gone on with to its end, `whole`."""
    assert shockgrid(*RUN, "-o", "base", *STEPS)[0] == 0
    shutil.copytree("base", "whole")
    assert shockgrid("restart", "whole", "-q", "--set", "run.max_steps=1000")[0] == 0
    for name in ("base", "whole"):
        Path(name, "dumps/dump_000026.h5").rename(Path(name, "dumps/restart_000026.h5"))
    Path("whole/dumps/restart_000026.h5").unlink()


def list_files(directory: str) -> list[Path]:
    """All files of a run, in a fixed order."""
    return sorted(path for path in Path(directory).rglob("*") if path.is_file())


def flip(directory: str, seed: int) -> str:
    """Turn one bit over; says which."""
    draw = random.Random(seed)
    path = draw.choice(list_files(directory))
    content = bytearray(path.read_bytes())
    place = draw.randrange(8 * len(content))
    content[place // 8] ^= 1 << (place % 8)
    path.write_bytes(bytes(content))
    return f"seed {seed}: {path.relative_to(directory)}, byte {place // 8}, bit {place % 8}"


def look(capture) -> dict[str, tuple[int, str]]:
    """Exit codes and screens of what reads the run in `case`."""
    seen = {}
    for words in (("info", "case"), ("compare", "case", "base")):
        code = main(list(words))
        output = capture.readouterr()
        seen[words[0]] = code, output.out + output.err
    return seen


def look_at_whole(capture) -> dict[str, tuple[int, str]]:
    """What the commands say of the run as it was written."""
    shutil.rmtree("case", ignore_errors=True)
    shutil.copytree("base", "case")
    return look(capture)


def judge(seed: int, capture, plain: dict[str, tuple[int, str]]) -> tuple[str, str]:
    """What one flip led to: how the run went on, and the screens; fails where silence misled."""
    shutil.rmtree("case", ignore_errors=True)
    shutil.copytree("base", "case")
    where = flip("case", seed)
    for name, (code, text) in look(capture).items():
        assert code == 2 or (code, text) == plain[name], f"{where}: {name}, exit {code}\n{text}"
        assert code != 2 or "case" in text, f"{where}: {name} names no file\n{text}"
    code = main(["restart", "case", "-q", "--set", "run.max_steps=1000"])
    text = "".join(capture.readouterr())
    assert code in (0, 2), f"{where}: restart, exit {code}\n{text}"
    if code == 2:
        assert "case" in text, f"{where}: restart names no file\n{text}"
        return "refused", where
    superseded = "skipped" in text or "case/history.csv" in text
    code = main(
        ["compare", "case/dumps/" + list_last("whole"), "whole/dumps/" + list_last("whole")]
    )
    text = "".join(capture.readouterr())
    assert code == 0, f"{where}: other bits at the end\n{text}"
    return ("told, went on" if superseded else "went on"), where


def list_last(directory: str) -> str:
    """Name of the last dump."""
    return sorted(path.name for path in Path(directory, "dumps").glob("dump_*.h5"))[-1]
