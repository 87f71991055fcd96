"""The restart point that a run is taken up from: the last one that can be read, or a wanted one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from problems.evolution import Evolution, take_cells
from regrid.errors import BadInput
from runs.store.directory import RunDirectory
from runs.store.dumps import has_state, read_state


def find_restart_point(
    directory: RunDirectory, at: int | None, say=lambda text: None
) -> tuple[dict[str, Any], int]:
    """State and step of the last restart point that can be read, or of step `at`."""
    points = [entry for entry in directory.list_points() if not is_light(entry[1])]
    if at is not None:
        steps = sorted({step for step, _ in points})
        points = [entry for entry in points if entry[0] == at]
        if not points:
            there = ", ".join(str(step) for step in steps) or "none"
            raise BadInput(f"{directory} has no restart point of step {at}; there are: {there}")
    for step, path in reversed(points):
        try:
            return read_state(path), step
        except BadInput as error:
            if at is not None:
                raise
            say(f"skipped: {error}")
    if not directory.list_points():
        raise BadInput(
            f"nothing was computed yet in {directory}, so there is nothing to go on from; start it "
            f"anew: shockgrid run {directory.quoted}/deck.toml -o {directory.quoted} --force"
        )
    raise BadInput(f"{directory} has no restart point that can be read; start the run anew")


def is_light(path: Path) -> bool:
    """Is the dump at `path` one without a state?"""
    try:
        return not has_state(path)
    except BadInput:  # torn: told of when it is read
        return False


def restore(
    evolution: Evolution, state: dict[str, Any], directory: RunDirectory, step: int
) -> None:
    """Give `state` to a freshly built evolution; BadInput where the two do not fit."""
    take_cells(evolution, state)
    expected = evolution.get_state()
    missing = sorted(set(expected) - set(state))
    if missing:
        raise BadInput(
            f"the restart point of step {step} in {directory} was written by another version: "
            f"it lacks {', '.join(missing[:4])}"
        )
    for name, value in expected.items():
        shape, stored = np.shape(value), np.shape(state[name])
        if shape != stored:
            raise BadInput(
                f"the restart point of step {step} in {directory} has {name} of shape {stored}, "
                f"with this deck it would be {shape}: the deck's changes change the grid; "
                "begin a new run instead"
            )
    evolution.set_state(state)
    if evolution.step != step:
        raise BadInput(f"the restart point of step {step} holds step {evolution.step}")
