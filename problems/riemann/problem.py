"""Riemann problem: two states side by side, run against the exact solution.

`case` names the states (Sod, 123, Toro 3, LeBlanc, two gammas, water against gas, impacts of
metals), `left` and `right` give others.  With the contact "on-line" each state is a block of its
own, the contact is the grid line between them, and the grids are rebuilt every step.  Where the
lengths of the sides are given, by the deck or the case, the ends move with the undisturbed
materials; otherwise lengths, grading, end time and the motion of the ends follow from the exact
waves, so that each plateau has its share of the cells.  "captured" is one block of one material
through which the contact runs, on a grid at rest or under a given smooth motion.

Measured are the error of the density, `sum |rho - exact| dx`, and the star states: means over the
middle half of the plateaus beside the contact.  States that leave a vacuum between them are
refused.  The trap: a plateau a few cells wide, as in the 123 problem, holds what the start left at
the contact; `grading` puts small cells there.
"""

from __future__ import annotations

import functools
import math
from dataclasses import replace
from typing import Annotated, Literal

import msgspec
import numpy as np
from msgspec import Meta

from hydro.block import Block
from hydro.boundary.registry import put
from hydro.eos import EquationOfState, IdealGas, StiffenedGas
from hydro.eos.materials import find_material
from hydro.links.join import join
from hydro.simulation import Simulation
from problems.deck import MOST_CELLS, Deck, DeckTable, Limiter, Regrid, RunControl
from problems.problem import Problem
from problems.references.riemann import (
    RiemannSolution,
    compute_cell_averages,
    compute_l1_error,
    solve_riemann,
)
from problems.riemann.cases import CASES, Case
from problems.riemann.domain import Domain, choose_captured_domain, choose_domain
from regrid.errors import BadInput, suggest

WAY = 0.8  # of the length of a side that its fastest wave goes, where no end time is given
STARS = ("p_left", "p_right", "u_left", "u_right", "rho_left", "rho_right")
REST = 1e-12  # of the sound speed: slower than that nothing moves


class SideState(DeckTable, kw_only=True):
    """One state: a material of the library or an ideal (stiffened) gas, with rho, u, p."""

    material: (
        Annotated[str, Meta(description="name in the material library; left out: a gas")] | None
    ) = None
    gamma: Annotated[
        float, Meta(ge=1.001, le=1000, description="ratio of specific heats of the gas")
    ] = 1.4
    p_inf: Annotated[
        float, Meta(ge=0, le=1e20, description="stiffness of the gas [Pa]; 0: ideal")
    ] = 0.0
    rho: (
        Annotated[
            float, Meta(ge=1e-20, le=1e20, description="density [kg/m3]; left out: the library's")
        ]
        | None
    ) = None
    u: Annotated[float, Meta(description="velocity [m/s]")] = 0.0
    p: Annotated[float, Meta(le=1e20, description="pressure [Pa]")] = 0.0

    def make(self) -> tuple[EquationOfState, tuple[float, float, float]]:
        """Equation of state and (rho, u, p)."""
        if self.material is not None:
            found = find_material(self.material)
            return found.eos, (self.rho or found.rho0, self.u, self.p)
        if self.rho is None:
            raise BadInput("deck: a gas without `material` needs its density `rho`")
        eos = StiffenedGas(self.gamma, self.p_inf) if self.p_inf else IdealGas(self.gamma)
        return eos, (self.rho, self.u, self.p)


class RiemannDeck(Deck, kw_only=True):
    """Deck of `riemann`; the defaults are Sod's problem, contact on a grid line."""

    run: RunControl = msgspec.field(default_factory=lambda: RunControl(cfl=0.8))
    case: Annotated[str, Meta(description="named states: " + ", ".join(CASES))] = "sod"
    left: SideState | None = None
    right: SideState | None = None
    lengths: (
        Annotated[
            tuple[float, float],
            Meta(
                description="lengths of the two sides [m]; left out: the case's, or by the waves, "
                "1 m in all"
            ),
        ]
        | None
    ) = None
    contact: Annotated[
        Literal["on-line", "captured"],
        Meta(description="on-line: a grid line between two blocks; captured: inside one block"),
    ] = "on-line"
    mesh: Annotated[
        Literal["fixed", "wave", "follow"],
        Meta(
            description="grid of a captured contact: at rest; nodes swinging as a standing wave; "
            "all drifting with the contact"
        ),
    ] = "fixed"
    cells: Annotated[int, Meta(ge=8, le=MOST_CELLS, description="cells along x")] = 100
    rows: Annotated[int, Meta(ge=2, le=MOST_CELLS, description="cells across")] = 4
    grading: (
        Annotated[
            float,
            Meta(
                ge=1,
                le=1.2,
                description="growth of cells from one to the next off a contact on a line; "
                "left out: the case's, or by the waves",
            ),
        ]
        | None
    ) = None
    limiter: Limiter | None = None  # None: the case's
    regrid: Regrid = msgspec.field(default_factory=Regrid)


class Riemann(Problem):
    """One or two blocks along x, a few cells across."""

    Deck = RiemannDeck

    def __init__(self, deck: RiemannDeck):
        super().__init__(deck)
        self.case = self._make_case()
        case = self.case
        if deck.contact == "captured" and case.left_eos != case.right_eos:
            raise BadInput(
                "deck: the two sides are of different materials; set contact = 'on-line' "
                "(a captured contact needs one material)"
            )
        if deck.contact == "captured" and deck.grading is not None:
            raise BadInput("deck: grading is for contact = 'on-line'; leave it out")
        if case.lengths is not None and min(case.lengths) <= 0.0:
            raise BadInput(f"deck: lengths are {case.lengths}; both must be positive")
        self._check_gap()

    def _make_case(self) -> Case:
        deck = self.deck
        if (deck.left is None) != (deck.right is None):
            raise BadInput("deck: give both `left` and `right`, or neither and a `case`")
        if deck.left is not None:
            case = Case(*deck.left.make(), *deck.right.make(), lengths=None)
        elif deck.case in CASES:
            case = CASES[deck.case]
        else:
            raise BadInput(f"deck: there is no case {deck.case!r}{suggest(deck.case, CASES)}")
        if deck.lengths is None:
            return case
        return replace(case, lengths=deck.lengths, t_end=None)

    def _check_gap(self) -> None:
        """Raise BadInput where the states part and leave a vacuum."""
        exact, case = self.exact, self.case
        if not exact.gap:
            return
        parting = case.right[1] - case.left[1]
        most = parting - (exact.u_right - exact.u_left)
        raise BadInput(
            f"deck: the two gases part and leave a vacuum between x/t = {exact.u_left:.6g} and "
            f"{exact.u_right:.6g} m/s, so there is no contact; the right one leaves the left one "
            f"with {parting:.6g} m/s, make that less than {most:.6g} m/s"
        )

    @functools.cached_property
    def exact(self) -> RiemannSolution:
        """The exact solution; the contact starts at x = 0."""
        case = self.case
        return solve_riemann(case.left_eos, case.left, case.right_eos, case.right)

    @functools.cached_property
    def domain(self) -> Domain:
        """Lengths, growths and end time: the deck's, the case's, or by the waves."""
        deck, case = self.deck, self.case
        if case.lengths is not None:
            growth = deck.grading or case.grading
            ends, t_end = (case.left[1], case.right[1]), self._find_end(case.lengths)
            return Domain(case.lengths, (growth, growth), ends, t_end, sum(case.lengths))
        made_for = deck.run.t_set_up or deck.run.t_end
        if deck.contact == "captured":
            speed = self.exact.u if deck.mesh == "follow" else 0.0
            domain = choose_captured_domain(self.exact, speed, made_for)
            return replace(domain, t_end=deck.run.t_end or domain.t_end)
        cells = deck.cells // 2, deck.cells - deck.cells // 2
        domain = choose_domain(self.exact, cells, made_for)
        domain = replace(domain, t_end=deck.run.t_end or domain.t_end)
        if deck.grading is not None:
            return replace(domain, growths=(deck.grading, deck.grading))
        return domain

    def _find_end(self, lengths: tuple[float, float]) -> float:
        """End time: the deck's, the case's, or when a wave is WAY of the way to its end."""
        if self.deck.run.t_end is not None:
            return self.deck.run.t_end
        if self.case.t_end is not None:
            return self.case.t_end
        case, moving = self.case, self.deck.contact == "on-line"
        left = (case.left[1] if moving else 0.0) - self.exact.left_wave.head
        right = self.exact.right_wave.head - (case.right[1] if moving else 0.0)
        times = [
            length / speed
            for length, speed in zip(lengths, (left, right), strict=True)
            if speed > 0.0
        ]
        return WAY * min(times)

    @property
    def t_end(self) -> float:
        """End time [s]."""
        return self.domain.t_end

    @property
    def limiter(self) -> str:
        """The deck's limiter, or the case's."""
        return self.deck.limiter or self.case.limiter

    @property
    def name(self) -> str:
        """The case in words."""
        return "own states" if self.deck.left is not None else self.deck.case

    def make_grid(self, x: np.ndarray) -> np.ndarray:
        """Grid with straight lines at `x`, cells about as wide as long."""
        deck = self.deck
        width = self.domain.span / deck.cells * deck.rows
        nodes = np.empty((2, x.size, deck.rows + 1))
        nodes[0] = x[:, None]
        nodes[1] = np.linspace(0.0, width, deck.rows + 1)
        return nodes

    def estimate_cells(self) -> int:
        return self.deck.cells * self.deck.rows

    def build(self) -> Simulation:
        """Blocks at the start."""
        return self._build_on_line() if self.deck.contact == "on-line" else self._build_captured()

    def _build_on_line(self) -> Simulation:
        case, deck = self.case, self.deck
        half, (length, length_2) = deck.cells // 2, self.domain.lengths
        growth, growth_2 = self.domain.growths
        one = -length * grade(half, growth)[::-1]
        two = length_2 * grade(deck.cells - half, growth_2)
        (rho, u, p), (rho_2, u_2, p_2) = case.left, case.right
        left = Block(
            "left", case.left_eos, self.make_grid(one), rho, u, 0.0, p, limiter=self.limiter
        )
        right = Block(
            "right", case.right_eos, self.make_grid(two), rho_2, u_2, 0.0, p_2, limiter=self.limiter
        )
        links = [join("interface", (left, "i_max"), (right, "i_min"))]
        end, end_2 = self.domain.ends
        if case.lengths is not None:
            put(left, "i_min", "piston", velocity=(end, 0.0))
            put(right, "i_max", "piston", velocity=(end_2, 0.0))
        else:  # ends that do not go with the materials
            put(left, "i_min", "inflow", state=(rho, u, 0.0, p), velocity=(end, 0.0))
            put(right, "i_max", "inflow", state=(rho_2, u_2, 0.0, p_2), velocity=(end_2, 0.0))
        return self._march([left, right], links, "regrid")

    def _build_captured(self) -> Simulation:
        case, deck = self.case, self.deck
        length, length_2 = self.domain.lengths
        x = np.linspace(-length, length_2, deck.cells + 1)
        first = np.clip(-x[:-1] / np.diff(x), 0.0, 1.0)[:, None]  # part of a cell left of x = 0
        density, speed, pressure = (
            first * a + (1.0 - first) * b for a, b in zip(case.left, case.right, strict=True)
        )
        block = Block(
            "all", case.left_eos, self.make_grid(x), density, speed, 0.0, pressure,
            limiter=self.limiter,
        )  # fmt: skip
        put(block, "i_min", "outflow")
        put(block, "i_max", "outflow")
        if deck.mesh == "fixed":
            return self._march([block], [], "fixed")
        return self._march([block], [], lambda name, t: self.make_grid(self.move(x, t)))

    def move(self, x: np.ndarray, t: float) -> np.ndarray:
        """Places at time t of the nodes that start at `x`, for a captured contact.

        "wave": a standing wave of one period that stretches cells by a fifth at most, back at its
        start at the end; "follow": all drift with the contact.
        """
        if self.deck.mesh == "follow":
            return x + self.exact.u * t
        length = x[-1] - x[0]
        size = 0.2 * length / (2.0 * math.pi)
        wave = np.sin(2.0 * math.pi * (x - x[0]) / length)
        period = self.deck.run.t_set_up or self.t_end
        return x + size * wave * math.sin(2.0 * math.pi * t / period)

    def _march(self, blocks, links, mesh) -> Simulation:
        deck = self.deck
        for block in blocks:
            put(block, "j_min", "wall")
            put(block, "j_max", "wall")
        return Simulation(
            blocks,
            links,
            t_end=self.t_end,
            cfl=deck.run.cfl,
            small_cells=deck.run.small_cells,
            threads=deck.run.threads,
            mesh=mesh,
            make_regridder=lambda: deck.regrid.make(threads=deck.run.threads),
        )

    def measure(self, evolution: Simulation) -> dict[str, float]:
        """Error of the density and the star states (NaN while a plateau is too narrow)."""
        t, exact = evolution.t, self.exact
        row = {"l1_rho": 0.0} | {f"star_{name}": math.nan for name in STARS}
        if t == 0.0:
            return row
        for block in evolution.blocks:
            edges = block.nodes[0, :, 0]
            rho, u, _, p = block.state[:, 1:-1, 1]
            row["l1_rho"] += compute_l1_error(rho, compute_cell_averages(exact, edges, t)[0], edges)
            middle = 0.5 * (edges[1:] + edges[:-1]) / t
            lengths = np.diff(edges)
            for side, wave in (("left", exact.left_wave), ("right", exact.right_wave)):
                width = abs(wave.tail - exact.u)
                inside = np.abs(middle - 0.5 * (wave.tail + exact.u)) < 0.25 * width
                if inside.any():
                    for name, values in (("rho", rho), ("u", u), ("p", p)):
                        row[f"star_{name}_{side}"] = float(
                            np.average(values[inside], weights=lengths[inside])
                        )
        return row

    def watch(self, evolution):
        """Only cells along sides are measured."""
        return {}

    def star_states(self) -> dict[str, tuple[float, float]]:
        """Exact star states by name, each with the size to which its error is relative.

        Of the velocity that is the largest of |u*| and the changes of velocity over the waves;
        where nothing moves, a speed of sound.
        """
        exact, case = self.exact, self.case
        speed = max(abs(exact.u), abs(exact.u - case.left[1]), abs(exact.u - case.right[1]))
        c = float(case.left_eos.sound_speed(case.left[0], case.left[2]))
        speed = speed if speed > REST * c else c
        values = (exact.p, exact.p, exact.u, exact.u, exact.rho_left, exact.rho_right)
        return {
            name: (value, speed if name.startswith("u") else abs(value))
            for name, value in zip(STARS, values, strict=True)
        }

    def find_worst_star(self, row) -> float:
        """Largest relative error of the star states in a row of `measure`; NaN: one is unknown."""
        errors = [
            abs(row[f"star_{name}"] - exact) / size
            for name, (exact, size) in self.star_states().items()
        ]
        return float(np.max(errors))

    def predict(self) -> dict[str, float]:
        """The exact star states, by the columns of their measured ones."""
        return {f"star_{name}": float(value) for name, (value, _) in self.star_states().items()}

    def summary(self, history, final) -> str:
        from problems.riemann.report import make_summary

        return make_summary(self, history)

    def results(self, history) -> dict[str, tuple[float, float]]:
        """Pressure [Pa], velocity [m/s] and densities [kg/m3] of the star states."""
        return {
            f"star_{name}": (float(history[f"star_{name}"][-1]), exact)
            for name, (exact, _) in self.star_states().items()
        }

    def figures(self):
        from problems.riemann.report import draw_profiles

        return {"profiles": functools.partial(draw_profiles, self)}


def grade(count: int, growth: float) -> np.ndarray:
    """`count` + 1 places from 0 to 1 whose steps grow from one to the next by `growth`."""
    positions = np.concatenate([[0.0], np.cumsum(growth ** np.arange(count))])
    return positions / positions[-1]
