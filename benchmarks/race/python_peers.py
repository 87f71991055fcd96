"""PyClaw and pyro on one case; run by an interpreter that has them, apart from this repository.

    python_peers.py pyclaw|pyro growth|mushroom|contact|sedov-cylinder CELLS < numbers.json

Prints one JSON line: `t` and `amplitude` of an interface, or `x`, `y`, `rho`, `volume` of the cells
at the end.  PyClaw: wave propagation with Roe's solver, entropy fix, transverse waves and the
monotonised-central limiter at CFL 0.9 of 1; on the finest grid of Sedov's blast minmod, because the
other ends in NaNs there.  pyro: unsplit corner transport upwind with HLLC and its fourth-order
limiter at CFL 0.8.  Both are these codes' own choices for shocks.
"""

from __future__ import annotations

import json
import sys

import numpy as np

LENGTHS = (2.0, 2.0)  # of the domain on both sides of the interface; waves leave through its ends
SAMPLES = 16  # of a cell's height, where the interface cuts it


def find_volume_factor(x_face: np.ndarray, y_face: np.ndarray, a0: float) -> np.ndarray:
    """Share of each cell beyond the line x = a0 cos(2 pi y), shape (nx, ny)."""
    within = (np.arange(SAMPLES) + 0.5) / SAMPLES
    y = y_face[:-1, None] + np.diff(y_face)[:, None] * within
    line = a0 * np.cos(2.0 * np.pi * y)
    dx = np.diff(x_face)[:, None, None]
    return np.clip((x_face[1:, None, None] - line) / dx, 0.0, 1.0).mean(axis=-1)


def start(name: str, numbers: dict, x_face: np.ndarray, y_face: np.ndarray) -> np.ndarray:
    """rho, u, v, p as averages over cells, shape (4, nx, ny)."""
    x, y = (0.5 * (f[1:] + f[:-1]) for f in (x_face, y_face))
    x, y = np.meshgrid(x, y, indexing="ij")
    if name in ("growth", "mushroom"):
        # the front stands before the crest, and t = 0 is when it meets the mean interface
        shock = x_shock(numbers)
        left, right, heavy = (np.array(numbers[key]) for key in ("left", "right", "heavy"))
        share = find_volume_factor(x_face, y_face, numbers["a0"])
        state = right[:, None, None] + (heavy - right)[:, None, None] * share
        state = np.where(x < shock, left[:, None, None], state)
        rho, u, p = state
        return np.array((rho, u, 0.0 * u, p))
    if name == "contact":
        inside = np.abs(x - numbers["centre"]) < 0.5 * numbers["width"]
        rho = np.where(inside, numbers["rho"][1], numbers["rho"][0])
        return np.array((rho, 0 * x + numbers["u"], 0 * x, 0 * x + numbers["p"]))
    p = 0 * x + numbers["p"]
    cell = np.diff(x_face)[0] * np.diff(y_face)[0]
    p[0, 0] += (numbers["gamma"] - 1.0) * numbers["energy"] / cell
    return np.array((0 * x + 1.0, 0 * x, 0 * x, p))


def x_shock(numbers: dict) -> float:
    """Where the front stands at the start: a tenth of a wavelength before the crest."""
    return -numbers["a0"] - 0.1


def find_domain(name: str, numbers: dict, cells: int) -> tuple:
    """(x0, x1, nx), (y0, y1, ny)."""
    if name in ("growth", "mushroom"):
        drift = numbers["interface"]  # the interface stands still only after the shock
        wait = -x_shock(numbers) / numbers["front"]
        ahead = drift * wait
        return (
            (-LENGTHS[0] - ahead, LENGTHS[1] - ahead, round(sum(LENGTHS) * cells)),
            (0.0, 0.5, cells // 2),
        )
    if name == "contact":
        rows = numbers["rows"]
        length = numbers["length"]
        return (0.0, length, round(length * cells)), (0.0, rows / cells, rows)
    return (0.0, numbers["size"], cells), (0.0, numbers["size"], cells)


def find_line(name: str, numbers: dict, rho: np.ndarray, x: np.ndarray, y: np.ndarray) -> float:
    """Amplitude of the interface: its first harmonic, of a steep one half its width."""
    last = np.array([find_crossing(row, x, numbers["shocked"], -1) for row in rho.T])
    if name == "growth":
        return 2.0 * np.mean(last * np.cos(2.0 * np.pi * y))
    first = [find_crossing(row, x, numbers["shocked"], 0) for row in rho.T]
    return 0.5 * (last.max() - np.min(first))


def find_crossing(row: np.ndarray, x: np.ndarray, sides: tuple, which: int) -> float:
    """Where a row's density crosses the mean of both sides' upwards, the first or the last time.

    Between two cells a captured contact is like a hyperbolic tangent: its inverse is interpolated.
    A straight line between them is off by a part of a cell that changes with the place in the cell.
    """
    share = np.clip((row - sides[0]) / (sides[1] - sides[0]), 1e-4, 1.0 - 1e-4)
    place = np.arctanh(2.0 * share - 1.0)
    near = np.flatnonzero((place[:-1] < 0.0) & (place[1:] >= 0.0))
    if near.size == 0:
        return float("nan")
    i = near[which]
    return x[i] - place[i] / (place[i + 1] - place[i]) * (x[1] - x[0])


def find_times(numbers: dict) -> np.ndarray:
    """Times of output; an interface's count from the shock's meeting the mean interface."""
    if "times" not in numbers:
        return np.array([numbers["t_end"]])
    wait = -x_shock(numbers) / numbers["front"]
    return wait + np.array(numbers["times"])


def run_pyclaw(name: str, numbers: dict, cells: int) -> dict:
    from clawpack import pyclaw, riemann

    gamma = numbers["gamma"]
    (x0, x1, nx), (y0, y1, ny) = find_domain(name, numbers, cells)
    strong = name == "sedov-cylinder"  # Roe's states turn negative there
    solver = pyclaw.ClawSolver2D(riemann.euler_hlle_2D if strong else riemann.euler_4wave_2D)
    limiters = pyclaw.limiters.tvd
    solver.limiters = limiters.minmod if strong and cells > 200 else limiters.MC
    solver.order = 2
    solver.transverse_waves = 2
    solver.dimensional_split = False
    solver.cfl_desired = 0.9
    solver.cfl_max = 1.0
    solver.max_steps = 10**7
    if strong:  # this solver has no transverse part
        solver.transverse_waves = 0
        solver.dimensional_split = True
    wall = pyclaw.BC.wall
    open_ = pyclaw.BC.extrap
    periodic = pyclaw.BC.periodic
    lower, upper = {
        "growth": ((open_, wall), (open_, wall)),
        "mushroom": ((open_, wall), (open_, wall)),
        "contact": ((periodic, periodic), (periodic, periodic)),
        "sedov-cylinder": ((wall, wall), (open_, open_)),
    }[name]
    solver.bc_lower[0], solver.bc_lower[1] = lower
    solver.bc_upper[0], solver.bc_upper[1] = upper
    domain = pyclaw.Domain(
        [pyclaw.Dimension(x0, x1, nx, name="x"), pyclaw.Dimension(y0, y1, ny, name="y")]
    )
    state = pyclaw.State(domain, 4)
    state.problem_data.update(gamma=gamma, gamma1=gamma - 1.0)
    x_face, y_face = np.linspace(x0, x1, nx + 1), np.linspace(y0, y1, ny + 1)
    rho, u, v, p = start(name, numbers, x_face, y_face)
    state.q[...] = (rho, rho * u, rho * v, p / (gamma - 1.0) + 0.5 * rho * (u**2 + v**2))
    solution = pyclaw.Solution(state, domain)
    solver.dt_initial = 0.1 * min((x1 - x0) / nx, 1.0) / 10.0
    solver.setup(solution)
    x, y = (0.5 * (f[1:] + f[:-1]) for f in (x_face, y_face))
    amplitude = []
    times = find_times(numbers)
    for t in times:
        solver.evolve_to_time(solution, t)
        if "times" in numbers:
            amplitude.append(find_line(name, numbers, solution.q[0], x, y))
    return finish(numbers, amplitude, solution.q[0], x, y)


def run_pyro(name: str, numbers: dict, cells: int) -> dict:
    from pyro import Pyro

    gamma = numbers["gamma"]
    (x0, x1, nx), (y0, y1, ny) = find_domain(name, numbers, cells)
    sides = {
        "growth": ("outflow", "outflow", "reflect", "reflect"),
        "mushroom": ("outflow", "outflow", "reflect", "reflect"),
        "contact": ("periodic", "periodic", "periodic", "periodic"),
        "sedov-cylinder": ("reflect", "outflow", "reflect", "outflow"),
    }[name]
    x_face, y_face = np.linspace(x0, x1, nx + 1), np.linspace(y0, y1, ny + 1)

    def fill(data, _parameters):
        ghosts = data.grid.ng
        inside = np.s_[ghosts : ghosts + nx, ghosts : ghosts + ny]
        rho, u, v, p = start(name, numbers, x_face, y_face)
        values = (rho, rho * u, rho * v, p / (gamma - 1.0) + 0.5 * rho * (u**2 + v**2))
        for key, value in zip(
            ("density", "x-momentum", "y-momentum", "energy"), values, strict=True
        ):
            data.get_var(key)[inside] = value

    code = Pyro("compressible")
    code.add_problem("race", fill)
    keys = ("mesh.xlboundary", "mesh.xrboundary", "mesh.ylboundary", "mesh.yrboundary")
    times = find_times(numbers)
    code.initialize_problem(
        "race",
        inputs_dict={
            "mesh.nx": nx, "mesh.ny": ny, "mesh.xmin": x0, "mesh.xmax": x1,
            "mesh.ymin": y0, "mesh.ymax": y1,
            "eos.gamma": gamma, "driver.tmax": float(times[-1]), "driver.max_steps": 10**7,
            **dict(zip(keys, sides, strict=True)),
        },
    )  # fmt: skip
    x, y = (0.5 * (f[1:] + f[:-1]) for f in (x_face, y_face))
    ghosts = code.sim.cc_data.grid.ng
    inside = np.s_[ghosts : ghosts + nx, ghosts : ghosts + ny]
    seen = []
    amplitude = []
    while not code.sim.finished():
        code.single_step()
        if "times" in numbers and len(seen) < len(times):
            seen.append(code.sim.cc_data.t)
            rho = np.array(code.sim.cc_data.get_var("density"))[inside]
            amplitude.append(find_line(name, numbers, rho, x, y))
            if seen[-1] < times[len(seen) - 1]:  # not yet at the next time of output
                before = seen.pop(), amplitude.pop()
            else:  # between the step before and this one
                share = (times[len(seen) - 1] - before[0]) / (seen[-1] - before[0])
                amplitude[-1] = before[1] + share * (amplitude[-1] - before[1])
                seen[-1] = times[len(seen) - 1]
    rho = np.array(code.sim.cc_data.get_var("density"))[inside]
    return finish(numbers, amplitude, rho, x, y)


def finish(numbers: dict, amplitude: list, rho, x, y) -> dict:
    """What is printed: the interface's amplitude over time, or the cells at the end."""
    if "times" in numbers:
        return {"t": numbers["times"], "amplitude": amplitude}
    x, y = np.meshgrid(x, y, indexing="ij")
    cell = np.full(x.size, (x[1, 0] - x[0, 0]) * (y[0, 1] - y[0, 0]))
    names = ("x", "y", "rho", "volume")
    return {k: np.ravel(v).tolist() for k, v in zip(names, (x, y, rho, cell), strict=True)}


if __name__ == "__main__":
    code = sys.argv[1]
    name = sys.argv[2]
    cells = int(sys.argv[3])
    run = {"pyclaw": run_pyclaw, "pyro": run_pyro}[code]
    print(json.dumps(run(name, json.load(sys.stdin), cells)))
