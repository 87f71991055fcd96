"""Riemann problem: two states side by side, run against the exact solution.

`case` names the states (Sod, 123, Toro 3, LeBlanc, two gammas, water against gas, impacts of
metals); `left` and `right` give others.  With the contact "on-line" each state is a block, the
contact is the grid line between them, and a regridder moves the grids.  If the deck or the
case gives the lengths of the sides, the ends move with the undisturbed materials; otherwise the
exact waves determine lengths, grading, end time and motion of the ends, so that each plateau has
its share of the cells.  "captured" is one block of one material through which the contact runs, on
a grid at rest or in a prescribed smooth motion.

The problem measures the error of the density, `sum |rho - exact| dx`, and the star states: means
over the middle half of the plateaus beside the contact.  States that leave a vacuum between them
are refused.  Note: a plateau a few cells wide, as in the 123 problem, retains the start-up error at
the contact; `grading` puts small cells there.
"""

import math
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

import numpy as np
from msgspec import Meta

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import EquationOfState, IdealGas, StiffenedGas
from shockgrid.hydro.eos.materials import find_material
from shockgrid.hydro.formulas.reconstruction import DEFAULT_LIMITER
from shockgrid.hydro.links import join
from shockgrid.problems.deck import MOST_CELLS, Deck, Limiter, Regrid, RunControl, key
from shockgrid.problems.initial_states import Fluid, make_plane_grid, put_walls
from shockgrid.problems.pictures import name_axis, title_time
from shockgrid.problems.problem import Problem
from shockgrid.problems.references.hugoniot import caution_fit
from shockgrid.problems.references.riemann import (
    RiemannSolution,
    compute_cell_averages,
    solve_riemann,
)
from shockgrid.problems.report import Report
from shockgrid.problems.signals import average_plateau
from shockgrid.regrid.errors import BadInput, suggest
from shockgrid.regrid.roots import find_root

# of the length of a side that its fastest wave goes, where no end time is given
FASTEST_WAVE_WAY = 0.8
STARS = ("p_left", "p_right", "u_left", "u_right", "rho_left", "rho_right")
REST_SPEED_PART = 1e-12  # of the sound speed: slower than that nothing moves
AHEAD_OF_WAVES_PART = 0.15  # of a side at the end: ahead of its outermost wave
FIRST_LENGTH_PART = 0.2  # of its last length that a side with a rarefaction has at first
GRADED_CELLS = 200  # for which the cases' gradings are chosen
MOST_RATIO = 1e9  # of the largest cell of a side over its smallest
PLATEAU_CELL_PART = 0.3  # of a side's cells that are to be in its plateau
# of cells from one to the next
LEAST_GROWTH = 1.0 + 1e-9
MOST_GROWTH = 1.15
LARGE_LOGARITHM = 40.0  # logarithm of a number beside which 1 is nothing
UNITLESS_PRESSURE = 1e4  # gases at lower pressures than this [Pa] are given without units
# of the gases' kinetic energy that is left between two that part: with less, errors of their large
# energies are errors of the pressure
COLD_ENERGY_PART = 0.1
TRUSTED_STAR_ERROR = 0.05  # an error of a star state above it is worth a sentence
LABELS = {"rho": ("density", "kg/m3"), "u": ("velocity", "m/s"), "p": ("pressure", "Pa")}
MOST_LINEAR_RATIO = 300.0  # of values on a linear axis of the profiles


@dataclass(frozen=True)
class Case:
    """States (rho, u, p) left and right with their materials.

    `lengths` of the two sides [m], None: by the waves; `t_end` [s], None: when the faster wave is
    0.8 of the way to its end of the domain.  `grading`: growth of cells off a contact on a line;
    small cells there keep the error that the start leaves at the contact out of narrow plateaus.
    Gradings and limiters are chosen for 200 cells (more have the same largest over smallest);
    without them the 123 problem is 2.2 % off, Toro 3 0.12 %.
    """

    left_eos: EquationOfState
    left: tuple[float, float, float]
    right_eos: EquationOfState
    right: tuple[float, float, float]
    lengths: tuple[float, float] | None = (0.5, 0.5)
    t_end: float | None = None
    grading: float = 1.0
    limiter: str = DEFAULT_LIMITER


def _gas(left, right, gamma=1.4, second=None, **more) -> Case:
    return Case(IdealGas(gamma), left, IdealGas(second or gamma), right, **more)


def _impact(flyer: str, target: str, speed: float) -> Case:
    """A flyer plate at `speed` [m/s] hits a target at rest, both without pressure."""
    one = find_material(flyer)
    two = find_material(target)
    states = one.eos, (one.rho0, speed, 0.0), two.eos, (two.rho0, 0.0, 0.0)
    return Case(*states, lengths=(0.01, 0.01))


# those of gases are of Toro's book, the others of this project's own tables of exact solutions
CASES: dict[str, Case] = {
    "sod": _gas((1.0, 0.0, 1.0), (0.125, 0.0, 0.1), t_end=0.2),
    "123": _gas((1.0, -2.0, 0.4), (1.0, 2.0, 0.4), grading=1.036, limiter="van-leer"),
    "toro3": _gas(
        (1.0, 0.0, 1e3), (1.0, 0.0, 0.01), t_end=0.012, grading=1.016, limiter="minmod"
    ),
    "toro4": _gas((5.99924, 19.5975, 460.894), (5.99242, -6.19633, 46.0950), lengths=None),
    "toro5": _gas((1.0, -19.59745, 1000.0), (1.0, -19.59745, 0.01), lengths=None),
    "leblanc": _gas(
        (1.0, 0.0, 0.2 / 3.0), (1e-3, 0.0, 2e-10 / 3.0), 5.0 / 3.0, lengths=(3.0, 6.0), t_end=6.0,
        grading=1.03,
    ),
    "two-gammas": _gas((1.0, 0.0, 1e5), (0.125, 0.0, 1e4), 1.4, 1.2),
    "water-gas": Case(
        StiffenedGas(4.4, 6e8), (1000.0, 0.0, 1e9), IdealGas(1.4), (50.0, 0.0, 1e5),
        lengths=(0.8, 0.2), grading=1.015,
    ),
    "triple-bottom": _gas((1.0, 0.0, 1.0), (1.0, 0.0, 0.1), 1.5, 1.4, grading=1.015),
    "triple-top": _gas((1.0, 0.0, 1.0), (0.125, 0.0, 0.1), 1.5),
    "al-ss304": _impact("Al1100", "SS304", 2000.0),
    "al-ss304-4": _impact("Al1100", "SS304", 4000.0),
    "al-al": _impact("Al1100", "Al1100", 2000.0),
    "al-pb": _impact("Al1100", "Pb", 2000.0),
    "ss304-pb": _impact("SS304", "Pb", 2000.0),
}  # fmt: skip


@dataclass(frozen=True)
class Domain:
    """Lengths of the two sides at the start [m], growth of the cells of each off the contact,
    speeds of the ends [m/s], end time [s]; `span`: of both sides, for the width of the rows [m]."""

    lengths: tuple[float, float]
    growths: tuple[float, float]
    ends: tuple[float, float]
    t_end: float
    span: float


def choose_domain(exact: RiemannSolution, cells: tuple[int, int], t_end: float | None) -> Domain:
    """Two sides with the contact on the grid line between them.

    At the end a side reaches from the contact to a little beyond its outermost wave, however slow:
    each side has half of the cells.  Where a plateau is narrow, as behind a strong rarefaction, the
    cells grow off the contact, until the plateau has its share of them.  Cells that shrink or grow
    while a strong shock runs through them leave a wrong density behind it (0.7 % at 100 cells a
    side where the ends go with the undisturbed gas of Toro's fifth problem): a side with a shock
    keeps its length, and gas comes in at its end.  A side with a rarefaction starts short and grows
    with it, so that what the start leaves at the contact is little.

    cells: of the two sides; `t_end` None: when both sides together are 1 m long at the end.
    """
    last = []
    first = []
    growths = []
    ends = []
    waves = exact.left_wave, exact.right_wave
    for sign, wave, count in zip((-1, 1), waves, cells, strict=True):
        pace = (
            sign * (wave.head - exact.u) / (1.0 - AHEAD_OF_WAVES_PART)
        )  # length at the end, over t
        part = FIRST_LENGTH_PART if wave.kind == "rarefaction" else 1.0
        last.append(pace)
        first.append(part * pace)
        ends.append(exact.u + sign * (1.0 - part) * pace)
        growths.append(find_growth(sign * (wave.tail - exact.u) / pace, count))
    t = 1.0 / sum(last) if t_end is None else t_end
    lengths = first[0] * t, first[1] * t
    return Domain(lengths, tuple(growths), tuple(ends), t, 2.0 * max(last) * t)


def find_growth(part: float, count: int) -> float:
    """Growth of `count` cells from one to the next, such that SHARE of them are in the first `part`
    of their length; 1 where that is so with even cells, MOST_GROWTH at most."""
    first = PLATEAU_CELL_PART * count

    def excess(growth):
        rate = math.log(growth)
        if rate * count > LARGE_LOGARITHM:  # the ones count for nothing, and the powers overflow
            return math.exp(rate * (first - count)) - part
        return math.expm1(rate * first) / math.expm1(rate * count) - part

    if part >= PLATEAU_CELL_PART or excess(LEAST_GROWTH) <= 0.0:
        return 1.0
    if excess(MOST_GROWTH) > 0.0:
        return MOST_GROWTH
    return float(find_root(excess, LEAST_GROWTH, MOST_GROWTH, xtol=1e-12))


def grade(count: int, growth: float) -> np.ndarray:
    """`count` + 1 places from 0 to 1 whose steps grow from one to the next by `growth`."""
    positions = np.concatenate([[0.0], np.cumsum(growth ** np.arange(count))])
    return positions / positions[-1]


def find_pressure_ratio(case: Case, p: float) -> float:
    """The pressure `p` [Pa] between two ideal gases that part, over the lower one of theirs; inf
    for others."""
    gases = isinstance(case.left_eos, IdealGas) and isinstance(case.right_eos, IdealGas)
    least = min(case.left[2], case.right[2])
    return p / least if gases and p < least else math.inf


Length = Annotated[float, Meta(ge=1e-9, le=1e9)]


class SideState(Fluid, kw_only=True):
    """One state: a material of the library or an ideal (stiffened) gas, with rho, u, p."""

    u: key(float, "velocity [m/s]") = 0.0
    p: key(float, "pressure [Pa]", le=1e20) = 0.0

    def get_state(self) -> tuple[EquationOfState, tuple[float, float, float]]:
        """Equation of state and (rho, u, p)."""
        eos, rho = self.make()
        return eos, (rho, self.u, self.p)


class RiemannDeck(Deck, kw_only=True):
    """The defaults are Sod's problem, contact on a grid line."""

    run: RunControl = RunControl(cfl=0.8)
    case: key(str, "named states: " + ", ".join(CASES)) = "sod"
    left: SideState | None = None
    right: SideState | None = None
    lengths: key(
        tuple[Length, Length] | None, "of the sides [m]. If left out: the case's, or by the waves"
    ) = None
    contact: key(Literal["on-line", "captured"], "between two blocks, or inside one") = "on-line"
    mesh: key(Literal["fixed", "wave"], "of a captured contact: at rest, swinging") = "fixed"
    cells: key(int, "cells along x", ge=8, le=MOST_CELLS) = 100
    rows: key(int, "cells across", ge=2, le=MOST_CELLS) = 4
    grading: key(
        float | None, "growth of cells off the contact. If left out: as `lengths`", ge=1, le=1.2
    ) = None
    limiter: Limiter | None = None  # None: the case's
    regrid: Regrid = Regrid()


class Riemann(Problem):
    Deck = RiemannDeck
    counted = ("cells", "rows")
    units: ClassVar = {f"star_{name}": LABELS[name.partition("_")[0]][1] for name in STARS}

    def __init__(self, deck: RiemannDeck):
        super().__init__(deck)
        if (deck.left is None) != (deck.right is None):
            raise BadInput("deck: give both `left` and `right`, or neither and a `case`")
        if deck.left is not None:
            case = Case(*deck.left.get_state(), *deck.right.get_state(), lengths=None)
        elif deck.case in CASES:
            case = CASES[deck.case]
        else:
            raise BadInput(f"deck: there is no case {deck.case!r}{suggest(deck.case, CASES)}")
        if deck.lengths is not None:
            case = replace(case, lengths=deck.lengths, t_end=None)
        self.case = case
        self.limiter = deck.limiter or case.limiter
        gases = isinstance(case.left_eos, IdealGas) and isinstance(case.right_eos, IdealGas)
        if gases and max(case.left[2], case.right[2]) < UNITLESS_PRESSURE:
            self.t_unit = "1"
        self.name = "own states" if deck.left is not None else deck.case
        self.on_line = deck.contact == "on-line"
        two = not self.on_line and case.left_eos != case.right_eos
        if two:
            raise deck.error("contact", "the two sides are of different materials; take 'on-line'")
        graded = not self.on_line and deck.grading is not None
        if graded:
            raise deck.error("grading", "it is for contact = 'on-line'; leave it out")
        self.exact = exact = solve_riemann(case.left_eos, case.left, case.right_eos, case.right)
        if exact.gap:
            parting = case.right[1] - case.left[1]
            raise BadInput(
                f"deck: the two gases part and leave a vacuum between x/t = {exact.u_left:.6g} and "
                f"{exact.u_right:.6g} m/s, so there is no contact; they part with {parting:.6g} "
                f"m/s, make that less than {parting - (exact.u_right - exact.u_left):.6g} m/s"
            )
        self.domain = self.choose_domain()
        growth = max(self.domain.growths)
        count = deck.cells - deck.cells // 2
        if count * math.log(growth) > math.log(MOST_RATIO):
            right = 1.0 + 0.9 * math.log(MOST_RATIO) / count
            raise BadInput(
                f"deck: with grading {growth:.5g} the last of {count} cells would be more than "
                f"{MOST_RATIO:g} times the first; take grading = {right:.4g}, or fewer cells"
            )
        self.t_end = self.domain.t_end

    def measure_heat_left(self) -> float:
        """Specific internal energy between two gases that part, over the kinetic energy of their
        motion against each other: the smaller one of both sides; inf for others."""
        case = self.case
        exact = self.exact
        speed = 0.5 * (case.right[1] - case.left[1])
        if math.isinf(find_pressure_ratio(case, exact.p)) or not speed > 0.0:
            return math.inf
        sides = (case.left_eos, exact.rho_left), (case.right_eos, exact.rho_right)
        return min(float(eos.energy(rho, exact.p)) for eos, rho in sides) / (0.5 * speed * speed)

    def cautions(self, run) -> list[str]:
        """Before a run that gases part near vacuum speed, after it what this has done; shocks
        beyond a Hugoniot."""
        case = self.case
        sides = ("left", case.left_eos), ("right", case.right_eos)
        cautions = []
        for side, eos in sides:
            cautions += caution_fit(f"the {side} material", eos, self.exact.p)
        return cautions + self.caution_stars(run)

    def caution_stars(self, run) -> list[str]:
        """What is off the exact solution, or may be, by how much and why."""
        heat = self.measure_heat_left()
        ratio = find_pressure_ratio(self.case, self.exact.p)
        parting = (
            f"the gases part so fast that the pressure between them falls to {ratio:.2g} of theirs "
            f"and their heat to {100.0 * heat:.2g} % of their kinetic energy, whose errors are "
            "errors of the pressure"
        )
        rows = self.report(run).rows if run.begun else []
        known = [row for row in rows if not math.isnan(row.difference)]
        if not known:
            if heat >= COLD_ENERGY_PART:
                return []
            return [
                f"{parting}: "
                "with few cells it is off by tens of per cent; compare runs of several `cells`"
            ]
        worst = max(known, key=lambda row: abs(row.difference))
        off = worst.difference
        if abs(off) <= TRUSTED_STAR_ERROR:
            return []
        size = f"{1.0 + off:.3g} times" if off > 1.0 else f"{100.0 * abs(off):.3g} % off"
        deviation = f"{worst.label} is {size} the exact solution"
        why = parting if heat < COLD_ENERGY_PART else "its plateau has too few cells"
        return [f"{deviation}: {why}; take more `cells`"]

    def choose_domain(self) -> Domain:
        """Lengths, growths and end time: the deck's, the case's, or by the waves, of which one is
        FASTEST_WAVE_WAY of the way to its end where nothing else gives the end time."""
        deck = self.deck
        case = self.case
        exact = self.exact
        if case.lengths is not None:
            ends = (case.left[1], case.right[1]) if self.on_line else (0.0, 0.0)
            speeds = ends[0] - exact.left_wave.head, exact.right_wave.head - ends[1]
            ways = zip(case.lengths, speeds, strict=True)
            t = FASTEST_WAVE_WAY * min(length / speed for length, speed in ways if speed > 0.0)
            own = case.grading ** min(1.0, GRADED_CELLS / deck.cells)
            t_end = deck.run.t_end or case.t_end or t
            growths = (deck.grading or own,) * 2
            return Domain(case.lengths, growths, ends, t_end, sum(case.lengths))
        made_for = deck.run.t_set_up or deck.run.t_end
        if self.on_line:
            cells = deck.cells // 2, deck.cells - deck.cells // 2
            domain = choose_domain(exact, cells, made_for)
        else:
            left, right = max(-exact.left_wave.head, 0.0), max(exact.right_wave.head, 0.0)
            beyond = AHEAD_OF_WAVES_PART * (left + right)
            span = left + right + 2.0 * beyond
            t = 1.0 / span if made_for is None else made_for
            lengths = (left + beyond) * t, (right + beyond) * t
            domain = Domain(lengths, (1.0, 1.0), (0.0, 0.0), t, span * t)
        growths = domain.growths if deck.grading is None else (deck.grading,) * 2
        return replace(domain, t_end=deck.run.t_end or domain.t_end, growths=growths)

    def find_leaving_time(self) -> float:
        """When the first wave meets an end of the domain [s], beyond which the exact solution,
        of materials without ends, says nothing; inf if none does."""
        domain = self.domain
        waves = self.exact.left_wave, self.exact.right_wave
        sides = zip((-1.0, 1.0), domain.lengths, domain.ends, waves, strict=True)
        found = [(length, sign * (wave.head - end)) for sign, length, end, wave in sides]
        return min((length / speed for length, speed in found if speed > 0.0), default=math.inf)

    def make_grids(self, t=0.0):
        """Straight lines, cells about as wide as long.  A captured contact is on a grid at rest,
        or one that swings as a standing wave of one period, which stretches cells by a fifth at
        most and is back at its start at the end."""
        deck = self.deck
        domain = self.domain
        half = self.deck.cells // 2
        across = np.linspace(0.0, domain.span / deck.cells * deck.rows, deck.rows + 1)
        left, right = domain.lengths
        if self.on_line:
            lines = {
                "left": left * -grade(half, domain.growths[0])[::-1],
                "right": right * grade(deck.cells - half, domain.growths[1]),
            }
        else:
            x = np.linspace(-left, right, deck.cells + 1)
            if deck.mesh == "wave":
                turn = 2.0 * math.pi
                length = x[-1] - x[0]
                period = deck.run.t_set_up or self.t_end
                wave = 0.2 * length / turn * np.sin(turn * (x - x[0]) / length)
                x = x + wave * math.sin(turn * t / period)
            lines = {"all": x}
        return {name: make_plane_grid(x, across) for name, x in lines.items()}

    def build(self):
        case = self.case
        grids = self.make_grids()
        blocks = []
        if not self.on_line:
            x = grids["all"][0]
            first = np.clip(-x[:-1, 1:] / np.diff(x[:, 1:], axis=0), 0.0, 1.0)  # of a cell in x < 0
            pairs = zip(case.left, case.right, strict=True)
            rho, u, p = (first * a + (1.0 - first) * b for a, b in pairs)
            block = Block("all", case.left_eos, grids["all"], rho, u, 0.0, p, limiter=self.limiter)
            for side in ("i_min", "i_max"):
                put(block, side, "outflow")
            put_walls(block)
            return self.simulate([block], mesh=self.deck.mesh)
        for side, eos, (rho, u, p), speed, (name, nodes) in zip(
            ("i_min", "i_max"), (case.left_eos, case.right_eos), (case.left, case.right),
            self.domain.ends, grids.items(), strict=True,
        ):  # fmt: skip
            state = rho, u, 0.0, p
            block = Block(name, eos, nodes, *state, limiter=self.limiter)
            # ends that the waves give do not go with the materials
            end = {"kind": "piston"} if case.lengths else {"kind": "inflow", "state": state}
            put(block, side, velocity=(speed, 0.0), **end)
            blocks.append(block)
        link = join("interface", (blocks[0], "i_max"), (blocks[1], "i_min"))
        put_walls(*blocks)
        return self.simulate(blocks, [link])

    def measure(self, evolution) -> dict[str, float]:
        """Error of the density and the star states (NaN while a plateau is too narrow)."""
        t = evolution.t
        exact = self.exact
        row = {"l1_rho": 0.0} | {f"star_{name}": math.nan for name in STARS}
        if t == 0.0:
            return row
        for block in evolution.blocks:
            edges = block.nodes[0, :, 0]
            rho, u, _, p = block.state[:, 1:-1, 1]
            off = np.abs(rho - compute_cell_averages(exact, edges, t)[0])
            row["l1_rho"] += float((off * np.diff(edges)).sum())
            for side, wave in (("left", exact.left_wave), ("right", exact.right_wave)):
                means = average_plateau(edges, (rho, u, p), (exact.u * t, wave.tail * t))
                for name, mean in zip(("rho", "u", "p"), means, strict=True):
                    if not math.isnan(mean):
                        row[f"star_{name}_{side}"] = float(mean)
        return row

    def star_states(self) -> dict[str, tuple[float, float]]:
        """Exact star states by name, each with the size to which its error is relative.

        Of the velocity that is the largest of |u*| and the changes of velocity over the waves;
        where nothing moves, a speed of sound.
        """
        exact = self.exact
        case = self.case
        speed = max(abs(exact.u), abs(exact.u - case.left[1]), abs(exact.u - case.right[1]))
        c = float(case.left_eos.sound_speed(case.left[0], case.left[2]))
        speed = speed if speed > REST_SPEED_PART * c else c
        values = (exact.p, exact.p, exact.u, exact.u, exact.rho_left, exact.rho_right)
        return {
            name: (value, speed if name.startswith("u") else abs(value))
            for name, value in zip(STARS, values, strict=True)
        }

    def report(self, run) -> Report:
        deck = self.deck
        exact = self.exact
        notes = []
        leaving = self.find_leaving_time()
        if run.begun and run.t > leaving:
            run = run.until(leaving)
            notes.append(
                f"a wave meets an end of the domain at t = {leaving:.4g}: "
                "compared up to there; longer `lengths` let the run go on"
            )
        t = run.t
        where = "on a grid line" if self.on_line else f"captured, grid {deck.mesh}"
        rows = [
            run.compare(f"star_{name}", float(value), name.replace("_", " "), size=float(size),
                digits=9, studied=True,
            )
            for name, (value, size) in self.star_states().items()
        ]  # fmt: skip
        notes += [
            f"the {side} plateau, {abs(wave.tail - exact.u) * t:.3g} m wide, has no cell in its "
            "middle half: more cells, lengths left out, or a larger grading"
            for side, wave in (("left", exact.left_wave), ("right", exact.right_wave))
            if run.begun and math.isnan(run.last(f"star_p_{side}"))
        ]
        head = (
            f"riemann problem {self.name!r}, {deck.cells} cells, contact {where}: L1(rho) = "
            f"{run.last('l1_rho'):.3g}; star states beside the contact:"
        )
        return Report(head, rows, notes)

    def draw_profiles(self, figure, run_data) -> None:
        """Density, velocity and pressure along x in the last dump over the exact solution."""
        dump = run_data.dumps[-1]
        axes = figure.subplots(1, 3)
        ends = [block.nodes[0, [0, -1], 0] for block in dump.blocks]
        x = np.linspace(np.min(ends), np.max(ends), 2000)
        if dump.t > 0.0:
            speeds = self.exact.get_speeds() * dump.t
            speeds = speeds[(speeds > x[0]) & (speeds < x[-1])]
            x = np.unique(np.concatenate([x, speeds, np.nextafter(speeds, np.inf)]))
            exact = self.exact.sample(x / dump.t)
            for axis, name, values in zip(axes, LABELS, exact, strict=True):
                axis.plot(x, values, color="0.6", lw=1.2, label="exact")
                is_positive = name != "u" and values.min() > 0.0
                if is_positive and values.max() > MOST_LINEAR_RATIO * values.min():
                    axis.set_yscale("log")
        for axis, (name, (label, unit)) in zip(axes, LABELS.items(), strict=True):
            for block, colour in zip(dump.blocks, ("C0", "C3"), strict=False):
                x = block.centres[0][:, 0]
                values = block.cell_fields[name][:, 0]
                axis.plot(
                    x,
                    values,
                    ".",
                    ms=3,
                    color=colour,
                    label=block.name if self.on_line else "computed",
                )
            axis.set_xlabel(name_axis("x", dump.length_unit))
            axis.set_title(name_axis(label, "1" if dump.t_unit == "1" else unit), fontsize="medium")
        figure.suptitle(f"{self.name}, {title_time(dump)}", fontsize="medium")
