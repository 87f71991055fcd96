"""Around the barrier in space: ED3 as a regridder, Jacobians at more places, marches by command."""

import numpy as np
import pytest

from builders import tensor
from regrid.domains.in_space import make_moving_block
from regrid.equidistribution.volumes import EquidistributionRegridder3D
from regrid.errors import BadInput
from regrid.hexahedra.faces import gather_faces
from regrid.measure.hexahedra import (
    compute_corner_ratio,
    compute_corner_volumes,
    compute_hexahedron_sines,
    compute_least_corner_volumes,
    compute_least_jacobian,
)
from runs.grids.marching_in_space import make_family_in_space, make_moving


def test_equidistribution_keeps_graded_boxes_and_faces():
    nodes = tensor(*(np.linspace(0.0, 1.0, n + 1) ** 1.4 for n in (4, 5, 6)))
    found = EquidistributionRegridder3D().regrid(nodes, nodes).nodes
    assert np.abs(found - nodes).max() < 1e-12
    mirrored = EquidistributionRegridder3D().regrid(nodes[::-1], nodes[::-1]).nodes
    assert np.abs(mirrored - nodes[::-1]).max() < 1e-12


def test_equidistribution_finds_a_graded_box_again():
    nodes = tensor(*(np.linspace(0.0, 1.0, n + 1) ** 1.4 for n in (6, 5, 6)))
    moved = nodes.copy()
    moved[0] += 0.08 * np.prod(np.sin(np.pi * nodes), axis=0)
    found = EquidistributionRegridder3D(iterations=60).regrid(moved, nodes).nodes
    assert np.array_equal(gather_faces(found), gather_faces(nodes))
    assert (compute_least_corner_volumes(found) > 0.0).all()
    assert np.abs(found - nodes).max() < 0.1 * np.abs(moved - nodes).max()


def test_equidistribution_wants_a_weight_of_space():
    with pytest.raises(BadInput, match="weight 'own'"):
        EquidistributionRegridder3D("own")


def test_jacobians_at_corners_are_corner_volumes():
    nodes = tensor(*(np.linspace(0.0, 1.0, n + 1) for n in (2, 3, 4)))
    nodes = nodes + 0.05 * np.random.default_rng(1).standard_normal(nodes.shape)
    least = compute_least_corner_volumes(nodes)
    assert np.allclose(compute_least_jacobian(nodes, 2), least, rtol=1e-12)
    assert np.allclose(compute_corner_volumes(nodes).min(axis=0), least, rtol=1e-12)
    assert (compute_least_jacobian(nodes, 4) <= least + 1e-15).all()
    assert compute_corner_ratio(2.0 * nodes, nodes) == pytest.approx(8.0)


def test_a_march_by_name():
    made = make_moving("twisted-duct", "barrier", {"epsilon": 2e-3}, (6, 4, 4), 4, 0.5)
    assert made.failure is None
    assert made.nodes.shape == (3, 7, 5, 5)
    assert compute_hexahedron_sines(made.nodes).min() > 0.8
    assert made.notes[0].startswith("marched in 4 steps")


@pytest.mark.parametrize(
    "family, options, words",
    [("barier", {}, "did you mean 'barrier'"), ("barrier", {"epsilom": 1}, "'epsilon'")],
)
def test_wrong_families_and_options(family, options, words):
    with pytest.raises(BadInput, match=words):
        make_family_in_space(family, options)
    with pytest.raises(BadInput, match="--steps 0"):
        make_moving("twisted-duct", "barrier", {}, (4, 4, 4), 0, 1.0)
    with pytest.raises(BadInput, match="did you mean 'twisted_duct'"):
        make_moving_block("twisted-dukt", (4, 4, 4))
