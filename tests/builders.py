"""What tests of all packages build and march: grids, walls, two blocks, budgets, histories."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos.materials import find_material
from shockgrid.hydro.links import join

ROOT = next(p for p in Path(__file__).resolve().parents if (p / "pyproject.toml").is_file())
INSIDE = ("regrid", "hydro", "problems", "runs")  # folders that are installed inside `shockgrid`
SIDES = ("i_min", "i_max", "j_min", "j_max")


def name_module(path: Path) -> str:
    """The name by which a file of the packages is imported."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    parts = ("shockgrid", *parts) if parts[0] in INSIDE else parts
    return ".".join(parts).removesuffix(".__init__")


def tensor(*lines) -> np.ndarray:
    """Nodes of the grid whose coordinates are the given lines, component first."""
    return np.array(np.meshgrid(*lines, indexing="ij"))


def make_tensor_grid(n1, n2=None) -> np.ndarray:
    """The exact grid that equidistributes w = (1 + 10x)(1 + 5y) on the unit square."""
    counts = n1, n1 if n2 is None else n2
    return tensor(
        *(
            (np.sqrt(1.0 + c * (c + 2.0) * np.linspace(0.0, 1.0, n + 1)) - 1.0) / c
            for c, n in zip((10.0, 5.0), counts, strict=True)
        )
    )


def box(low, high, cells, angle=0.0) -> np.ndarray:
    """Nodes of evenly spaced `cells` between two corners; in the plane turned about the origin."""
    nodes = tensor(*(np.linspace(a, b, n + 1) for a, b, n in zip(low, high, cells, strict=True)))
    if not angle:
        return nodes
    x, y = nodes
    cosine = math.cos(angle)
    sine = math.sin(angle)
    return np.array([cosine * x - sine * y, sine * x + cosine * y])


def unit_steps(ni, nj) -> np.ndarray:
    """Nodes of ni times nj squares of side 1."""
    return box((0.0, 0.0), (ni, nj), (ni, nj))


def beside_line(front, cells, ends=(0.0, 1.0)) -> tuple[np.ndarray, np.ndarray]:
    """Grids from x = -1 to the line x = front(y) and from there to x = 1; y between `ends`."""
    ni, nj = cells
    y = np.linspace(*ends, nj + 1)
    x = front(y)
    part = np.linspace(0.0, 1.0, ni + 1)[:, None]
    rows = np.broadcast_to(y, (ni + 1, nj + 1))
    return np.array([-1.0 + (x + 1.0) * part, rows]), np.array([x + (1.0 - x) * part, rows])


def make_body(name, substance, nodes, u=0.0, v=0.0, p=0.0, **options) -> Block:
    """A block of a material of the library, with its density at rest."""
    found = find_material(substance)
    return Block(name, found.eos, nodes, found.rho0, u, v, p, **options)


def wall_off(block, *sides, kind="wall", **options) -> None:
    """Walls on the sides; without any named, on all those that have no segment yet."""
    taken = {segment.side for segment in block.segments}
    for side in sides or [side for side in SIDES if side not in taken]:
        put(block, side, kind, **options)


def free(block, *sides, **options) -> None:
    """Free surfaces where `wall_off` has walls."""
    wall_off(block, *sides, kind="free-surface", **options)


def two_blocks(front, cells, gases, states, kind="interface", ends=(0.0, 1.0)):
    """Blocks left and right of a line x = front(y), without other segments, and their link."""
    names = "left", "right"
    materials = ("gas", "gas") if kind == "seam" else names
    parts = zip(names, gases, beside_line(front, cells, ends), states, materials, strict=True)
    left, right = blocks = [Block(n, eos, grid, *at, material=m) for n, eos, grid, at, m in parts]
    return blocks, [join(kind, (left, "i_max"), (right, "i_min"))]


def march(evolution, steps=None) -> list[dict]:
    """Advance by `steps`, or to the end; the row of each step."""
    rows = []
    while len(rows) != steps and not (steps is None and evolution.finished):
        rows.append(evolution.advance())
    return rows


def march_whole(evolution, until=lambda rows: False) -> list[dict]:
    """March to the end or until something is so of the rows: the start and each step's."""
    rows = [evolution.start_row() | {"t": evolution.t}]
    while not evolution.finished and not until(rows):
        rows.append(evolution.advance())
    return rows


def get_bits(state) -> dict:
    """What a simulation, or the state of one, holds: to be compared with another's."""
    state = state if isinstance(state, dict) else state.get_state()
    return {name: np.asarray(value).tobytes() for name, value in state.items()}


def check_restarts(make, places, columns=("t", "total_energy"), steps=3) -> None:
    """Simulations that take up the states at `places` have the bits of the one that had them.

    places: numbers of steps, or a function that finds them from rows and states of a whole march.
    """
    whole = make()
    rows = []
    states = []
    last = None if callable(places) else max(places) + steps
    while not whole.finished and len(rows) != last:
        rows.append(whole.advance())
        states.append(whole.get_state())
    for at in places(rows, states) if callable(places) else [step - 1 for step in places]:
        again = make()
        again.set_state(states[at])
        for row, state in zip(rows[at + 1 :][:steps], states[at + 1 :], strict=False):
            found = again.advance()
            assert [found[name] for name in columns] == [row[name] for name in columns], at
            assert get_bits(again) == get_bits(state), at


def march_measured(problem, evolution, steps=None) -> dict[str, np.ndarray]:
    """March and measure after each step; columns from the start on, nan where one is not known."""
    rows = [evolution.start_row() | {"t": 0.0} | problem.measure(evolution)]
    while not evolution.finished and len(rows) - 1 != steps:
        rows.append(evolution.advance() | problem.measure(evolution))
    return collect_columns(rows)


def collect_columns(rows) -> dict[str, np.ndarray]:
    """Columns of numbers of history rows, those that the last row has."""
    names = [name for name, value in rows[-1].items() if not isinstance(value, str)]
    return {name: np.array([row.get(name, np.nan) for row in rows], float) for name in names}


def measure_growth(problem, history, first=6.0, last=30.0) -> float:
    """Mean (da/dt)/(k a0) of a shocked interface's first mode over first < k c t < last."""
    from shockgrid.problems.interface_instability.theories import Growth

    known = np.isfinite(history["amplitude"]) & np.isfinite(history["t"])
    mode = problem.harmonics[0]
    columns = {name: np.asarray(history[name])[known] for name in ("t", mode.column)}
    return Growth(problem.shocked).measure_rate(columns, mode, first, last)


def find_unexplained(history, name) -> float:
    """By how much a total left what came through the boundary, largest of all rows, absolute."""
    columns = history if isinstance(history, dict) else collect_columns(history)
    total = columns[f"total_{name}"]
    came = columns[f"boundary_{name}"].copy()
    came[:1] = np.nan_to_num(came[:1])
    return float(np.abs(total - came - total[0]).max())


def check_budget(history, names=("momentum_x", "energy"), limit=1e-12) -> None:
    """Masses and the named totals changed by what came through the boundary, to `limit` of them."""
    columns = history if isinstance(history, dict) else collect_columns(history)
    masses = [name.removeprefix("total_") for name in columns if name.startswith("total_mass_")]
    for name in (*masses, *names):
        size = np.abs(columns[f"total_{name}"]).max()
        assert find_unexplained(columns, name) <= limit * size, name
