"""`shockgrid grid`: from the command line to files and back, as a user with his own curves does."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from foreign_readers import missing

from builders import tensor
from shockgrid.regrid.algebraic import transfinite_grid
from shockgrid.regrid.domains import make_domain
from shockgrid.regrid.measure.quality import find_bad_cells
from shockgrid.regrid.sides import SIDES

PNG = b"\x89PNG"
T9 = np.linspace(0.0, 1.0, 9)


def save_curves(name, **changes):
    """Four curves round a bent duct, with different numbers of points, some running backwards."""
    t = np.linspace(0.0, 1.0, 31)
    few = np.linspace(0.0, 1.0, 8)
    curves = {
        "left": np.c_[0.0 * few, few],
        "right": np.c_[2.0 + 0.0 * t, 1.0 - t],
        "bottom": np.array([2.0 * t, 0.3 * np.sin(np.pi * t)]),
        "top": np.c_[2.0 * t, 1.0 + 0.2 * np.sin(2.0 * np.pi * t)][::-1],
    }
    np.savez(name, **{k: v for k, v in (curves | changes).items() if v is not None})


def load(name):
    with np.load(name) as file:
        return np.array([file[key] for key in "xyz" if key in file])


def test_curves_become_a_grid_on_them(shockgrid):
    save_curves("curves.npz")
    code, out, _ = shockgrid(
        *"grid make curves.npz --cells 16x10 -o a.npz -o a.h5 -o a.vts --plot".split()
    )
    assert code == 0 and "every one of the 160 cells is convex" in out
    nodes = load("a.npz")
    assert nodes.shape == (2, 17, 11) and len(find_bad_cells(nodes)) == 0
    assert np.abs(nodes[0, 0]).max() == 0.0 and np.abs(nodes[0, -1] - 2.0).max() == 0.0
    x, y = nodes[:, :, 0]
    assert np.abs(y - 0.3 * np.sin(0.5 * np.pi * x)).max() < 2e-3
    steps = np.hypot(*np.diff(nodes[:, :, 0], axis=1))
    assert np.ptp(steps) < 1e-2 * steps.mean()
    with h5py.File("a.h5") as file:
        assert file.attrs["family"] == "barrier" and file.attrs["format"] == "shockgrid grid"
        assert np.array_equal(file["blocks/grid/x"], nodes[0])
        assert all(d.attrs["long_name"] and d.attrs["units"] for d in file["blocks/grid"].values())
    assert Path("a.xdmf").exists() and Path("a.png").read_bytes().startswith(PNG)


@pytest.mark.parametrize("kind", ["npz", "h5", pytest.param("vts", marks=missing("vtkmodules"))])
def test_own_grid_is_untangled_and_keeps_its_sides(shockgrid, kind):
    nodes = transfinite_grid(make_domain("swan", 24, 16).boundary(1.0))
    number = len(find_bad_cells(nodes))
    np.savez("start.npz", x=nodes[0], y=nodes[1])
    with h5py.File("mine.h5", "w") as file:
        file["some/where/nodes"] = np.moveaxis(nodes, 0, -1)
    from shockgrid.runs.store.paraview import write_vts

    write_vts(Path("mine.vts"), nodes, {})
    np.savez("mine.npz", nodes=nodes)
    code, out, _ = shockgrid("grid", "check", f"mine.{kind}", "--plot", "before.png")
    assert code == 1 and f"{number} of 384 cells are not convex: (" in out
    worst = ", ".join(str(k) for k in find_bad_cells(nodes)[0])
    assert f"not convex: ({worst})" in out
    assert Path("before.png").read_bytes().startswith(PNG)
    code, out, _ = shockgrid("grid", "regrid", f"mine.{kind}", "-o", "better.npz")
    assert code == 0 and f"before: {number} cells not convex" in out and "untangled" in out
    better = load("better.npz")
    assert len(find_bad_cells(better)) == 0
    for side in SIDES:
        assert np.array_equal(better[side], nodes[side])
    code, out, _ = shockgrid("grid", "check", "better.npz")
    assert code == 0 and "every one of the 384 cells is convex" in out


def test_compare_on_a_domain(shockgrid):
    words = "grid compare swan,dome --cells 24x16 --steps 10 --plot both.png".split()
    some = ("--family", "barrier", "--family", "transfinite", "--family", "barrier:method=sweeps")
    code, out, _ = shockgrid(*words, *some)
    assert code == 0
    rows = [line.split() for line in out.splitlines()]
    done = [row[1] for row in rows if row and row[0] == "barrier"]
    assert done == ["10/10", "10/10"]
    folded = next(row for row in rows if row and row[0] == "transfinite")
    assert int(folded[1].split("/")[0]) < 10 and "transfinite, step" in out
    assert sum(row[:1] == ["barrier:method=sweeps"] for row in rows) == 2
    for name in ("both-swan.png", "both-dome.png"):
        assert Path(name).read_bytes().startswith(PNG)


def test_compare_in_a_flow(shockgrid):
    words = "grid compare interface-instability --set cells=8".split()
    some = ("--family", "barrier", "--family", "quasi-1d:family=i", "--plot", "flow.png")
    code, out, _ = shockgrid(*words, "--set", "run.t_end=0.3", *some)
    assert code == 0
    rows = {line.split()[0]: line.split() for line in out.splitlines() if line.strip()}
    for name in ("barrier", "quasi-1d:family=i"):
        assert rows[name][2] == "100%" and float(rows[name][3]) == pytest.approx(1.0, abs=0.1)
    assert Path("flow.png").read_bytes().startswith(PNG)
    code, out, _ = shockgrid(*words, "--set", "run.max_steps=2", "--family", "barrier")
    assert code == 0 and "stopped after run.max_steps = 2" in out


@pytest.mark.parametrize(
    ("words", "code", "sentence"),
    [
        ("grid makes", 2, "did you mean 'make'"),
        ("grid make swam", 2, "did you mean 'swan'"),
        ("grid make nowhere.npz", 2, "nowhere.npz does not exist"),
        ("grid make swan --cells 60", 2, "write 60x40"),
        ("grid make swan --cells 60x1", 2, "at least 2 cells"),
        ("grid make swan --cells 9000x9000", 2, "take fewer"),
        ("grid make swan --family winslo", 2, "did you mean 'winslow'"),
        ("grid make swan --option epsilo=1", 2, "did you mean 'epsilon'"),
        ("grid make swan --option epsilon", 2, "write key=value"),
        ("grid make swan --option epsilon=abc", 2, "epsilon = 'abc'; it must be a number"),
        ("grid make swan --option newton_steps=1.5", 2, "must be a whole number"),
        ("grid make swan --at nan", 2, "from 0 to 1"),
        ("grid check point.npz", 2, "the grid's extent in x is 0; it must be between"),
        ("grid check huge.npz", 2, "extent in x is 1e+300"),
        ("grid make swan --weight 1+x", 2, "takes no weight; those that do are: "),
        ("grid make swan --family equidistribution --weight 1+q", 2, "there is no 'q' here"),
        ("grid make swan -o grid.txt", 2, "ending in .h5, .vts, .npz"),
        ("grid make swan -o nowhere/grid.h5", 2, "is not a folder"),
        ("grid make swan --family transfinite", 3, "no grid at step 3"),
        ("grid make ks-block-1 --option foo=1", 2, "has the options iterations, sides, threads"),
        ("grid make ks-block-1 --family winslow", 2, "is in space"),
        ("grid make ks-block-1 --weight 1+r", 2, "there is no 'r' here"),
        ("grid make ks-block-1 --cells 6x6", 2, "write 20x20x20"),
        ("grid regrid curves.npz", 2, "boundary curves and no grid"),
        ("grid check flat.npz", 2, "one shape"),
        ("grid check nan.npz", 2, "node (1, 2) is not a finite number"),
        ("grid check torn.npz", 2, "not an archive of arrays"),
        ("grid make words.npz --cells 9x9", 2, "array left must hold real numbers"),
        ("grid check torn.h5", 2, "not a readable HDF5 file"),
        ("grid check torn.vts", 2, "not a VTK file"),
        ("grid check notes.txt", 2, "files read are .npz"),
        ("grid check empty.npz", 2, "no grid (arrays x and y"),
        ("grid make part.npz", 2, "no boundary curve right, bottom"),
        ("grid make gap.npz --cells 9x9", 2, "curves right and top must have an end in common"),
        ("grid make curves.npz", 2, "different numbers of points"),
        ("grid make crossed.npz --cells 9x9", 3, "crosses side"),
        ("grid compare foo", 2, "known are: three_fingers"),
        ("grid compare foo.npz", 2, "foo.npz does not exist"),
        ("grid compare swan --set cells=3", 2, "a domain has none"),
        ("grid compare swan --family barrier:epsilo=1", 2, "did you mean 'epsilon'"),
    ],
)
def test_bad_input_is_one_sentence(shockgrid, words, code, sentence):
    t = T9
    save_curves("curves.npz")
    save_curves("part.npz", right=None, bottom=None)
    save_curves("gap.npz", top=np.c_[1.9 * t, 1.0 + 0.0 * t])
    save_curves("crossed.npz", bottom=np.c_[2.0 * t, 1.8 * np.sin(np.pi * t)])
    np.savez("empty.npz", other=t)
    np.savez("flat.npz", x=np.zeros((4, 4)), y=np.zeros((4, 5)))
    square = tensor(t, t)
    np.savez("point.npz", nodes=0.0 * square)
    np.savez("huge.npz", nodes=1e300 * square)
    square[0, 1, 2] = np.nan
    np.savez("nan.npz", nodes=square)
    save_curves("words.npz", left=np.array(["a", "b"]))
    for name in ("torn.npz", "torn.h5", "torn.vts", "notes.txt"):
        Path(name).write_text("nothing of the kind")
    found, out, error = shockgrid(*words.split())
    assert found == code and sentence in error and not out
    assert error.count("\n") == 1 and error.startswith("shockgrid: ")
