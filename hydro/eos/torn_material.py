"""Condensed material that has been torn: what all equations of state with a strength share."""

from __future__ import annotations

from regrid.jit import inlined


@inlined
def compute_whole_ratio(ratio, p, strength):
    """rho0/rho that the sound speed sees: of the whole pieces where material is torn.

    From half the tensile strength on it goes from that of a body expanded as a whole to 1, that of
    pieces with gaps between them: a cell that holds a hundredth of its full mass would else carry
    waves a hundred times as fast as the solid and stop the time step.  In compression, and at no
    tension, it is the ratio itself (a strength of 0 too).
    """
    inverse = 1.0 / (strength + 1e-300)
    left = 2.0 + (p - abs(p)) * inverse  # 2 at p = 0, 1 at half the strength, 0 at it
    left = 0.5 * (left + abs(left))
    whole = 0.5 * (1.0 + left - abs(1.0 - left))
    excess = 0.5 * ((ratio - 1.0) + abs(ratio - 1.0))
    return ratio - excess * (1.0 - whole)
