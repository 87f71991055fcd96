"""What a regridder in space is given: two arrays of nodes, checked and converted alike."""

from __future__ import annotations

import numpy as np

from regrid.errors import BadInput
from regrid.hexahedra.carrying import gather_faces


def check_grids_in_space(previous, boundary) -> tuple[np.ndarray, np.ndarray]:
    """Both as contiguous float64 of one shape (3, ni+1, nj+1, nk+1); BadInput where they are not.

    Inner nodes of `boundary` may be anything.
    """
    found = []
    for name, given in (("previous", previous), ("boundary", boundary)):
        nodes = np.ascontiguousarray(given, dtype=np.float64)
        if nodes.ndim != 4 or nodes.shape[0] != 3 or min(nodes.shape[1:]) < 2:
            raise BadInput(
                f"regrid: {name} has shape {nodes.shape}; it must be (3, ni+1, nj+1, nk+1), "
                "ni, nj, nk >= 1"
            )
        found.append(nodes)
    if found[0].shape != found[1].shape:
        raise BadInput(
            f"regrid: previous has shape {found[0].shape}, boundary {found[1].shape}; "
            "they must agree"
        )
    if not np.isfinite(found[0]).all():
        raise BadInput("regrid: the previous grid has nodes that are not finite numbers")
    if not np.isfinite(gather_faces(found[1])).all():
        raise BadInput("regrid: the boundary has nodes that are not finite numbers")
    return found[0], found[1]
