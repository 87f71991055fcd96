"""The regridder alone: a square whose upper side bends up and down, every cell convex."""

import numpy as np

import shockgrid as sg

cells = 24
line = np.linspace(0.0, 1.0, cells + 1)
nodes = sg.make_plane_grid(line, line)
regridder = sg.BarrierRegridder()
worst = 1.0
for step in range(60):
    height = 0.45 * np.sin(2.0 * np.pi * step / 60.0)
    boundary = nodes.copy()
    boundary[1, :, -1] = 1.0 + height * np.cos(2.0 * np.pi * line)
    # nodes on the left and on the right stay evenly spaced
    for side in (0, -1):
        boundary[1, side] = np.linspace(0.0, boundary[1, side, -1], cells + 1)
    result = regridder.regrid(nodes, boundary)
    nodes = result.nodes
    # the sines of the angles at the corners of all cells
    along = np.diff(nodes, axis=1)
    across = np.diff(nodes, axis=2)
    area = along[0, :, :-1] * across[1, :-1] - along[1, :, :-1] * across[0, :-1]
    sine = area / (np.hypot(*along[:, :, :-1]) * np.hypot(*across[:, :-1]))
    worst = min(worst, sine.min())
print(f"60 grids, the smallest sine of a corner is {worst:.3f}")
assert worst > 0.1
