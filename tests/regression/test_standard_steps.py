"""The first steps of every standard problem against stored norms.

Few steps at a coarse size: the time reached and the root mean squares of density, velocity,
pressure and node coordinates over all blocks, one line a problem.  `pytest
tests/regression/test_standard_steps.py --update-baselines` writes the file anew; review the
difference before committing it.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from builders import march
from shockgrid.problems.registry import PROBLEMS
from shockgrid.runs.deck.reading import read_deck

PATH = Path(__file__).parent / "baselines" / "standard_problems.json"
TOLERANCE = 1e-9  # of sums that processors may order differently
STEPS = 12
COLUMNS = ("t", "rho", "u", "v", "p", "nodes")
CASES = {
    "vortex": ("cells=12",),
    "free-stream": ("cells=8",),
    "riemann": ("cells=40",),
    "saltzmann": ("cells=20", "rows=4"),
    "flyer-target": ("plates.0.cells=6", "plates.1.cells=8", "plates.1.gap=2e-5"),
    "elastic-piston": ("cells=20",),
    "flying-plate": ("flyer_cells=6",),
    "taylor-bar": ("cells=3",),
    "shell": ("cells=6", "rays=6"),
    "rippled-surface": ("cells=6",),
    "elastic-waves": ("cells=8",),
    "cavity": ("cells=16",),
    "kidder": ("cells=8", "rays=12"),
    "noh": ("cells=16",),
    "noh-plane": ("cells=16",),
    "noh-spherical": ("cells=16",),
    "sedov": ("cells=16",),
    "sedov-plane": ("cells=16",),
    "sedov-spherical": ("cells=16",),
    "gresho": ("cells=16",),
    "taylor-green": ("cells=12",),
    "rayleigh-taylor": ("cells=12",),
    "rayleigh-taylor-standing-wave": ("cells=12",),
    "oblique-shock": ("cells=24",),
    "triple-point": ("cells=6",),
    "shock-bubble": ("cells=5",),
    "shock-bubble-r22": ("cells=5",),
    "detonation": ("cells=40",),
    "blocks": ("block.0.cells=[28, 8]",),
    "plate-on-wedge": ("cells=[24, 4]", "thickness=2e-3"),
    "plate-on-wedge-polar": ("cells=[24, 6]",),
    "conical-target": ("cells=16",),
    "conical-target-rippled": ("cells=24", "ripple_wavelength=5e-3"),
}


def measure_steps(name: str) -> list[float]:
    evolution = read_deck(name, CASES[name]).make_problem().build()
    march(evolution, STEPS)
    state = [block.state[:, 1:-1, 1:-1].reshape(4, -1) for block in evolution.blocks]
    nodes = np.concatenate([block.nodes.ravel() for block in evolution.blocks])
    rows = [*np.concatenate(state, axis=1), nodes]
    return [float(evolution.t), *(float(np.sqrt(np.mean(row * row))) for row in rows)]


@pytest.mark.parametrize("name", CASES)
def test_first_steps_follow_the_baseline(name, update_baselines):
    found = measure_steps(name)
    stored = json.loads(PATH.read_text(encoding="utf-8")) if PATH.exists() else {}
    if update_baselines:
        stored[name] = [float(f"{value:.11e}") for value in found]
        kept = {case: stored[case] for case in CASES if case in stored}
        lines = ",\n".join(f"{json.dumps(case)}: {json.dumps(row)}" for case, row in kept.items())
        PATH.write_text("{\n" + lines + "\n}\n", encoding="utf-8")
        return
    assert name in stored, "not in the baseline: --update-baselines writes it"
    most = max(stored[name][2:4])
    for column, value, old in zip(COLUMNS, found, stored[name], strict=True):
        size = most if column in "uv" else abs(old)
        assert abs(value - old) <= TOLERANCE * size, f"{column}: {value:.12g}, stored {old:.12g}"


def test_every_standard_problem_is_pinned():
    others = {
        "convection-1d", "moving-grid-1d", "heated-cavity", "rayleigh-benard", "grid-march",
        "interface-instability",
    }  # fmt: skip
    assert set(PROBLEMS) - set(CASES) <= others
