"""The cases by this code: the whole command, warm, as a user types it."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import shockgrid as sg
from benchmarks.race.compiled_peers import spend
from shockgrid.hydro.formulas.geometry import compute_volumes, find_geometry
from shockgrid.regrid.measure.corners import compute_centres

SLAB = """problem = "blocks"
run = {{ t_end = {t_end} }}
link = [
    {{ kind = "interface", sides = ["left.i_max", "slab.i_min"] }},
    {{ kind = "interface", sides = ["slab.i_max", "right.i_min"] }},
]
"""
BLOCK = """
[[block]]
name = "{name}"
cells = [{cells}, {rows}]
material = {{ eos = "ideal-gas", gamma = {gamma} }}
rho = {rho}
u = {u}
p = {p}
curves.i_min = [[{x0}, 0.0], [{x0}, {height}]]
curves.i_max = [[{x1}, 0.0], [{x1}, {height}]]
curves.j_min = [[{x0}, 0.0], [{x1}, 0.0]]
curves.j_max = [[{x0}, {height}], [{x1}, {height}]]
side = [{sides}]
"""
WALLS = '{ side = "j_min", kind = "wall" }, { side = "j_max", kind = "wall" }'
END = ', {{ side = "{side}", kind = "piston", velocity = [{u}, 0.0] }}'


def write_slab(numbers: dict[str, Any], cells: int) -> str:
    """A deck of three blocks: a slab between two layers as thick, all of which move."""
    deck = SLAB.format(t_end=numbers["t_end"])
    height = numbers["rows"] / cells
    for i, name in enumerate(("left", "slab", "right")):
        end = {"left": "i_min", "right": "i_max"}.get(name)
        sides = WALLS + (END.format(side=end, u=numbers["u"]) if end else "")
        deck += BLOCK.format(
            name=name, cells=cells, rows=numbers["rows"], gamma=numbers["gamma"], u=numbers["u"],
            rho=numbers["rho"][name == "slab"], p=numbers["p"], x0=float(i), x1=i + 1.0,
            height=height, sides=sides,
        )  # fmt: skip
    return deck


def run_ours(name: str, numbers: dict[str, Any], cells: int) -> tuple[dict, float]:
    """What was found, and the CPU seconds of the command."""
    with tempfile.TemporaryDirectory() as place:
        home = Path(place)
        settings = {"cells": cells}
        if name == "contact":
            (home / "slab.toml").write_text(write_slab(numbers, cells))
            deck = "slab.toml"
            settings = {}
        elif name.startswith("growth"):
            deck = "interface-instability"
            if name == "growth":
                settings["start"] = '"incident"'
        elif name == "mushroom":
            deck = "interface-instability-mushroom"
            settings |= {"second.gamma": numbers["gamma"], "kct_end": 15.5, "line.thickness": 0.01}
        else:
            deck = name.split("-")[0]
            settings["geometry"] = f'"{numbers["geometry"]}"'
        pairs = [f"--set={key}={value}" for key, value in settings.items()]
        command = [sys.executable, "-m", "shockgrid", "run", deck, *pairs, "-o", "out", "--quiet"]
        spent = spend(command, home)
        run = sg.open(home / "out")
        return (
            find_amplitude(name, run) if "times" in numbers else find_cells(numbers, run)
        ), spent


def find_amplitude(name: str, run: Any) -> dict[str, Any]:
    """The interface's amplitude over the time since the shock met the mean interface."""
    t = run.history.t - run.problem.arrival
    if name.startswith("growth"):
        return {"t": t, "amplitude": run.history.amplitude_mode_1}
    lines = [run.interface(dump.t) for dump in run.dumps]
    width = [0.5 * np.ptp(line.x) for line in lines]
    return {"t": [line.t - run.problem.arrival for line in lines], "amplitude": width}


def find_cells(numbers: dict[str, Any], run: Any) -> dict[str, Any]:
    """Centres, densities and volumes of all cells at the end."""
    found: dict[str, list] = {"x": [], "y": [], "rho": [], "volume": []}
    end = run.dumps[-1]
    geometry = "axisymmetric" if numbers.get("geometry") == "spherical" else "plane"
    for block in end.blocks:
        volume = compute_volumes(find_geometry(geometry), block.nodes)
        values = (*compute_centres(block.nodes), block.rho, volume)
        for key, value in zip(found, values, strict=True):
            found[key].append(np.ravel(value))
    cells = {key: np.concatenate(value) for key, value in found.items()}
    if "centre" in numbers:  # the slab is where it began, seen by what moves with it
        cells["x"] += numbers["centre"] - 1.5 - numbers["u"] * numbers["t_end"]
    return cells
