"""ED3: the discrete operator, exact grids, orders, threads, and the order of work of a block."""

import numpy as np
import pytest

from builders import box
from regrid.equidistribution.volumes import (
    Ed3Operator,
    equidistribute_block,
    interpolate_faces,
    is_valid,
    solve_ed3,
)
from regrid.errors import BadInput, RegridFailure
from regrid.measure.hexahedra import compute_least_corner_volumes, find_bad_hexahedra


def cube(*shape):
    return box((0.0,) * 3, (1.0,) * 3, shape)


def bent_duct(p):
    """A quarter of a ring from r = 1 to 2, between a bulging floor and z = 0."""
    a, b, c = p
    bulge = 1.0 - 0.05 * np.sin(np.pi * a) * np.sin(np.pi * b)
    angle = 0.5 * np.pi * b
    return np.array([(1.0 + a) * np.sin(angle), -(1.0 + a) * np.cos(angle), (c - 1.0) * bulge])


def horn(p):
    """A square duct whose width falls along z from 1.5 to 1, with curved sides."""
    a, b, c = p
    width = 1.5 - c * c * (1.5 - c)
    return np.array([(a - 0.5) * width, (b - 0.5) * width, c - 1.0])


def shell(q):
    """Part of a spherical shell with equal volumes: r = (1 + 7 q1)^(1/3), cosine linear in q2."""
    r = np.cbrt(1.0 + 7.0 * q[0])
    cosine, longitude = q[1] - 0.5, 1.2 * q[2]
    sine = np.sqrt(1.0 - cosine * cosine)
    return r * np.array([sine * np.cos(longitude), sine * np.sin(longitude), -cosine])


def weight_in_z(x, y, z):
    return 1.0 + 10.0 * (z + 1.0)


def average(values, axes):
    for axis in axes:
        values = np.moveaxis(values, axis, 0)
        values = np.moveaxis(0.5 * (values[1:] + values[:-1]), 0, axis)
    return values


def plain_residual(nodes, weight):
    """(3.16) written down with arrays."""
    axes = (1, 2, 3)
    others = [[b for b in axes if b != a] for a in axes]
    d = [average(np.diff(nodes, axis=a), rest) for a, rest in zip(axes, others, strict=True)]
    g = [(v * v).sum(axis=0) for v in d]
    factors = (g[1] * g[2], g[0] * g[2], g[0] * g[1])
    return sum(
        average(np.diff(weight * factor * v, axis=a), rest)
        for a, rest, factor, v in zip(axes, others, factors, d, strict=True)
    )


def make_rough_block():
    rng = np.random.default_rng(5)
    nodes = cube(7, 5, 9) + 0.02 * rng.normal(size=(3, 8, 6, 10))
    return nodes, rng.uniform(1.0, 5.0, (7, 5, 9))


def test_kernel_is_the_equation_for_any_grid():
    nodes, weight = make_rough_block()
    expected = plain_residual(nodes, weight)
    serial = Ed3Operator((7, 5, 9))
    serial.evaluate(nodes, weight)
    assert np.abs(serial.residual - expected).max() < 1e-12 * np.abs(expected).max()


@pytest.mark.slow
def test_kernel_is_the_equation_for_any_grid_and_any_chunks():
    nodes, weight = make_rough_block()
    serial = Ed3Operator((7, 5, 9))
    serial.evaluate(nodes, weight)
    for threads in (2, 3):
        chunked = Ed3Operator((7, 5, 9), threads)
        for array in (chunked.residual, chunked.e1, chunked.e2, chunked.e3, chunked.sums):
            array[:] = np.nan
        chunked.evaluate(nodes, weight)
        for name in ("residual", "e1", "e2", "e3", "products", "sums"):
            assert np.array_equal(getattr(chunked, name), getattr(serial, name))
    shifted = solve_ed3(nodes, weight, 12).nodes
    assert np.array_equal(shifted, solve_ed3(nodes, weight, 12, threads=2).nodes)
    assert np.array_equal(shifted, solve_ed3(nodes, weight, 12, threads=3).nodes)


def tensor_weight(x, y, z):
    return (1.0 + 10.0 * x) * (1.0 + 5.0 * y) * (1.0 + 3.0 * z)


def tensor_mapping(q):
    return np.array([(np.sqrt(1.0 + c * (c + 2.0) * v) - 1.0) / c for c, v in zip((10, 5, 3), q)])  # noqa: B905


def test_tensor_grid_is_exact():
    nodes = tensor_mapping(cube(10, 8, 9))
    found = solve_ed3(nodes, tensor_weight)
    assert found.stop == "converged" and found.best == 0
    assert found.residuals[0] < 1e-13 and found.spreads[0] < 1e-13
    assert np.array_equal(found.nodes, nodes)


def test_tensor_grid_is_found_from_equal_steps():
    """Edges and faces carry the weight inside: w times volume constant to the tolerance."""
    found = equidistribute_block(lambda p: p.copy(), (8, 7, 6), tensor_weight, 200)
    assert np.abs(found.nodes - tensor_mapping(cube(8, 7, 6))).max() < 1e-8
    assert found.spreads[found.best] < 1e-7


def test_spherical_shell_is_second_order():
    errors, spreads = [], []
    for steps in (6, 12):
        exact = shell(cube(steps, steps, steps))
        found = solve_ed3(exact, 1.0, 400, 1e-9)
        errors.append(np.abs(found.nodes - exact).max())
        spreads.append(found.spreads[found.best])
    assert errors[0] / errors[1] > 3.3 and errors[1] < 1e-3
    assert spreads[0] / spreads[1] > 3.0 and spreads[1] < 1e-3


@pytest.mark.parametrize("mapping", [bent_duct, horn])
@pytest.mark.parametrize("weight", [1.0, weight_in_z])
@pytest.mark.parametrize(
    ("steps", "iterations"),
    [
        (12, 40),
        pytest.param(20, 100, marks=pytest.mark.slow),
        pytest.param(40, 100, marks=pytest.mark.slow),
    ],
)
def test_curved_blocks_spread_falls_and_every_corner_is_positive(
    mapping, weight, steps, iterations
):
    """[KhakimzyanovShokina1998] figure 3: w = 1 and w = 1 + 10 (z + 1), two curved blocks."""
    shape = (steps, steps, steps)
    fixed = equidistribute_block(mapping, shape, weight, iterations, sides=False)
    whole = equidistribute_block(mapping, shape, weight, iterations)
    for found in (fixed, whole):
        assert (np.diff(found.spreads) < 0.0).all()
        assert is_valid(found.nodes)
    assert whole.spreads[whole.best] < 0.7 * fixed.spreads[fixed.best]


def test_the_history_of_faces_and_volume_is_returned():
    found = equidistribute_block(horn, (8, 7, 6), weight_in_z, 20)
    assert sorted(found.faces) == ["0 high", "0 low", "1 high", "1 low", "2 high", "2 low"]
    for part in (found, *found.faces.values()):
        assert part.residuals.size == part.spreads.size > part.best
        assert part.spreads[part.best] <= part.spreads[0] * (1.0 + 1e-12)
        assert part.stop in ("converged", "stalled", "iterations")
    assert not equidistribute_block(horn, (8, 7, 6), weight_in_z, 5, sides=False).faces


def test_a_block_that_folds_is_named_by_face_or_cells():
    """The mapping turns over towards p2 = 1, whatever the weight."""

    def folded(p):
        a, b, c = p
        return np.array([a + 3.0 * c * a * (a - 1.0) * np.sin(np.pi * b), b, c])

    with pytest.raises(RegridFailure, match=r"face|cells \(\d"):
        equidistribute_block(folded, (6, 6, 6), 1.0, 20)


def test_turned_moved_and_scaled_blocks_have_the_same_grid():
    start = horn(cube(8, 7, 6))
    expected = solve_ed3(start, weight_in_z, 20).nodes
    turn = np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    shift = np.array([2.0, -1.0, 0.5]).reshape(3, 1, 1, 1)
    for scale in (1.0, 1e-10):

        def back(x, y, z, scale=scale):
            return weight_in_z(*np.tensordot(turn.T, np.array([x, y, z]) / scale - shift, 1))

        carried = scale * (np.tensordot(turn, start, 1) + shift)
        found = np.tensordot(turn.T, solve_ed3(carried, back, 20).nodes / scale - shift, 1)
        assert np.abs(found - expected).max() < 1e-10


def test_interpolation_from_faces_keeps_what_is_trilinear():
    nodes = cube(5, 4, 6)
    nodes = np.array([nodes[0] + nodes[1] * nodes[2], nodes[1], nodes[2] * (1.0 + nodes[0])])
    spoiled = nodes.copy()
    spoiled[:, 1:-1, 1:-1, 1:-1] = 7.0
    assert np.abs(interpolate_faces(spoiled) - nodes).max() < 1e-14


def test_corner_volumes_of_a_known_cell_and_a_folded_one():
    nodes = cube(2, 3, 4)
    assert np.allclose(compute_least_corner_volumes(nodes), 1.0 / 24.0)
    assert len(find_bad_hexahedra(nodes)) == 0
    assert len(find_bad_hexahedra(nodes[::-1])) == 24
    nodes[0, 1, 1, 1] += 0.6
    assert [1, 1, 1] in find_bad_hexahedra(nodes).tolist()
    nodes[0, 1, 1, 1] = np.nan
    assert len(find_bad_hexahedra(nodes)) == 8


def test_what_cannot_be_is_named():
    folded = cube(4, 4, 4)
    folded[0, 2, 2, 4] -= 0.9
    with pytest.raises(RegridFailure, match=r"cells \(\d, \d, 3\)"):
        solve_ed3(folded, iterations=20)
    with pytest.raises(BadInput, match=r"cell \(0, 0, 0\)"):
        solve_ed3(cube(4, 4, 4), lambda x, y, z: x - 1.0)
    with pytest.raises(BadInput, match="2 cells"):
        solve_ed3(cube(4, 4, 1))


def test_what_scratch_held_before_does_not_matter(monkeypatch):
    """A NaN left in memory once ended the iteration at its start."""
    nodes = shell(cube(5, 5, 5))
    clean = solve_ed3(nodes, 1.0, 20, 1e-12)
    empty = np.empty

    def make_dirty(*arguments, **options):
        array = empty(*arguments, **options)
        array.fill(np.nan if array.dtype.kind == "f" else 7)
        return array

    monkeypatch.setattr(np, "empty", make_dirty)
    dirty = solve_ed3(nodes, 1.0, 20, 1e-12)
    assert np.array_equal(clean.nodes, dirty.nodes)
    assert np.array_equal(clean.residuals, dirty.residuals)
