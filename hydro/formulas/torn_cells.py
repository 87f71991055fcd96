"""What torn cells have at their faces: their own energy and sound speed, whatever the trace there.

The void energy of a torn cell makes up for what the equation of state says of a body expanded as a
whole to the cell's density, which goes with 1/density.  With the void energy of the cell and the
density of a trace, what passes through a face would have an energy that no material has, beyond
all bounds where a cell is nearly empty.  And a trace is not quite at the tension at which pieces
of material have gaps between them: its sound speed would be that of the body expanded as a
whole, hundreds of times that of the pieces, with which the time step was chosen.  Theory F4.10.
"""

from __future__ import annotations

from regrid.jit import inlined

WHOLE = 1e300  # stands for the energy of a cell that is not torn


@inlined
def mark_torn(e, void):
    """The energy of a cell where its void energy says that it is torn; WHOLE elsewhere."""
    return e if void < 0.0 else WHOLE


@inlined
def choose_own(traced, own, torn):
    """What a trace gives; the cell's own value where `torn`, of `mark_torn`, is not WHOLE."""
    return own if torn < WHOLE else traced
