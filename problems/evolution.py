"""What `runs` can run: the Evolution protocol, with the names that its history columns follow.

Anything that marches in time and shows its blocks is an Evolution: the flow
(`hydro.simulation.Simulation`) and a grid marched without flow alike.

History columns are fixed from the first step of a run to its last.  Names with a meaning to
`shockgrid run`, `info`, `plot` and `compare` (all but the first three may be left out):

- `t`, `dt`: time at the end of the step and its length [s]
- `dt_limit`: what limited dt, a short word ("sound", "deform", "dump", ...)
- `total_*`: a conserved total (mass of a material, momentum, energy); `info` reports its drift
- `boundary_*`: what has come in through the boundary since t = 0, same suffix as the `total_*` it
  belongs to; subtracted before the drift is judged
- `least_scaled_jacobian`: worst corner of any block, absolute orientation (> 0: all convex)
- `cells_not_convex`: how many cells, of all blocks, are not convex
- `cells_triangular`: how many cells at blocks' corners are triangles, as good as convex
- `worst_aspect`: largest aspect ratio of a cell
- `regrid_*`: one number a step: `regrid_iterations`, `regrid_node_iterations`, `regrid_sub_moves`,
  `regrid_rescues`, `regrid_least_corner_ratio`
- `seconds_*`: wall time of a phase of the step; never compared

An Evolution or a block may have more, which the functions below read, or give the default of:

of an Evolution
- `start_row()`: columns known before the first step
- `missed`: what a run that ends now has not reached, in a few words; such a run has exit code 3
- `geometry.curved`: is y the distance from the axis x?
- `adopt_cells(state)`: have as many cells as a state of `get_state`, before `set_state` takes it up
- `lists_in_state`: names of the arrays of `get_state` with a row for each thing that comes and goes
  (a void, say), which may be more or fewer than when the deck was built

of a block
- `material`: its name
- `node_fields`: fields at its nodes by name, (ni+1, nj+1) each
- `long_names`: words for the axes of its fields, by the field's name

Note: `get_state` must hold *everything* that the next step depends on, or a restarted run
ends in other bits than an unbroken one.
"""

from collections.abc import Mapping, Sequence
from typing import Protocol, TypeAlias, runtime_checkable

import numpy as np

Scalar: TypeAlias = float | int | str | bool
State: TypeAlias = Mapping[str, np.ndarray | Scalar]


@runtime_checkable
class BlockView(Protocol):
    """One block as pictures and dumps see it; the arrays may be views of live data."""

    name: str
    nodes: np.ndarray  # (2, ni+1, nj+1) [m]
    cell_fields: Mapping[str, np.ndarray]  # name -> (ni, nj)
    units: Mapping[str, str]  # name -> SI unit, "1" for a pure number


@runtime_checkable
class Evolution(Protocol):
    """A state that advances in time by steps of its own choice."""

    t: float
    step: int
    t_end: float
    finished: str | None  # the reason ("t_end reached", "cavity closed") or None
    blocks: Sequence[BlockView]

    def advance(self) -> dict[str, Scalar]:
        """Make one step and return its history row; raise RunFailure with block, cell, time."""
        ...

    def get_state(self) -> State:
        """All that is needed to go on bit for bit: flat; keys may contain "/" ("gas/rho"), then
        "gas" itself is no key.  Whole numbers beyond 64 bits go in as text."""
        ...

    def set_state(self, state: State) -> None:
        """Take up a state of `get_state`, after `build()` of the same deck."""
        ...


def get_start_row(evolution: Evolution) -> dict[str, Scalar]:
    """Columns known before the first step: row 0 of the history, whose other fields stay empty."""
    return getattr(evolution, "start_row", dict)()


def get_missed(evolution: Evolution) -> str:
    """What the Evolution has not reached, in a few words; "" for nothing."""
    return getattr(evolution, "missed", "")


def is_axisymmetric(evolution: Evolution) -> bool:
    """Is y the distance from the axis x?"""
    return bool(getattr(getattr(evolution, "geometry", None), "curved", False))


def adopt_cells(evolution: Evolution, state: State) -> None:
    """Let the evolution have as many cells as the state, where it can have others."""
    getattr(evolution, "adopt_cells", lambda state: None)(state)


def get_lists_in_state(evolution: Evolution) -> Sequence[str]:
    """Names of the state's arrays that may have any number of rows."""
    return getattr(evolution, "lists_in_state", ())


def get_material(block: BlockView) -> str:
    """The block's material, its name where none is said."""
    return str(getattr(block, "material", "") or block.name)


def get_node_fields(block: BlockView) -> Mapping[str, np.ndarray]:
    """Fields at the nodes, (ni+1, nj+1) each; none where the block has no `node_fields`."""
    return getattr(block, "node_fields", {})


def get_long_names(block: BlockView) -> Mapping[str, str]:
    """Words for axes by field; none where the block has no `long_names`."""
    return getattr(block, "long_names", {})
