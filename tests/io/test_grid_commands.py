"""`shockgrid grid`: from the command line to files and back, as a user with his own curves does."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from foreign_readers import missing

from builders import tensor
from regrid.algebraic import transfinite_grid
from regrid.domains.plane import make_domain
from regrid.measure.quality import find_bad_cells
from regrid.sides import SIDES

PNG = b"\x89PNG"
T9 = np.linspace(0.0, 1.0, 9)


def save_curves(name, **changes):
    """Four curves round a bent duct, with different numbers of points, some running backwards."""
    t, few = np.linspace(0.0, 1.0, 31), np.linspace(0.0, 1.0, 8)
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


def test_points_of_the_curves_are_the_nodes_where_nothing_else_is_asked(shockgrid):
    nodes = make_domain("dome", 12, 9).boundary(1.0)
    curves = {"i_min": nodes[:, 0], "i_max": nodes[:, -1], "j_min": nodes[:, :, 0]}
    np.savez("own.npz", **curves, j_max=nodes[:, ::-1, -1])
    assert shockgrid("grid", "make", "own.npz", "-o", "a.npz", "--family", "winslow")[0] == 0
    made = load("a.npz")
    for side in SIDES:
        assert np.array_equal(made[side], nodes[side])


@pytest.mark.parametrize("kind", ["npz", "h5", pytest.param("vts", marks=missing("vtkmodules"))])
def test_own_grid_is_untangled_and_keeps_its_sides(shockgrid, kind):
    """A swan by transfinite interpolation is folded; judged, mended and judged again."""
    nodes = transfinite_grid(make_domain("swan", 24, 16).boundary(1.0))
    number = len(find_bad_cells(nodes))
    np.savez("start.npz", x=nodes[0], y=nodes[1])
    with h5py.File("mine.h5", "w") as file:
        file["some/where/nodes"] = np.moveaxis(nodes, 0, -1)
    from runs.store.vtk import write_vts

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
    bars = [line.split()[3] for line in out.splitlines() if " to " in line and "#" in line]
    assert sum(map(int, bars)) == 2 * 384


def test_side_in_one_point_is_told_apart_from_folds(shockgrid):
    """The tip of a sector: triangles that no grid could mend, and one fold that can be mended."""
    r, angle = np.meshgrid(np.linspace(0.0, 1.0, 7), np.linspace(0.0, 1.0, 6), indexing="ij")
    nodes = np.array([r * np.cos(angle), r * np.sin(angle)])
    np.savez("sector.npz", nodes=nodes)
    code, out, _ = shockgrid("grid", "check", "sector.npz")
    assert code == 1 and "5 of 30 cells are not convex" in out and "5 of these because" in out
    nodes[:, 4, 3] = nodes[:, 6, 3]
    np.savez("folded.npz", nodes=nodes)
    assert "5 of these because" in shockgrid("grid", "check", "folded.npz", "--plot", "f.png")[1]


def test_left_handed_curves_keep_their_names(shockgrid):
    """Top below bottom: the grid's indices run as the names say, and it is told."""
    save_curves("curves.npz")
    with np.load("curves.npz") as file:
        curves = dict(file)
    curves["top"], curves["bottom"] = curves["bottom"], curves["top"]
    np.savez("turned.npz", **curves)
    code, out, _ = shockgrid("grid", "make", "turned.npz", "--cells", "12x8", "-o", "a.npz")
    assert code == 0 and "turn the other way" in out
    assert load("a.npz")[1, 6, 0] > load("a.npz")[1, 6, -1]


def test_weight_draws_the_cells_together(shockgrid):
    words = "grid make dome --cells 16x12 --family equidistribution -o".split()
    assert shockgrid(*words, "even.npz", "--weight", "1")[0] == 0
    assert shockgrid(*words, "dense.npz", "--weight", "1+20*exp(-20*(y-1)**2)")[0] == 0
    height = [np.diff(load(name)[1, :, 6])[-1] for name in ("even.npz", "dense.npz")]
    assert height[1] < 0.6 * height[0]


def test_nothing_is_overwritten_unasked(shockgrid):
    Path("dome-barrier.h5").write_text("precious")
    for extra in ((), ("-o", "b.h5", "-o", "dome-barrier.h5"), ("-o", "c.vts", "--plot")):
        Path("c.png").write_text("precious")
        code, _, error = shockgrid("grid", "make", "dome", *extra)
        assert code == 2 and "exists; --force" in error
        assert Path("dome-barrier.h5").read_text() == Path("c.png").read_text() == "precious"
    assert not Path("b.h5").exists() and not Path("c.vts").exists()
    assert shockgrid("grid", "make", "dome", "--cells", "8x8", "--force")[0] == 0
    assert h5py.is_hdf5("dome-barrier.h5")


def test_a_run_s_dump_is_a_grid_too(shockgrid):
    shockgrid("run", "toy", "-q", "-o", "run", "--set", "cells=4", "--set", "run.t_end=0.05")
    dump = next(Path("run").rglob("*dump*.h5"), None) or next(Path("run").rglob("*.h5"))
    code, _, error = shockgrid("grid", "check", str(dump))
    assert code == 2 and "choose one with --block" in error and "'left'" in error
    code, out, _ = shockgrid("grid", "check", str(dump), "--block", "left")
    assert code in (0, 1) and "4 x 4 cells" in out


def test_block_in_space(shockgrid):
    words = "grid make ks-block-1 --cells 6x6x5 --weight 1+10*(z+1) -o a.h5 -o a.vts --plot".split()
    code, out, _ = shockgrid(*words)
    assert code == 0 and "eight positive corners" in out and "spread of weight times volume" in out
    assert Path("a.png").read_bytes().startswith(PNG)
    code, out, _ = shockgrid("grid", "check", "a.h5", "--plot", "b.png")
    assert code == 0 and "180 cells" in out
    words = "grid regrid a.h5 --option iterations=20 --weight 1 -o b.npz".split()
    assert shockgrid(*words)[0] == 0
    before, after = h5py.File("a.h5")["blocks/grid"], load("b.npz")
    assert np.array_equal(after[0, 0], before["x"][0]) and np.array_equal(
        after[2, :, :, -1], before["z"][:, :, -1]
    )
    # An even weight: the layers at the dense end have grown.
    assert np.diff(after[2, 3, 3])[-1] > 1.05 * np.diff(before["z"][3, 3])[-1]


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


def test_compare_in_files(shockgrid):
    """Curves, and a grid that was made from them: one family then finds the same grid."""
    save_curves("curves.npz")
    assert shockgrid(*"grid make curves.npz --cells 12x8 -o grid.h5".split())[0] == 0
    words = "grid compare curves.npz,grid.h5 --cells 12x8 --plot both.png".split()
    some = ("--family", "barrier", "--family", "winslow")
    code, out, error = shockgrid(*words, *some)
    assert code == 0, error
    rows = [line.split() for line in out.splitlines() if line.startswith("barrier")]
    assert len(rows) == 2 and rows[0][2:5] == rows[1][2:5]
    from regrid.given import read_grid
    from runs.grids.quality import judge

    assert float(rows[0][3]) == pytest.approx(judge(read_grid("grid.h5")).least_sine, rel=2e-3)
    assert Path("both-grid.png").read_bytes().startswith(PNG)


def test_failed_grid_is_kept_to_be_looked_at(shockgrid):
    words = "grid make swan --cells 24x16 --steps 3 --family transfinite".split()
    code, out, error = shockgrid(*words)
    assert code == 3 and not out and not list(Path().iterdir())
    code, out, error = shockgrid(*words, "-o", "a.h5", "--plot")
    assert code == 3 and not out and "a-failed.h5  a-failed.xdmf; picture: a-failed.png" in error
    names = {"a-failed.h5", "a-failed.xdmf", "a-failed.png"}
    assert {path.name for path in Path().iterdir()} == names
    assert h5py.File("a-failed.h5").attrs["failure"].startswith("swan, family transfinite: no grid")
    code, out, _ = shockgrid("grid", "check", "a-failed.h5")
    assert code == 1 and "cells are not convex" in out
    assert shockgrid(*words, "-o", "a.h5", "--plot")[0] == 3  # the old ones are replaced
    save_curves("crossed.npz", bottom=np.c_[2.0 * T9, 1.8 * np.sin(np.pi * T9)])
    code, _, error = shockgrid("grid", "make", "crossed.npz", "--cells", "9x9", "--plot")
    assert code == 3 and "picture: crossed-barrier-failed.png" in error
    assert Path("crossed-barrier-failed.png").read_bytes().startswith(PNG)


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


def test_list_names_everything(shockgrid):
    from regrid.registry import REGRIDDERS

    code, out, _ = shockgrid("grid", "list")
    assert code == 0
    names = {line.strip("* ").split("  ")[0] for line in out.splitlines()}
    assert {"swan", "chicane", "ks-block-2", *REGRIDDERS} <= names


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
        ("grid make swan --option epsilon=abc", 2, "epsilon = 'abc'; it has to be a number"),
        ("grid make swan --option newton_steps=1.5", 2, "has to be a whole number"),
        ("grid make swan --at nan", 2, "from 0 to 1"),
        ("grid check point.npz", 2, "reaches over 0 in x, which is no extent"),
        ("grid check huge.npz", 2, "reaches over 1e+300 in x"),
        ("grid make swan --weight 1+x", 2, "takes none; these do: equidistribution"),
        ("grid make swan --family equidistribution --weight 1+q", 2, "there is no 'q' here"),
        ("grid make swan -o grid.txt", 2, "ending in .h5, .vts, .npz"),
        ("grid make swan -o nowhere/grid.h5", 2, "is no folder"),
        ("grid make swan --family transfinite", 3, "no grid at step 3"),
        ("grid make ks-block-1 --option foo=1", 2, "has the options iterations, sides, threads"),
        ("grid make ks-block-1 --family winslow", 2, "is in space"),
        ("grid make ks-block-1 --weight 1+r", 2, "there is no 'r' here"),
        ("grid make ks-block-1 --cells 6x6", 2, "write 20x20x20"),
        ("grid regrid curves.npz", 2, "boundary curves and no grid"),
        ("grid check flat.npz", 2, "one shape"),
        ("grid check nan.npz", 2, "node (1, 2) is not a finite number"),
        ("grid check torn.npz", 2, "no archive of arrays"),
        ("grid make words.npz --cells 9x9", 2, "array left must hold real numbers"),
        ("grid check torn.h5", 2, "no readable HDF5 file"),
        ("grid check torn.vts", 2, "no VTK file"),
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
