"""A shock tube whose contact is a grid line, made by a script, against the exact solution."""

import numpy as np

import shockgrid as sg

CELLS = 100
PRESSURES = 1.0, 0.1
DENSITIES = 1.0, 0.125
# of the exact solution of Sod's problem, gamma = 1.4
STAR_PRESSURE = 0.303130
STAR_VELOCITY = 0.927453


def make_side(name, low, high, density, pressure):
    """Gas at rest between two places."""
    nodes = sg.make_plane_grid(np.linspace(low, high, CELLS + 1), np.linspace(0.0, 0.04, 5))
    return sg.Block(name, sg.IdealGas(1.4), nodes, density, 0.0, 0.0, pressure)


left = make_side("left", -0.5, 0.0, DENSITIES[0], PRESSURES[0])
right = make_side("right", 0.0, 0.5, DENSITIES[1], PRESSURES[1])
contact = sg.join("interface", (left, "i_max"), (right, "i_min"))
sg.put_walls(left, right)

tube = sg.Simulation([left, right], [contact], t_end=0.2)
run = sg.run(tube, "out/tube", force=True)
last = run.dumps[-1]
pressure = last["right"].p[0].mean()
place = last["right"].nodes[0, 0].mean()
print(f"pressure at the contact {pressure:.5f}, exact {STAR_PRESSURE}")
print(f"the contact has moved by {place:.5f}, exact {0.2 * STAR_VELOCITY:.5f}")
assert abs(pressure / STAR_PRESSURE - 1.0) < 2e-3
assert abs(place / (0.2 * STAR_VELOCITY) - 1.0) < 2e-3
