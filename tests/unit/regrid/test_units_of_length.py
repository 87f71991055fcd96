"""A grid in another unit of length is the same grid, or is refused with a sentence."""

import numpy as np
import pytest

from shockgrid.regrid.equidistribution.volumes import EquidistributionRegridder3D
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.hexahedra.regridder import BarrierRegridder3D
from shockgrid.regrid.registry import REGRIDDERS, make_regridder

REGRIDDERS_IN_SPACE = {
    "barrier": BarrierRegridder3D,
    "equidistribution": EquidistributionRegridder3D,
}
SIZES = (1e-149, 1e-120, 1e-100, 1e-80, 1e-45, 1e45, 1e80, 1e100, 1e149)


def bent_square():
    line = np.linspace(0.0, 1.0, 13)
    previous = np.array(np.meshgrid(line, line, indexing="ij"))
    boundary = previous.copy()
    boundary[1, :, 0] += 0.2 * np.sin(np.pi * line)
    return previous, boundary


def bent_cube():
    line = np.linspace(0.0, 1.0, 7)
    previous = np.array(np.meshgrid(line, line, line, indexing="ij"))
    boundary = previous.copy()
    wave = np.sin(np.pi * line)
    boundary[2, :, :, 0] += 0.15 * wave[:, None] * wave
    return previous, boundary


MAKERS = {name: (lambda name=name: make_regridder(name), bent_square) for name in REGRIDDERS}
MAKERS |= {f"{name} in space": (kind, bent_cube) for name, kind in REGRIDDERS_IN_SPACE.items()}


@pytest.mark.parametrize("name", MAKERS)
@pytest.mark.parametrize("size", SIZES)
def test_any_unit_gives_the_same_grid(name, size):
    make, shape = MAKERS[name]
    previous, boundary = shape()
    wanted = make().regrid(previous, boundary.copy()).nodes
    found = make().regrid(size * previous, size * boundary).nodes / size
    assert np.abs(found - wanted).max() < 1e-12


@pytest.mark.parametrize("name", MAKERS)
@pytest.mark.parametrize("size", [1e-320, 1e-160, 1e160, 1e300])
def test_no_bodys_size_is_refused(name, size):
    make, shape = MAKERS[name]
    with pytest.raises(BadInput, match="unit of length"):
        make().regrid(*(size * grid for grid in shape()))


@pytest.mark.parametrize("name", MAKERS)
def test_far_from_the_origin_digits_decide(name):
    make, shape = MAKERS[name]
    previous, boundary = shape()
    cells = previous.shape[1] - 1
    wanted = make().regrid(previous, boundary.copy()).nodes
    for away in (1e4, 1e8, 1e10):
        found = make().regrid(previous + away / cells, boundary + away / cells).nodes
        assert np.abs(found - away / cells - wanted).max() < 1e-15 * away
    with pytest.raises(BadInput, match="digits"):
        make().regrid(previous + 1e15 / cells, boundary + 1e15 / cells)
