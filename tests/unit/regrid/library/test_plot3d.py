"""Plot3D files, however they were written, give the nodes that were written."""

import numpy as np
import pytest

from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.given import read_grid
from shockgrid.regrid.plot3d import read_plot3d


def make_blocks(axes, count):
    """Blocks of different sizes, i fastest in memory order (axes, [nk+1,] nj+1, ni+1)."""
    rng = np.random.default_rng(axes + count)
    blocks = []
    for number in range(count):
        shape = (5 + number, 4, 3 + number)[:axes]
        nodes = np.array(np.meshgrid(*(np.arange(float(n)) for n in shape), indexing="ij"))
        blocks.append(nodes + 0.2 * rng.random(nodes.shape) + 10.0 * number)
    return blocks


def give_numbers(nodes):
    """x of all nodes, then y, then z, i fastest."""
    return np.concatenate([part.ravel(order="F") for part in nodes])


def write(path, blocks, kind, multiple, precision, marked, order):
    heads = [np.array(nodes.shape[1:]) for nodes in blocks]
    marks = [np.ones(nodes[0].size, dtype=int) for nodes in blocks]
    for mark in marks:
        mark[::3] = 0
        mark[1] = -2
    if kind == "text":
        words = [str(len(blocks))] if multiple else []
        words += [" ".join(map(str, head)) for head in heads]
        for nodes, mark in zip(blocks, marks, strict=True):
            words += [f"{value:.17g}" for value in give_numbers(nodes)]
            words += list(map(str, mark)) if marked else []
        path.write_text("\n".join(words) + "\n", encoding="ascii")
        return
    records = [np.array([len(blocks)], order + "i4").tobytes()] if multiple else []
    records.append(np.concatenate(heads).astype(order + "i4").tobytes())
    for nodes, mark in zip(blocks, marks, strict=True):
        part = give_numbers(nodes).astype(f"{order}f{precision}").tobytes()
        records.append(part + (mark.astype(order + "i4").tobytes() if marked else b""))
    if kind == "records":
        records = [
            np.array([len(part)], order + "i4").tobytes() * bool(part)
            + part
            + np.array([len(part)], order + "i4").tobytes()
            for part in records
        ]
    path.write_bytes(b"".join(records))


@pytest.mark.parametrize("axes", [2, 3])
@pytest.mark.parametrize("count, multiple", [(1, False), (1, True), (3, True)])
@pytest.mark.parametrize("marked", [False, True])
@pytest.mark.parametrize("kind", ["text", "records", "stream"])
@pytest.mark.parametrize("precision", [4, 8])
@pytest.mark.parametrize("order", ["<", ">"])
def test_every_way_to_write_it(tmp_path, axes, count, multiple, marked, kind, precision, order):
    blocks = make_blocks(axes, count)
    path = tmp_path / "blocks.xyz"
    write(path, blocks, kind, multiple, precision, marked, order)
    found = read_plot3d(path)
    assert len(found) == count
    close = 1e-14 if precision == 8 or kind == "text" else 1e-5
    for nodes, wanted in zip(found, blocks, strict=True):
        assert nodes.shape == wanted.shape and nodes.flags.c_contiguous
        assert np.abs(nodes - wanted).max() < close


def test_numbers_as_fortran_lists_them(tmp_path):
    path = tmp_path / "list.p3d"
    path.write_text(" 3, 3\n 3*0.0 3*1.0D0, 3*2.d+0\n 0. 0.5 1. 0. .5 1. 0 5E-1 1\n")
    x, y = read_grid(str(path))
    assert np.array_equal(x, np.repeat(np.arange(3.0)[None], 3, axis=0))
    assert np.array_equal(y, np.repeat([[0.0], [0.5], [1.0]], 3, axis=1))


@pytest.mark.parametrize("thin", [0, 1, 2])
def test_a_block_one_node_thick_is_plane(tmp_path, thin):
    plane = make_blocks(2, 1)[0]
    space = np.insert(plane, 1 if thin == 1 else 2, 0.7, axis=0)
    space = np.expand_dims(space, thin + 1)
    path = tmp_path / "plane.g"
    write(path, [space], "records", True, 8, False, "<")
    assert np.array_equal(read_grid(str(path)), plane)


def test_a_block_is_chosen_by_its_number(tmp_path):
    path = tmp_path / "three.p3d"
    blocks = make_blocks(2, 3)
    write(path, blocks, "stream", True, 8, False, "<")
    assert np.array_equal(read_grid(str(path), "2"), blocks[1])
    with pytest.raises(BadInput, match=r"several blocks.*'1' \(4 x 3 cells\)"):
        read_grid(str(path))
    with pytest.raises(BadInput, match="no block '4'"):
        read_grid(str(path), "4")


@pytest.mark.parametrize("kind", ["text", "records", "stream"])
def test_what_is_cut_off_or_no_grid_is_refused(tmp_path, kind):
    path = tmp_path / "short.xyz"
    write(path, make_blocks(3, 2), kind, True, 8, False, "<")
    whole = path.read_bytes()
    end = whole.rstrip().rindex(b"\n") if kind == "text" else -9
    for contents in (b"", whole[: len(whole) // 2], whole[:end], b"\x00" * 64, b"a b c\n", b"7\n"):
        path.write_bytes(contents)
        with pytest.raises(BadInput, match=r"short\.xyz"):
            read_plot3d(path)


@pytest.mark.parametrize("name", ["a.msh", "a.mesh", "a.vtu", "a.cgns", "a.su2"])
def test_meshes_without_lines_say_how_to_get_blocks(tmp_path, name):
    path = tmp_path / name
    path.write_text("$MeshFormat\n")
    with pytest.raises(BadInput, match=r"blocks are wanted; .*(Plot3D|\.npz|\.vts)"):
        read_grid(str(path))
