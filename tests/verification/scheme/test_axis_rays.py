"""Free surfaces and contacts that meet the axis: Kidder's sphere stays round there."""

import numpy as np
import pytest

from builders import march
from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import IdealGas
from shockgrid.hydro.links import join
from shockgrid.hydro.simulation import Simulation
from shockgrid.problems.standard.kidder import END, RADII
from shockgrid.runs.deck.reading import read_deck

EARLY = 0.17  # of the time of the end
AXIS_RAYS = 3


def make_problem(cells, part):
    problem = read_deck("kidder", ("n=3", f"cells={cells}", f"rays={3 * cells}")).make_problem()
    problem.t_end = part * END * problem.shell.tau
    return problem


def make_cut_shell(problem, part=0.5):
    """The same shell in two blocks, with a contact between two layers."""
    shell = problem.shell
    nodes = problem.make_grids()["shell"]
    rho = shell.compute_density(problem.compute_layers(nodes), 0.0)
    cut = round(part * rho.shape[0])
    blocks = []
    for name, rows in (("inner", slice(0, cut)), ("outer", slice(cut, None))):
        own = nodes[:, rows.start : None if rows.stop is None else cut + 1]
        blocks.append(
            Block(name, IdealGas(shell.gamma), own, rho[rows], 0, 0,
                  shell.entropy * rho[rows] ** shell.gamma)
        )  # fmt: skip
    inner, outer = blocks
    link = join("interface", (inner, "i_max"), (outer, "i_min"))
    put(inner, "i_min", "free-surface", pressure=lambda t: shell.compute_pressures(t)[0])
    put(outer, "i_max", "free-surface", pressure=lambda t: shell.compute_pressures(t)[1])
    for block in blocks:
        put(block, "j_min", "axis")
        put(block, "j_max", "wall")
    return Simulation(blocks, [link], t_end=problem.t_end, cfl=0.6, geometry="axisymmetric")


def measure_axis_rays(lines, exact):
    """Largest deviation of the nodes at the axis from the middle of their line, of all lines."""
    worst = 0.0
    for line, radius in zip(lines, exact, strict=True):
        parts = np.hypot(*line) / radius
        middle = parts[parts.size // 3 : 2 * parts.size // 3].mean()
        worst = max(worst, float(np.abs(parts[:AXIS_RAYS] - middle).max()))
    return worst


def measure_shell(cells, cut=False):
    """Deviation of the axis' rays and the error of the shell itself, its outer surface's."""
    problem = make_problem(cells, EARLY)
    simulation = make_cut_shell(problem) if cut else problem.build()
    march(simulation)
    h = problem.shell.compute_shrinking(simulation.t)
    blocks = simulation.blocks
    lines = [block.nodes[:, edge] for block in blocks for edge in (0, -1)]
    exact = [*RADII] if not cut else [RADII[0], np.mean(RADII), np.mean(RADII), RADII[1]]
    outer = np.hypot(*lines[-1])
    return measure_axis_rays(lines, exact), abs(float(outer.mean()) / (h * RADII[1]) - 1.0)


@pytest.mark.parametrize("cut", [False, True], ids=["surfaces", "surfaces and a contact"])
def test_rays_at_the_axis_go_as_the_others(cut):
    """No farther off than a tenth of the shell's own error, and falling with second order."""
    (coarse, _), (middle, own), (fine, _) = (measure_shell(cells, cut) for cells in (10, 20, 40))
    assert middle < 0.1 * own
    assert own < 5e-5
    assert 0.5 * np.log2(coarse / fine) > 1.9
