"""The mirrored flow is the mirror image of the flow."""

import numpy as np
import pytest

from builders import beside_line, wall_off
from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import IdealGas
from shockgrid.hydro.links import join
from shockgrid.hydro.simulation import Simulation
from shockgrid.hydro.sources import make_gravity

NI = 14
NJ = 12


def make_flow(flip_x=False, flip_y=False, mesh="regrid"):
    """A shock driven into a bent interface; the whole set-up turned over in x or y."""

    def front(y):
        return 0.04 * np.sin(np.pi * y) + 0.03 * np.cos(2.0 * np.pi * y)

    pair = beside_line(front, (NI, NJ), (-0.5, 0.5))
    grids = dict(zip(("light", "heavy"), pair, strict=True))
    sides = {"i_min": "i_min", "i_max": "i_max"}
    push = 0.6
    for name in grids:
        if flip_x:
            grids[name] = (grids[name] * np.array([-1.0, 1.0])[:, None, None])[:, ::-1]
        if flip_y:
            grids[name] = (grids[name] * np.array([1.0, -1.0])[:, None, None])[:, :, ::-1]
    if flip_x:
        sides = {"i_min": "i_max", "i_max": "i_min"}
        push = -push
    blocks = {}
    for name, gamma, rho in (("light", 1.4, 1.0), ("heavy", 1.2, 4.0)):
        blocks[name] = Block(name, IdealGas(gamma), grids[name], rho, 0.0, 0.0, 1.0)
    light = blocks["light"]
    heavy = blocks["heavy"]
    pair = (light, sides["i_max"]), (heavy, sides["i_min"])
    links = [join("interface", *(pair[::-1] if flip_x else pair))]
    if mesh == "regrid":
        put(light, sides["i_min"], "piston", velocity=(push, 0.0))
    else:
        put(light, sides["i_min"], "inflow", state=(1.8, push, 0.0, 2.4))
    put(heavy, sides["i_max"], "wall")
    for block in blocks.values():
        wall_off(block, "j_min", "j_max")
    return Simulation([light, heavy], links, t_end=0.8, mesh=mesh)


def compare(flip_x, flip_y, steps=40, **options):
    """Largest difference of states and nodes between a flow and its mirror image turned back."""
    plain = make_flow(**options)
    image = make_flow(flip_x, flip_y, **options)
    worst = 0.0
    for _ in range(steps):
        plain.advance()
        image.advance()
        assert image.t == pytest.approx(plain.t, rel=1e-12)
    for one, two in zip(plain.blocks, image.blocks, strict=True):
        state = two.state[:, 1:-1, 1:-1].copy()
        nodes = two.nodes.copy()
        if flip_x:
            state = state[:, ::-1]
            nodes = nodes[:, ::-1]
            state[1] *= -1.0
            nodes[0] *= -1.0
        if flip_y:
            state = state[:, :, ::-1]
            nodes = nodes[:, :, ::-1]
            state[2] *= -1.0
            nodes[1] *= -1.0
        worst = max(worst, np.abs(state - one.state[:, 1:-1, 1:-1]).max())
        worst = max(worst, np.abs(nodes - one.nodes).max())
    return worst


@pytest.mark.parametrize("flips", [(True, False), (False, True), (True, True)])
def test_mirror_image_on_regridded_blocks(flips):
    """To round-off: the regridder's sums over nodes run in one order."""
    assert compare(*flips) <= 1e-12


def make_overturn(cells, sides):
    """A whole wavelength of a heavy gas on a light one; its nodes are symmetric about x = ½."""
    x, up = np.meshgrid(*(np.linspace(0.0, 1.0, cells + 1),) * 2, indexing="ij")
    line = 0.02 * np.cos(2.0 * np.pi * x)
    blocks = []
    for name, low, high, rho in (("light", -1.0, line, 1.0), ("heavy", line, 1.0, 3.0)):
        nodes = np.array((x, low + (high - low) * up))
        nodes[0] += 1.0 - nodes[0, ::-1]
        nodes[1] += nodes[1, ::-1]
        nodes *= 0.5
        pressure = 10.0 - rho * nodes[1]
        blocks.append(Block(name, IdealGas(5.0 / 3.0), nodes, rho, 0.0, 0.0, mean(pressure)))
    light, heavy = blocks
    links = [join("interface", (light, "j_max"), (heavy, "j_min"))]
    wall_off(light, "j_min")
    wall_off(heavy, "j_max")
    for block in blocks:
        if sides == "periodic":
            links.append(join("periodic", (block, "i_min"), (block, "i_max")))
        else:
            wall_off(block, "i_min", "i_max")
    return Simulation(blocks, links, t_end=3.0, source=make_gravity(0.0, -1.0))


def mean(values):
    return 0.25 * (values[1:, 1:] + values[:-1, 1:] + values[1:, :-1] + values[:-1, :-1])


@pytest.mark.slow
@pytest.mark.parametrize(("cells", "sides"), [(24, "wall"), (24, "periodic"), (48, "wall")])
def test_an_overturning_wave_stays_its_own_mirror_image(cells, sides):
    """Solves, limits of node speeds and spacings by turning magnified what was not symmetric."""
    flow = make_overturn(cells, sides)
    while flow.t < flow.t_end:
        flow.advance()
    for block in flow.blocks:
        image = block.nodes[:, ::-1] * np.reshape((-1.0, 1.0), (2, 1, 1))
        image[0] += 1.0
        turned = block.state[:, ::-1] * np.reshape((1.0, -1.0, 1.0, 1.0), (4, 1, 1))
        assert np.abs(image - block.nodes).max() < 1e-10
        assert np.abs(turned - block.state)[:, 1:-1, 1:-1].max() < 1e-10
