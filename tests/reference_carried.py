"""One step of carried fields in plain numpy: what `hydro/carried` computes, written to be read.

To be called when `reference_step.take_step` has the fluxes: the same faces, masses and centres.
Left out: sliding contacts, along which mass passes between polygon cells.
"""

from __future__ import annotations

import numpy as np

from reference_step import SIDES, find_corners, flow_out, lower, upper
from shockgrid.hydro.formulas.reconstruction import limit_van_leer

limit = np.vectorize(limit_van_leer)


def find_faces(patch, sides):
    """Mass per time and values at the faces of a patch, by axis; at its sides none yet."""
    values = get_values(patch)
    if patch.block.strength is None:  # solids have it from the start
        slopes, half = reconstruct(patch, pad(patch, sides))
        patch.trace_carried = lambda points: (
            half + np.einsum("cqij,cij->qij", slopes, points - patch.centre)
        )
    trace = patch.trace_carried
    through = {}
    for axis, (_, _, middle) in patch.faces.items():
        mass = patch.fluxes[axis][0]
        face = np.zeros((len(values), *mass.shape))
        before, after = trace(upper(middle, axis)), trace(lower(middle, axis))
        inside = upper(lower(mass, axis), axis) > 0.0
        taken = np.where(inside, lower(before, axis), upper(after, axis))
        upper(lower(face, axis), axis)[...] = taken
        through[axis] = mass, face
    return through


def finish(patch, sides, through):
    """The new values, with what all patches have at their sides known."""
    values = get_values(patch)
    for side in sides:
        mass, face = through[side.axis]
        own = find_trace(side)
        beyond = own
        if side.segment.kind in ("seam", "periodic"):
            beyond = side.ask(find_trace)
        elif side.segment.kind == "inflow":
            beyond = side.segment._carried + 0.0 * own
        outwards = side.sign * side.take(mass) > 0.0
        side.take(face)[...] = np.where(outwards, own, beyond)
    held = (patch.volume + patch.extra) * patch.rho
    lost = flow_out({axis: mass for axis, (mass, _) in through.items()})
    taken = flow_out({axis: mass * face for axis, (mass, face) in through.items()})
    return (held * values - patch.dt * taken) / (held - patch.dt * lost)


def get_values(patch):
    """The fields (n, ni, nj) before the step."""
    return patch.block.carried[:, 1:-1, 1:-1]


def find_trace(side):
    """Values at the faces of a side."""
    take = lower if side.name.endswith("min") else upper
    points = take(side.patch.faces[side.axis][2], side.axis)
    return side.take(side.patch.trace_carried(points))


def pad(patch, sides):
    """The fields with what stands for them beyond each side (n, ni + 2, nj + 2)."""
    values = get_values(patch)
    padded = np.pad(values, ((0, 0), (1, 1), (1, 1)), mode="edge")
    ghosts = {
        "i_min": padded[:, 0, 1:-1],
        "i_max": padded[:, -1, 1:-1],
        "j_min": padded[:, 1:-1, 0],
        "j_max": padded[:, 1:-1, -1],
    }
    assert tuple(ghosts) == SIDES
    for side in sides:
        row = ghosts[side.name][:, side.segment.start : side.segment.stop]
        if side.segment.kind in ("seam", "periodic"):
            row[...] = side.ask(lambda other: other.take(get_values(other.patch)))
        elif side.segment.kind == "inflow":
            row[...] = side.segment._carried
    return padded


def reconstruct(patch, padded, limit=limit):
    """Slopes (2, n, ni, nj) bounded by the values around, and values at mid-time."""
    values = get_values(patch)
    around = {
        "i": (padded[:, :-2, 1:-1], padded[:, 2:, 1:-1]),
        "j": (padded[:, 1:-1, :-2], padded[:, 1:-1, 2:]),
    }
    limited = []
    for axis, (before, after) in around.items():
        (_, way), (_, way_after) = patch.find_steps(axis)
        twice = 2.0 * patch.lengths[axis]
        limited.append(limit(twice / way * (values - before), twice / way_after * (after - values)))
    slopes = patch.find_gradient(*limited)
    near = np.stack((values, *around["i"], *around["j"]))
    part = np.ones_like(values)
    for corner in find_corners(patch.block.nodes):
        change = np.einsum("cqij,cij->qij", slopes, corner - patch.centre)
        room = np.where(change > 0.0, near.max(axis=0) - values, values - near.min(axis=0))
        with np.errstate(all="ignore"):
            part = np.where(np.abs(change) > room, np.minimum(part, room / np.abs(change)), part)
    slopes = slopes * part
    drift = np.einsum("cqij,cij->qij", slopes, patch.velocity)
    return slopes, values - 0.5 * patch.dt * drift


def carry(patches, sides):
    """New values of the fields of all patches, in their order."""
    of_patch = [[side for side in sides if side.patch is patch] for patch in patches]
    through = [find_faces(patch, own) for patch, own in zip(patches, of_patch, strict=True)]
    found = zip(patches, of_patch, through, strict=True)
    return [finish(*one) for one in found]
