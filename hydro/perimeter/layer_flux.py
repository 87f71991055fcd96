"""Material that flows along a contact as its line is smoothed (theory F6.5).

Where a line with a thickness (`hydro.motion.thickness`) moves out of a block beside its contact
speed, the cell there gains volume; elsewhere on the line others lose as much.  The material of that
volume goes from these to those along the line, so that the gas is neither compressed nor
stretched: the pressure would push the line back within the time that sound takes through a cell.
"""

from __future__ import annotations

import numpy as np

from hydro.perimeter.rows import AREA_X, AREA_Y, TRACE_E
from hydro.rows import ENERGY, MASS, MOMENTUM_X, MOMENTUM_Y, RHO, P, U, V
from regrid.jit import kernel


@kernel
def add_layer_flux(traces, faces, speeds, backwards, closed, first, flux):
    """Add to the outward fluxes through a contact's faces what flows on to the next cell.

    speeds (2, n + 1): of the line's nodes beside the contact speeds, in the other direction where
    `backwards`; faces: rows AREAS of the perimeter's faces at mid-time; `first`: number of the
    first of n; closed: does the last cell lie beside the first one?  States are those of the traces
    of the cell from which the volume comes.  What the n faces gain together is spread over them.
    """
    count = speeds.shape[1] - 1
    gain, size, along = np.empty(count), np.empty(count), np.empty(count + 1)
    for k in range(count):
        at = count - k if backwards else k
        other = at - 1 if backwards else at + 1
        area_x, area_y = faces[AREA_X, first + k], faces[AREA_Y, first + k]
        gain[k] = 0.5 * (
            (speeds[0, at] + speeds[0, other]) * area_x
            + (speeds[1, at] + speeds[1, other]) * area_y
        )
        size[k] = (area_x * area_x + area_y * area_y) ** 0.5
    left, whole = 0.0, 0.0
    for k in range(count):
        left += 0.5 * (gain[k] + gain[count - 1 - k])
        whole += 0.5 * (size[k] + size[count - 1 - k])
    # the sums from both ends: the same for the mirror image
    before, after = 0.0, 0.0
    for k in range(count + 1):
        along[k] = 0.0
    for k in range(count):
        end = count - 1 - k
        before -= gain[k] - left * size[k] / whole
        after += gain[end] - left * size[end] / whole
        along[k + 1] += 0.5 * before
        along[end] += 0.5 * after
    mean = 0.0
    if closed:
        for k in range(count):
            mean += 0.5 * (along[k] + along[count - k])
        mean /= count
    for k in range(count + 1):
        rate = along[k] - mean
        if not closed and (k == 0 or k == count):
            continue
        giver = (k - 1) % count if rate > 0.0 else k % count
        m = first + giver
        rho, u, v, p = traces[RHO, m], traces[U, m], traces[V, m], traces[P, m]
        energy = rho * (traces[TRACE_E, m] + 0.5 * (u * u + v * v)) + p
        for side in range(2):  # out of the cell before node k, into the one after
            cell = k - 1 + side
            if 0 <= cell < count:
                part = rate if side == 0 else -rate
                flux[MASS, first + cell] += part * rho
                flux[MOMENTUM_X, first + cell] += part * rho * u
                flux[MOMENTUM_Y, first + cell] += part * rho * v
                flux[ENERGY, first + cell] += part * energy
