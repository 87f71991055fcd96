"""AMRClaw on a shocked interface; run by an interpreter that has `clawpack`.

    amr_peer.py PROGRAM growth|mushroom CELLS < numbers.json

Prints one JSON line: `t`, `amplitude` and `cpu`, the CPU seconds of the program.  The method is
PyClaw's in `python_peers.py`.  There are three levels, finer by 4 each (the second by 2 where the
coarsest would have less than 16 cells a wavelength); cells are refined where neighbours differ by
more than 0.05, AMRClaw's own default.  CELLS a wavelength are those of the finest level.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from python_peers import find_domain, find_line, find_times, x_shock

COARSEST = 16  # cells a wavelength


def write_input(name: str, numbers: dict, cells: int, ratios: list[int]) -> tuple[float, int, int]:
    """Write AMRClaw's input files here; the left end, and cells both ways if all were finest."""
    from clawpack.clawutil.data import ClawRunData

    whole = int(np.prod(ratios))
    (x0, _, nx), (y0, y1, ny) = find_domain(name, numbers, cells)
    nx = -(-nx // whole)
    data = ClawRunData("amrclaw", 2)
    own = data.new_UserData(name="probdata", fname="setprob.data")
    own.add_param("gamma", numbers["gamma"])
    own.add_param("shock", x_shock(numbers))
    own.add_param("a0", numbers["a0"])
    for key in ("left", "right", "heavy"):
        own.add_param(key, list(numbers[key]))
    claw = data.clawdata
    amr = data.amrdata
    claw.lower, claw.upper = [x0, y0], [x0 + nx * whole / cells, y1]
    claw.num_cells = [nx, ny // whole]
    claw.num_eqn = 4
    claw.num_aux = 0
    claw.num_waves = 4
    claw.num_ghost = 2
    claw.output_style = 2
    claw.output_times = find_times(numbers).tolist()
    claw.output_format = "ascii"
    claw.output_q_components = "all"
    claw.output_aux_components = "none"
    claw.verbosity = 0
    claw.dt_variable = True
    claw.dt_initial = 0.01 * whole / cells
    claw.steps_max = 10**7
    claw.cfl_desired = 0.9
    claw.cfl_max = 1.0
    claw.order = 2
    claw.dimensional_split = "unsplit"
    claw.transverse_waves = 2
    claw.limiter = ["mc"] * 4
    claw.bc_lower, claw.bc_upper = ["extrap", "wall"], ["extrap", "wall"]
    amr.amr_levels_max = len(ratios) + 1
    amr.refinement_ratios_x = amr.refinement_ratios_y = amr.refinement_ratios_t = ratios
    amr.aux_type = []
    amr.flag_richardson = False
    amr.flag2refine = True
    amr.flag2refine_tol = 0.05
    amr.regrid_interval = 2
    amr.regrid_buffer_width = 3
    amr.clustering_cutoff = 0.7
    amr.verbosity_regrid = 0
    data.write()
    return x0, nx * whole, ny


def read_density(path: Path, x0: float, cells: int, shape: tuple[int, int]) -> np.ndarray:
    """Density of all levels on the cells of the finest, finer ones over coarser ones."""
    rho = np.full(shape, np.nan)
    grids = []
    lines = iter(path.read_text().splitlines())
    for first in lines:
        if "grid_number" not in first:
            continue
        level, mx, my, x, y, dx, _ = (float(next(lines).split()[0]) for _ in range(7))
        values: list[float] = []
        while len(values) < mx * my:
            words = next(lines).split()
            values += [float(words[0])] if words else []
        grids.append((level, x, y, dx, np.reshape(values, (int(my), int(mx))).T))
    for _, x, y, dx, values in sorted(grids, key=lambda grid: grid[0]):
        times = round(dx * cells)
        i = round((x - x0) * cells)
        j = round(y * cells)
        fine = values.repeat(times, axis=0).repeat(times, axis=1)
        rho[i : i + fine.shape[0], j : j + fine.shape[1]] = fine
    return rho


def main() -> None:
    """Write, run, read, print."""
    program = Path(sys.argv[1]).resolve()
    name = sys.argv[2]
    cells = int(sys.argv[3])
    numbers = json.load(sys.stdin)
    ratios = [max(2, min(4, cells // (4 * COARSEST))), 4] if cells > 2 * COARSEST else [2]
    os.environ.setdefault("CLAW", str(program.parent))
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        x0, nx, ny = write_input(name, numbers, cells, ratios)
        before = sum(os.times()[2:4])
        subprocess.run([program], check=True, capture_output=True)
        cpu = sum(os.times()[2:4]) - before
        x, y = x0 + (np.arange(nx) + 0.5) / cells, (np.arange(ny) + 0.5) / cells
        frames = sorted(Path(folder).glob("fort.q*"))[-len(numbers["times"]) :]
        rho = [read_density(path, x0, cells, (nx, ny)) for path in frames]
        os.chdir("/")
    amplitude = [float(find_line(name, numbers, r, x, y)) for r in rho]
    print(json.dumps({"t": numbers["times"], "amplitude": amplitude, "cpu": cpu}))


if __name__ == "__main__":
    main()
