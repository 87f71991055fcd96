"""Athena++ on a shocked interface: a built program with the problem generator `athena_start.cpp`.

Van Leer's predictor and corrector with piecewise linear reconstruction and HLLC at CFL 0.4 (of 0.5
that are stable in two dimensions), on three levels of adaptively refined blocks of 8 or 16 cells.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.race.compiled_peers import spend
from benchmarks.race.python_peers import find_domain, find_line, find_times, x_shock

LEVELS = 3
COARSE = 2 ** (LEVELS - 1)
DECK = """<job>
problem_id = race
<time>
cfl_number = 0.4
nlim = -1
tlim = {t_end!r}
integrator = vl2
xorder = 2
ncycle_out = 0
<mesh>
nx1 = {nx}
x1min = {x0!r}
x1max = {x1!r}
ix1_bc = outflow
ox1_bc = outflow
nx2 = {ny}
x2min = 0.0
x2max = 0.5
ix2_bc = reflecting
ox2_bc = reflecting
nx3 = 1
x3min = -0.5
x3max = 0.5
ix3_bc = periodic
ox3_bc = periodic
refinement = adaptive
numlevel = {levels}
derefine_count = 5
<meshblock>
nx1 = {block}
nx2 = {block}
nx3 = 1
<hydro>
gamma = {gamma!r}
<problem>
threshold = 0.05
a0 = {a0!r}
shock = {shock!r}
"""


def run_athena(
    program: Path, name: str, numbers: dict[str, Any], cells: int
) -> tuple[dict[str, Any], float]:
    """What was found, and the CPU seconds of the longest run: one a time of output."""
    (x0, x1, nx), (_, y1, ny) = find_domain(name, numbers, cells)
    deck = DECK + "".join(
        f"{key}{n} = {float(numbers[key][n])!r}\n"
        for key in ("left", "right", "heavy")
        for n in range(3)
    )
    amplitude = []
    spent = 0.0
    with tempfile.TemporaryDirectory() as folder:
        for t in find_times(numbers):
            words = deck.format(
                t_end=float(t), nx=nx // COARSE, ny=ny // COARSE, x0=x0, x1=x1, levels=LEVELS,
                block=min(16, ny // COARSE), gamma=numbers["gamma"], a0=numbers["a0"],
                shock=x_shock(numbers),
            )  # fmt: skip
            Path(folder, "athinput").write_text(words)
            spent = spend([str(program.resolve()), "-i", "athinput"], Path(folder))
            rho = np.empty((nx, ny))
            size = y1 / ny
            for x, y, width, value in np.fromfile(Path(folder, "end.bin")).reshape(-1, 4):
                n, i, j = (round(d / size) for d in (width, x - 0.5 * width - x0, y - 0.5 * width))
                rho[i : i + n, j : j + n] = value
            places = x0 + (np.arange(nx) + 0.5) * size, (np.arange(ny) + 0.5) * size
            amplitude.append(find_line(name, numbers, rho, *places))
    return {"t": numbers["times"], "amplitude": amplitude}, spent
