"""Supersonic flow onto a wedge: angle and pressure of the oblique shock against theory.

Gas comes in from the left at Mach `mach` along a wall that rises by `angle` from x = 0 on; the grid
follows the wall.  The flow becomes steady with a straight shock from the corner, whose angle beta
is the weak solution of tan(angle) = 2 cot(beta) (M² sin² beta - 1)/(M² (g + cos 2 beta) + 2).
Measured are the pressure on the wall and the angle of the line where the pressure is half way up.

The trap: above the largest angle of attached shocks there is no such solution; the deck is refused.
Source of the relation: any text on gas dynamics, e.g. NACA report 1135 (1953), equation 148.
"""

from __future__ import annotations

import functools
import math
from typing import Annotated, ClassVar

import msgspec
import numpy as np
from msgspec import Meta

from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos import IdealGas
from hydro.simulation import Simulation
from problems.deck import MOST_CELLS, Deck, Limiter, RunControl
from problems.field_panel import draw_field
from problems.problem import Problem
from regrid.errors import BadInput
from regrid.measure.corners import compute_centres

LENGTH, BEFORE, HEIGHT = 1.0, 0.25, 1.0


def compute_deflection(mach: float, beta: float, gamma: float) -> float:
    """Deflection [rad] behind a shock at the angle `beta` [rad] to a flow at Mach `mach`."""
    across = (mach * math.sin(beta)) ** 2
    rise = 2.0 * (across - 1.0) / math.tan(beta)
    return math.atan(rise / (mach**2 * (gamma + math.cos(2.0 * beta)) + 2.0))


def find_shock_angle(mach: float, angle: float, gamma: float) -> float:
    """Angle [rad] of the weak attached shock; BadInput where there is none."""
    from scipy.optimize import brentq, minimize_scalar  # slow to load

    least = math.asin(1.0 / mach)

    best = minimize_scalar(
        lambda beta: -compute_deflection(mach, beta, gamma),
        bounds=(least, 0.5 * math.pi),
        method="bounded",
        options={"xatol": 1e-10},
    ).x
    most = compute_deflection(mach, best, gamma)
    if angle >= most:
        raise BadInput(
            f"deck: angle is {math.degrees(angle):g} degrees; at Mach {mach:g} the shock stays "
            f"attached up to {math.degrees(most):.4g} degrees only"
        )
    return brentq(lambda beta: compute_deflection(mach, beta, gamma) - angle, least, best)


class ObliqueShockDeck(Deck, kw_only=True):
    """Deck of `oblique-shock`."""

    run: RunControl = msgspec.field(default_factory=lambda: RunControl(t_end=3.0, cfl=0.8))
    mach: Annotated[float, Meta(ge=1.001, le=100, description="Mach number of the stream")] = 2.5
    angle: Annotated[float, Meta(ge=0.1, lt=60, description="of the wedge [degrees]")] = 15.0
    gamma: Annotated[float, Meta(ge=1.01, description="ratio of specific heats")] = 1.4
    cells: Annotated[int, Meta(ge=16, le=MOST_CELLS, description="cells along the stream")] = 100
    limiter: Limiter = "van-leer"


class ObliqueShock(Problem):
    """One block on a grid at rest; density 1 and sound speed 1 in the stream."""

    Deck = ObliqueShockDeck
    units: ClassVar = {"shock_angle": "degrees"}

    def __init__(self, deck: ObliqueShockDeck):
        super().__init__(deck)
        self.angle = math.radians(deck.angle)
        self.beta = find_shock_angle(deck.mach, self.angle, deck.gamma)
        across = (deck.mach * math.sin(self.beta)) ** 2
        self.ahead = 1.0 / deck.gamma
        self.pressure = self.ahead * (1.0 + 2.0 * deck.gamma / (deck.gamma + 1.0) * (across - 1.0))
        if math.tan(self.beta) * LENGTH >= HEIGHT:
            raise BadInput(
                f"deck: the shock's angle is {math.degrees(self.beta):.3g} degrees; above "
                f"{math.degrees(math.atan(HEIGHT / LENGTH)):g} it leaves through the top"
            )

    def make_grid(self) -> np.ndarray:
        """Straight upright lines between the wall and the top."""
        deck = self.deck
        before = round(deck.cells * BEFORE / (LENGTH + BEFORE))
        x = np.concatenate([
            np.linspace(-BEFORE, 0.0, before + 1)[:-1],
            np.linspace(0.0, LENGTH, deck.cells - before + 1),
        ])  # fmt: skip
        wall = math.tan(self.angle) * np.maximum(x, 0.0)
        part = np.linspace(0.0, 1.0, round(0.8 * deck.cells) + 1)
        y = wall[:, None] + (HEIGHT - wall[:, None]) * part
        return np.array([np.broadcast_to(x[:, None], y.shape), y])

    def estimate_cells(self) -> int:
        return self.deck.cells * round(0.8 * self.deck.cells)

    def build(self) -> Simulation:
        deck = self.deck
        state = (1.0, deck.mach, 0.0, self.ahead)
        block = Block("gas", IdealGas(deck.gamma), self.make_grid(), *state, limiter=deck.limiter)
        put(block, "i_min", "inflow", state=state)
        put(block, "j_max", "inflow", state=state)
        put(block, "i_max", "outflow")
        put(block, "j_min", "wall")
        return Simulation(
            [block],
            [],
            t_end=deck.run.t_end,
            cfl=deck.run.cfl,
            small_cells=deck.run.small_cells,
            threads=deck.run.threads,
            mesh="fixed",
        )

    def measure(self, evolution: Simulation) -> dict[str, float]:
        """Pressure on the last half of the wedge over the exact one, and the shock's angle."""
        (block,) = evolution.blocks
        x, y = compute_centres(block.nodes)
        p = block.state[3, 1:-1, 1:-1]
        late = x[:, 0] > 0.5 * LENGTH
        positions = find_front(y, p, 0.5 * (self.ahead + self.pressure))
        chosen = (x[:, 0] > 0.3 * LENGTH) & (x[:, 0] < 0.9 * LENGTH) & np.isfinite(positions)
        slope = math.nan
        if chosen.sum() > 2:
            slope = math.degrees(math.atan(np.polyfit(x[chosen, 0], positions[chosen], 1)[0]))
        return {
            "wall_pressure_ratio": float(p[late, 0].mean()) / self.pressure,
            "shock_angle": slope,
            "shock_angle_error": abs(slope / math.degrees(self.beta) - 1.0),
        }

    def errors(self, history) -> dict[str, float]:
        """Relative errors of the shock's angle and of the pressure on the wall."""
        return {
            "angle": float(history["shock_angle_error"][-1]),
            "pressure": abs(float(history["wall_pressure_ratio"][-1]) - 1.0),
        }

    def predict(self) -> dict[str, float]:
        """Angle of the shock [degrees], and the pressure on the wall over the exact one: 1."""
        return {"shock_angle": math.degrees(self.beta), "wall_pressure_ratio": 1.0}

    def summary(self, history, final) -> str:
        deck = self.deck
        ratio, angle = history["wall_pressure_ratio"][-1], history["shock_angle"][-1]
        return (
            f"oblique-shock, Mach {deck.mach:g} on {deck.angle:g} degrees, {deck.cells} cells:\n"
            f"  angle of the shock {angle:.3f} degrees, exact {math.degrees(self.beta):.3f}\n"
            f"  pressure on the wall {ratio * self.pressure / self.ahead:.5g} of the stream's, "
            f"exact {self.pressure / self.ahead:.5g} ({100 * (ratio - 1.0):+.2f} %)"
        )

    def figures(self):
        return {"oblique-shock": functools.partial(draw_oblique_shock, self)}


def find_front(y: np.ndarray, p: np.ndarray, level: float) -> np.ndarray:
    """Heights (ni,) of the outermost place where p (ni, nj) falls below `level`; NaN for none."""
    positions = np.full(p.shape[0], math.nan)
    for i, column in enumerate(p):
        over = np.flatnonzero(column > level)
        if over.size and over[-1] + 1 < column.size:
            j = over[-1]
            part = (column[j] - level) / (column[j] - column[j + 1])
            positions[i] = y[i, j] + part * (y[i, j + 1] - y[i, j])
    return positions


def draw_oblique_shock(problem: ObliqueShock, figure, run_data) -> None:
    """Pressure with the grid and the exact shock, and pressure along the wall."""
    figure.set_size_inches(11.5, 4.6)
    left, right = figure.subplots(1, 2, width_ratios=(1.3, 1.0))
    dump = run_data.dumps[-1]
    end = LENGTH * math.tan(problem.beta)
    picture = draw_field(left, dump, "p", every=5)
    left.plot((0.0, LENGTH), (0.0, end), "r--", lw=1.5, zorder=5, label="exact shock")
    left.legend(loc="upper left")
    left.set_xlabel("x [m]")
    left.set_ylabel("y [m]")
    figure.colorbar(picture, ax=left, shrink=0.9, label="pressure [Pa]")
    (block,) = dump.blocks
    x, _ = compute_centres(block.nodes)
    pressure = block.cell_fields["p"][:, 0]
    before = float(pressure[0])
    right.plot(x[:, 0], pressure, ".-", ms=4, lw=0.8, label="computed")
    right.plot(
        (x[0, 0], 0.0, 0.0, LENGTH), (before, before, problem.pressure, problem.pressure),
        "k--", lw=0.9, label="exact",
    )  # fmt: skip
    right.legend(loc="lower right")
    right.set_xlabel("x [m]")
    right.set_ylabel("pressure on the wall [Pa]")
