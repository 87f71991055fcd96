"""When dumps are due: evenly over the run, at intervals of time, at chosen times."""

from __future__ import annotations

import math

from problems.deck import Output
from problems.evolution import Evolution, get_node_fields
from regrid.errors import BadInput, find_nearest


def is_dump_due(output: Output, t_end: float, t_before: float, t: float) -> bool:
    """Does a dump's time lie in (t_before, t]?  Depends on these alone, as a restart must."""
    if any(t_before < time <= t for time in output.times):
        return True
    if output.every is not None:
        return math.floor(t / output.every) > math.floor(t_before / output.every)
    if not output.dumps or not math.isfinite(t_end):
        return False
    return math.floor(t * output.dumps / t_end) > math.floor(t_before * output.dumps / t_end)


def check_output(output: Output, evolution: Evolution) -> None:
    """Raise BadInput for a time of a dump past the end and for a field that no block has."""
    check_times(output, evolution.t_end)
    check_fields(output, evolution)


def check_times(output: Output, t_end: float) -> None:
    """Raise BadInput for a time of a dump past the end of the run."""
    late = [time for time in output.times if time > t_end]
    if late:
        raise BadInput(
            f"deck: output.times has {late[0]:g}, which is after the end of the run, t = {t_end:g}"
        )


def check_fields(output: Output, evolution: Evolution) -> None:
    """Raise BadInput for a field of light dumps that no block has."""
    there = list(
        dict.fromkeys(
            name
            for block in evolution.blocks
            for name in (*block.cell_fields, *get_node_fields(block))
        )
    )
    for name in output.fields:
        if name not in there:
            nearest = find_nearest(name, there, cutoff=0.6)
            hint = f"; did you mean {nearest!r}?" if nearest else ""
            raise BadInput(
                f"deck: output.fields has {name!r}; no block has such a field, there are: "
                f"{', '.join(there)}{hint}"
            )
