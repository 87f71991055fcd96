"""The suite's marches: what their files hold, that their boundaries are simple, and the harness."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from click.testing import CliRunner

from benchmarks.regrid_suite import commands, measures
from benchmarks.regrid_suite.catalogue import DATA, NAMES, load_march
from benchmarks.regrid_suite.files import read_march, write_march
from benchmarks.regrid_suite.harness import Refused, run_march
from benchmarks.regrid_suite.marches import get_side, interpolate_faces, name_sides
from benchmarks.regrid_suite.regridders import REGRIDDERS
from regrid.errors import BadInput

LOOKED_AT = 5  # steps of each march whose boundary is tested for crossings


def test_there_are_enough_marches_and_every_one_has_words():
    assert len(NAMES) == len(set(NAMES)) and len(NAMES) >= 40
    assert sum(name.endswith("-3d") for name in NAMES) >= 4


@pytest.mark.parametrize("name", NAMES)
def test_a_march_starts_valid_and_stays_simple(name):
    march = load_march(name)
    assert march.about and march.formula
    assert measures.count_bad_cells(march.start) == 0
    for side in name_sides(march.dim):
        np.testing.assert_allclose(get_side(march.start, side), march.sides[side][0], atol=1e-12)
    for step in np.linspace(0, march.steps, LOOKED_AT).astype(int):
        boundary = march.boundary(step)
        for side in name_sides(march.dim):  # corners are those of every side that has them
            np.testing.assert_array_equal(get_side(boundary, side), march.sides[side][step])
        if march.dim == 2:
            assert measures.find_boundary_crossing(boundary) is None


@pytest.mark.parametrize("kind", ["npz", "h5"])
@pytest.mark.parametrize("name", ["five-cells-a-step-thin", "wavy-block-3d"])
def test_a_file_gives_the_march_back(tmp_path, name, kind):
    march = load_march(name)
    back = read_march(write_march(march, tmp_path / f"{name}.{kind}"))
    assert (back.name, back.formula, back.deforming) == (name, march.formula, march.deforming)
    np.testing.assert_array_equal(back.start, march.start)
    for step in range(march.steps + 1):
        np.testing.assert_array_equal(back.boundary(step), march.boundary(step))


def test_a_file_needs_none_of_this_code():
    """The loop of README.md, on the sample that lies beside it."""
    with np.load(DATA / "single-finger.npz") as march:
        nodes = march["start"]
        for step in range(1, len(march["parameter"])):
            boundary = np.full_like(nodes, np.nan)
            boundary[:, 0], boundary[:, -1] = march["i_min"][step], march["i_max"][step]
            boundary[:, :, 0], boundary[:, :, -1] = march["j_min"][step], march["j_max"][step]
            assert np.isfinite(boundary).sum() == 2 * 2 * (24 + 32)
    made = load_march("single-finger")
    np.testing.assert_allclose(boundary, made.boundary(made.steps), rtol=0.0, atol=1e-12)
    assert (DATA / "single-finger.npz").stat().st_size < 200_000
    assert (DATA / "mushroom_roll.npz").stat().st_size < 300_000


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"start": np.zeros((4, 3, 3))}, "start has shape"),
        ({"i_min": np.zeros((2, 2, 2))}, "i_min is"),
        ({"format": np.array("another")}, "'format' is 'another'"),
    ],
)
def test_a_bad_file_is_told_in_a_sentence(tmp_path, change, words):
    path = tmp_path / "march.npz"
    with np.load(DATA / "single-finger.npz") as march:
        np.savez(path, **{**dict(march.items()), **change})
    with pytest.raises(BadInput, match=words):
        read_march(path)
    path.write_bytes(b"PK\x03\x04 no archive")
    with pytest.raises(BadInput, match="not a march"):
        read_march(path)
    with pytest.raises(BadInput, match="not a march"):
        read_march(Path("nowhere.h5"))


def test_commands(tmp_path):
    def call(*words):
        return CliRunner().invoke(commands.suite, [str(word) for word in words])

    listed = call("list")
    assert listed.exit_code == 0
    assert all(name in listed.output for name in (*NAMES, *REGRIDDERS))
    made = call("make", "piston", "-o", tmp_path, "--kind", "h5")
    assert made.exit_code == 0 and (tmp_path / "README.md").exists()
    with h5py.File(tmp_path / "piston.h5") as file:
        assert file["start"].shape == (2, 33, 25) and "formula" in file.attrs
    again = call("make", "piston", "-o", tmp_path, "--kind", "h5")
    assert again.exit_code == 2 and "--force" in again.output
    for words in (("run", "pistn"), ("run", "piston", "--with", "winslw"), ("draw", "tongue-3d")):
        more = ("-o", tmp_path / "a.png") if words[0] == "draw" else ()
        wrong = call(*words, *more)
        assert wrong.exit_code == 2 and "Traceback" not in wrong.output
    drawn = call("draw", "piston", "--with", "transfinite,laplacian", "-o", tmp_path / "a.png")
    assert drawn.exit_code == 0 and (tmp_path / "a.png").exists()


def make(name, march):
    return REGRIDDERS[name].make(march)


def test_harness_knows_what_is_exact():
    """A pressed rectangle keeps even cells by any formula: the measures are those of rectangles."""
    march = load_march("piston")
    for name in ("transfinite", "laplacian", "barrier"):
        found = run_march(march, make(name, march), lag=True)
        assert found.whole and found.sub_moves == 0
        assert found.sine == pytest.approx(1.0, abs=1e-6)
        assert found.gap == pytest.approx(1.0, abs=1e-6)
        assert found.lag < 1e-6
        lines = np.array([0.1 / 32, 1.0 / 24])
        assert found.rate == pytest.approx((1.0 / lines).sum(), rel=1e-6)
        assert found.aspect == pytest.approx(lines[1] / lines[0], rel=1e-6)


def test_harness_cuts_a_step_and_ends_by_its_rule():
    march = load_march("piston")
    calls = []

    def short_steps_alone(previous, boundary):
        """Refuses where a boundary node goes further than a fifth of a step."""
        calls.append(boundary)
        way = np.nanmax(np.abs(boundary - previous))
        if way > 0.2 * abs(march.sides["i_min"][1] - march.sides["i_min"][0]).max():
            raise Refused("too far")
        return make("transfinite", march)(previous, boundary)

    found = run_march(march, short_steps_alone)
    assert found.whole and found.sub_moves == 7 * march.steps
    assert np.isnan(calls[0][:, 1:-1, 1:-1]).all()

    def never(previous, boundary):
        raise Refused("never", previous)

    found = run_march(march, never)
    assert found.done == 0 and found.failure == "step 1: never" and found.overlap == 0.0

    def other_sides(previous, boundary):
        return previous

    assert "is not the one asked for" in run_march(march, other_sides).failure


def test_folding_is_told_with_its_step():
    march = load_march("single-finger")
    found = run_march(march, make("laplacian", march))
    assert 0 < found.done < march.steps and "folded" in found.failure
    assert found.overlap > 0.0
    assert measures.count_bad_cells(found.nodes) == 0
    assert measures.count_bad_cells(found.ended_by) > 0


def test_six_faces_of_a_straight_block_give_its_grid():
    nodes = np.array(np.meshgrid(*(np.linspace(0.0, n, n + 1) for n in (3, 4, 5)), indexing="ij"))
    faces = nodes.copy()
    faces[:, 1:-1, 1:-1, 1:-1] = np.nan
    np.testing.assert_allclose(interpolate_faces(faces), nodes, atol=1e-14)


def test_laplacian_is_the_mean_of_neighbours():
    for name in ("omega", "tongue-3d"):
        march = load_march(name)
        nodes = make("laplacian", march)(march.start, march.boundary(march.steps))
        middle = (slice(None), *(slice(1, -1),) * march.dim)
        total = sum(
            np.roll(nodes, shift, axis=axis)
            for axis in range(1, march.dim + 1)
            for shift in (1, -1)
        )
        np.testing.assert_allclose(nodes[middle], total[middle] / (2 * march.dim), atol=1e-12)


def test_tmop_lowers_its_metric_where_installed():
    pytest.importorskip("mfem")
    march = load_march("omega")
    found = run_march(march, make("tmop-size", march))
    assert found.whole and found.sine > 0.1
