"""Contacts inside cells of two materials, kept sharp: what passes a face beside one.

Where both materials are in a cell, the volume fraction along a grid line goes through it as a step
that is smoothed over about half of the cell [XiaoHonmaKono2005].  What passes a face in a step is
the mean of the part of it that has been swept.  Theory F19.5.
"""

from __future__ import annotations

import numpy as np

from shockgrid.regrid.jit import compiled_once

# of the step's profile: slope over the cell's length where the contact lies across the grid line
STEP_STEEPNESS = 2.3
LEAST_STEEPNESS = 0.01  # where it lies along the grid line
LEAST_CONTRAST = 1e-9  # between both neighbours, below which there is no step


@compiled_once(allocates=False)
def find_swept_mean(before, here, after, along, swept):
    """The mean volume fraction of the part of a cell that leaves it towards `after`.

    before, here, after: of three cells along a grid line, in the sense of the flow; along: the
    contact's normal, from 0, along the line, to 1, across it; swept: the part of the cell.
    """
    lowest = before if before < after else after
    highest = after if before < after else before
    contrast = highest - lowest
    if not (lowest < here < highest) or contrast < LEAST_CONTRAST:
        return here
    sign = 1.0 if after > before else -1.0
    steepness = STEP_STEEPNESS * along + LEAST_STEEPNESS
    # where in the cell the step lies: such that the cell has its mean
    filled = (here - lowest) / contrast
    filled = min(max(filled, 1e-6), 1.0 - 1e-6)
    growth = np.exp(sign * steepness * (2.0 * filled - 1.0))
    whole = np.exp(steepness)
    middle = np.log((whole - growth) / (growth - 1.0 / whole)) / (2.0 * steepness)
    # mean over the swept part, from 1 - swept to 1
    swept = max(swept, 1e-6)
    high = np.cosh(steepness * (1.0 - middle))
    low = np.cosh(steepness * (1.0 - swept - middle))
    mean = 0.5 * (1.0 + sign * np.log(high / low) / (steepness * swept))
    return lowest + contrast * mean


@compiled_once(allocates=False)
def bound_by_rest(wanted, here, after, extremes, leaving):
    """The value nearest to `wanted` that leaves the cell, and the next one, within bounds.

    extremes: least and greatest value of the cell and its neighbours; leaving: the part of the
    cell that leaves it through all faces.
    """
    least, most = extremes
    ratio = (1.0 - leaving) / leaving if leaving > 0.0 else 1e300
    low = max(min(here, after), here - ratio * (most - here))
    high = min(max(here, after), here + ratio * (here - least))
    return min(max(wanted, low), high)
