"""Mass is balanced over all that seams join, whatever the labels of the blocks' materials."""

import pytest

from builders import box, find_unexplained, march_whole, wall_off
from shockgrid.hydro.block import Block
from shockgrid.hydro.eos import IdealGas
from shockgrid.hydro.links import join, slide
from shockgrid.hydro.simulation import Simulation
from shockgrid.regrid.errors import BadInput

PRESSURES = 5e5, 1e5, 2e5, 1e5, 4e5


def make_row(count, low=0.0, kind="seam", material=None):
    """Blocks of air in a row from x = 0 to 1, under different pressures, and their links."""
    blocks = []
    for number in range(count):
        corners = (number / count, low), ((number + 1) / count, low + 0.1)
        label = material and material[number]
        name = f"{low:g}-{number}"
        state = 1.2, 0.0, 0.0, PRESSURES[number]
        blocks.append(Block(name, IdealGas(1.4), box(*corners, (8, 3)), *state, material=label))
    links = [join(kind, (blocks[k], "i_max"), (blocks[k + 1], "i_min")) for k in range(count - 1)]
    return blocks, links


def measure_mass_errors(blocks, links, **options):
    """Relative conservation error of each total of mass after a short march."""
    for block in blocks:
        wall_off(block)
    rows = march_whole(Simulation(blocks, links, t_end=4e-4, mesh="fixed", **options))
    names = [name for name in rows[-1] if name.startswith("total_mass_")]
    return {
        name.removeprefix("total_mass_"): find_unexplained(rows, name.removeprefix("total_"))
        / rows[-1][name]
        for name in names
    }


@pytest.mark.parametrize("count", [2, 5])
@pytest.mark.parametrize("closed", [False, True], ids=["chain", "ring"])
def test_mass_of_blocks_in_a_row(count, closed):
    blocks, links = make_row(count)
    if closed:
        links.append(join("periodic", (blocks[-1], "i_max"), (blocks[0], "i_min")))
    errors = measure_mass_errors(blocks, links)
    assert len(errors) == 1
    assert max(errors.values()) < 1e-13


def test_labels_that_seams_contradict():
    blocks, links = make_row(3, material=("air", "argon", "air"))
    apart, inner = make_row(2, low=1.0, material=("air", "air"))
    errors = measure_mass_errors(blocks + apart, links + inner)
    assert set(errors) == {"air+argon", "air"}
    assert max(errors.values()) < 1e-13


def test_sliding_contact_along_a_follower_of_two_joined_blocks():
    lower, links = make_row(2, low=0.0)
    upper, inner = make_row(1, low=0.1)
    contact = slide((upper[0], "j_min"), [(block, "j_max") for block in lower])
    links += [*inner, contact]
    for block in lower + upper:
        wall_off(block)
    flow = Simulation(lower + upper, links, t_end=1e-5)
    rows = march_whole(flow)
    for name in ("mass_0-0+0-1", "mass_0.1-0"):
        assert find_unexplained(rows, name) < 1e-13 * rows[-1][f"total_{name}"]


def test_a_seam_joins_no_two_materials():
    blocks = [
        Block(name, IdealGas(gamma), box((x, 0.0), (x + 1.0, 1.0), (4, 4)), 1.0, 0.0, 0.0, 1e5)
        for x, (name, gamma) in enumerate((("light", 1.67), ("air", 1.4)))
    ]
    with pytest.raises(BadInput, match=r"light.*air.*1\.67.*1\.4.*interface"):
        join("seam", (blocks[0], "i_max"), (blocks[1], "i_min"))
