"""What a regridder is given: every family takes the same arrays, and refuses the same ones."""

import numpy as np
import pytest

from shockgrid.regrid.domains import make_domain
from shockgrid.regrid.registry import REGRIDDERS, make_regridder
from shockgrid.regrid.sides import SIDES

FAMILIES = {name: {} for name in sorted(REGRIDDERS)} | {"sweeps": {"method": "sweeps"}}
DOME = make_domain("dome", 8, 6)
OLD = DOME.start
NEW = np.nan_to_num(DOME.boundary(0.05))


def make(name):
    return make_regridder("barrier" if name == "sweeps" else name, **FAMILIES[name])


def stride(nodes):
    wide = np.full((2, 2 * nodes.shape[1], nodes.shape[2] + 3), np.nan)
    wide[:, ::2, 3:] = nodes
    return wide[:, ::2, 3:]


def lock(nodes):
    locked = nodes.copy()
    locked.flags.writeable = False
    return locked


SAME_NUMBERS = {
    "lists": np.ndarray.tolist,
    "Fortran order": np.asfortranarray,
    "a strided view": stride,
    "turned back": lambda nodes: nodes[:, ::-1].copy()[:, ::-1],
    "read-only": lock,
    "big-endian": lambda nodes: nodes.astype(">f8"),
    "a masked array": np.ma.array,
}


@pytest.mark.parametrize("name", FAMILIES)
def test_numbers_count_not_how_they_are_held(name):
    regridder = make(name)
    wanted = regridder.regrid(OLD, NEW).nodes
    for what, hold in SAME_NUMBERS.items():
        old = hold(OLD)
        new = hold(NEW)
        found = regridder.regrid(old, new).nodes
        assert np.array_equal(found, wanted), what
        assert found.dtype == np.float64 and found.flags.c_contiguous and found.flags.writeable
        assert not np.shares_memory(found, np.asarray(old))
    single = [nodes.astype(np.float32) for nodes in (OLD, NEW)]
    exact = regridder.regrid(*(nodes.astype(np.float64) for nodes in single)).nodes
    assert np.array_equal(regridder.regrid(*single).nodes, exact)
    # whole numbers: a box of ten by ten millimetres a cell
    box = 10 * np.array(np.meshgrid(np.arange(9), np.arange(7), indexing="ij"))
    moved = box + np.array([3, -2])[:, None, None]
    assert np.array_equal(regridder.regrid(box, moved).nodes[SIDES[0]], moved[SIDES[0]])
