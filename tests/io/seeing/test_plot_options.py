"""Derived fields, values along a line, two runs side by side: sums, and what the command says."""

from __future__ import annotations

import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.path import Path as Polygon

from regrid.measure.corners import compute_centres
from runs.pictures.derived import get_field, get_words, has_field
from runs.pictures.lineouts import find_pieces

LINE = (-0.1, 0.23, 1.2, 0.71)


def make_block(seed: int = 0) -> SimpleNamespace:
    """A bent grid, sheared by chance, with fields linear in x and y and a solid rotation."""
    x, y = np.meshgrid(np.linspace(0, 1, 12), np.linspace(0, 1, 9), indexing="ij")
    shift = np.random.default_rng(seed).uniform(-0.015, 0.015, (2, *x.shape))
    nodes = np.array([x + 0.1 * y * y, y + 0.08 * np.sin(3 * x)]) + shift
    x, y = compute_centres(nodes)
    fields = {"rho": 5 + 3 * x - 4 * y, "p": 1 - 5 * x - 12 * y, "u": -2.5 * y + 7, "v": 2.5 * x}
    return SimpleNamespace(nodes=nodes, cell_fields=fields, state_fields={})


@pytest.mark.parametrize(
    ("name", "exact"), [("schlieren", 5.0), ("pressure_gradient", 13.0), ("vorticity", 5.0)]
)
def test_gradients_of_linear_fields_are_exact_on_a_bent_grid(name, exact):
    block = make_block()
    assert has_field(block, name) and get_words(block, name)[0] != "1"
    np.testing.assert_allclose(get_field(block, name), exact, rtol=1e-12)


@pytest.mark.parametrize("turned", [False, True])
def test_pieces_of_a_line_fill_it_and_lie_in_their_cells(turned):
    nodes = make_block(3).nodes
    if turned:
        nodes = nodes[:, ::-1]
    inside = (0.3, 0.3, 0.9, 0.8)
    cells, ends = find_pieces(nodes, inside)
    assert np.diff(ends, axis=1).sum() == pytest.approx(1.0, abs=1e-12)
    cells, ends = find_pieces(nodes, LINE)  # from outside to outside
    order = np.argsort(ends[:, 0])
    np.testing.assert_allclose(ends[order[1:], 0], ends[order[:-1], 1], atol=1e-12)
    assert 0.0 < ends.min() and ends.max() < 1.0
    for (i, j), (a, b) in zip(cells, ends, strict=True):
        corners = nodes[:, [i, i + 1, i + 1, i], [j, j, j + 1, j + 1]].T
        for part in (0.99 * a + 0.01 * b, 0.01 * a + 0.99 * b):
            point = (LINE[0] + part * (LINE[2] - LINE[0]), LINE[1] + part * (LINE[3] - LINE[1]))
            assert Polygon(corners).contains_point(point)


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """A folder for runs that several tests look at."""
    return tmp_path_factory.mktemp("kept")


@pytest.fixture
def toys(shockgrid, kept):
    """Copies of two runs of the toy."""
    for name, cells in (("one", "6"), ("other", "8")):
        if not (kept / name).exists():
            words = ("-q", "-o", str(kept / name), "--set", f"cells={cells}")
            assert shockgrid("run", "toy", *words, "--set", "output.dumps=2")[0] == 0
        shutil.copytree(kept / name, name)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--line", "1,2,3"), "two points in metres"),
        (("--line", "1,2,1,2"), "two points in metres"),
        (("--line", "1,2,x,2"), "two points in metres"),
        (("--line", "7,7,8,8"), "it meets no cell of"),
        (("--what", "line"), "--line X0,Y0,X1,Y1 says which"),
        (("--csv", "a.csv"), "--line says which"),
        (("--what", "mesh", "--beside", "one"), "not for 'mesh'"),
        (("--beside", "nowhere"), "nowhere does not exist"),
        (("vorticity",), "has no field 'vorticity'; there are: rho, q, schlieren"),
        (("rate",), "has no field 'rate'"),
    ],
)
def test_wrong_words_are_told_in_a_sentence(toys, shockgrid, words, told):
    code, _, error = shockgrid("plot", "one", *words)
    assert code == 2 and told in error and len(error.splitlines()) == 1
    assert not list(Path().glob("*.csv")) and not list(Path("one").glob("*.png"))
