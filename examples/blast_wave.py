"""A spherical blast from a hot core; a hook looks at the flow after every step."""

import numpy as np

import shockgrid as sg

CELLS = 60
angles = np.linspace(0.0, np.pi / 2.0, 17)
radii = np.linspace(0.05, 1.0, CELLS + 1)
# i outwards, j from the axis of symmetry to the plane x = 0
nodes = np.array([np.outer(radii, np.cos(angles)), np.outer(radii, np.sin(angles))])
nodes[1, :, 0] = 0.0
nodes[0, :, -1] = 0.0


def press(x, y):
    """Hot within a fifth of the radius."""
    return np.where(np.hypot(x, y) < 0.2, 100.0, 0.1)


gas = sg.Block("gas", sg.IdealGas(1.4), nodes, 1.0, 0.0, 0.0, press)
sg.put_walls(gas, curved=True)
blast = sg.Simulation([gas], [], t_end=0.06, mesh="fixed", geometry="axisymmetric")
fronts = []


def look(case):
    """How far out the pressure has risen tenfold, along the axis of symmetry."""
    block = case.blocks["gas"]
    fronts.append((case.t, block.centres[0, block.p[:, 0] > 1.0, 0].max()))


run = sg.run(blast, "out/blast-wave", hooks=look, force=True)
times, places = np.array(fronts).T
risen = (run.dumps[-1]["gas"].p > 1.0).sum(axis=0)
print(f"{len(fronts)} looks; the front is at {places[-1]:.3f}, even to {np.ptp(risen)} cells")
assert np.ptp(risen) <= 1
assert (np.diff(places) >= 0.0).all()
