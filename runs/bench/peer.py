"""A yardstick beside our own timings: CloverLeaf_ref, run in the same minutes.

CloverLeaf is compiled Fortran: a staggered Lagrangian step and remap on a Cartesian grid at rest,
one ideal gas.  It moves no grid and rebuilds none; of the open codes of this kind it was the
fastest one found.  Its checkout has to be built (`make COMPILER=GNU`); this module only runs it.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from regrid.errors import BadInput
from runs.bench.child_time import read_child_time

CELLS, STEPS = 400, 87
DECK = """*clover
 state 1 density=0.2 energy=1.0
 state 2 density=1.0 energy=2.5 geometry=rectangle xmin=0.0 xmax=5.0 ymin=0.0 ymax=2.0
 x_cells={cells}
 y_cells={cells}
 xmin=0.0
 ymin=0.0
 xmax=10.0
 ymax=10.0
 initial_timestep=0.04
 timestep_rise=1.5
 max_timestep=0.04
 end_step={steps}
 test_problem 0
*endclover
"""


class Peer:
    """CloverLeaf_ref in the built checkout `path`; raises BadInput where there is none."""

    name = "CloverLeaf"

    def __init__(self, path: str):
        self.program = (Path(path) / "clover_leaf").resolve()
        if shutil.which(str(self.program)) is None:
            raise BadInput(
                f"--peer {path}: there is no program clover_leaf in it; build CloverLeaf_ref there "
                "first (make COMPILER=GNU)"
            )

    def measure(self) -> float:
        """Million cell updates a CPU second of one run on one core."""
        alone = {**os.environ, "OMP_NUM_THREADS": "1"}  # threads that wait count as CPU time
        with tempfile.TemporaryDirectory() as folder:
            text = DECK.format(cells=CELLS, steps=STEPS)
            (Path(folder) / "clover.in").write_text(text, encoding="ascii")
            before = read_child_time()
            done = subprocess.run(
                [str(self.program)], cwd=folder, env=alone, capture_output=True, text=True
            )
            after = read_child_time()
        if done.returncode:
            raise BadInput(f"{self.program} ended with {done.returncode}: {done.stderr[-200:]}")
        return CELLS * CELLS * STEPS / (after.user - before.user) / 1e6
