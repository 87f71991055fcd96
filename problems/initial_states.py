"""Grids and cell states at t = 0 that several problems share.

Rectangular grids, and flows on them that depend on a radius alone.  Shocks that begin with their
own discrete profile: a captured shock has a profile of a few cells, which depends on how the cells
move.  A jump has to find it first: it sends waves after itself and leaves a spot of wrong density
where it began, and both reach what the shock hits.  Here the shock runs first, in one dimension, on
cells that move as in the run to come and up to the place where it begins there; some cells behind
it the exact state stands again.  `settle_shock`: a shock driven by a piston; `settle_front`: one
that runs outwards from a contact.
"""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos import EquationOfState, IdealGas, StiffenedGas
from shockgrid.hydro.eos.conversion import compute_conserved, find_held
from shockgrid.hydro.eos.materials import Material, find_material
from shockgrid.hydro.formulas.reconstruction import DEFAULT_LIMITER
from shockgrid.hydro.simulation import Simulation
from shockgrid.hydro.step import take_step
from shockgrid.problems.deck import DeckTable, key
from shockgrid.problems.pictures import Colours, draw_field, make_panels, title_time
from shockgrid.problems.problem import BlockPlan, Problem
from shockgrid.problems.references.exact_flows import average_points
from shockgrid.problems.references.hugoniot import Shock, shock_with_mach
from shockgrid.problems.report import RunSoFar
from shockgrid.problems.signals import find_crossing
from shockgrid.regrid.compilation.contents import is_of_packages
from shockgrid.regrid.compilation.kept_files import remember
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.measure.cells import compute_area_fractions
from shockgrid.regrid.sides import SIDE_NAMES

Symmetry = Literal["plane", "cylindrical", "spherical"]
STRIP_CELLS = 4  # cells across the strip of plane flow
CELL_MEAN_POINTS = 6  # for means over a cell, each way
LEAST_RISE = 1e-3  # of the density over that of the cold gas: less is no shock


class Fluid(DeckTable, kw_only=True):
    """One material: by name from the library, or as an ideal (stiffened) gas."""

    material: key(str, "name in the material library. If left out: a gas") | None = None
    gamma: key(float, "ratio of specific heats of the gas", ge=1.001, le=1000) = 1.4
    p_inf: key(float, "stiffness of the gas [Pa]; 0: ideal", ge=0, le=1e20) = 0.0
    rho: key(float, "density [kg/m3]. If left out: the material's", ge=1e-20, le=1e20) | None = None

    @classmethod
    def keeps_defaults(cls, table: Mapping[str, Any]) -> bool:
        """A gas does; a material brings its own density."""
        return "material" not in table

    def find(self) -> Material:
        """The material of the library, or that of the gas."""
        if self.material is not None:
            return find_material(self.material)
        eos = StiffenedGas(self.gamma, self.p_inf) if self.p_inf else IdealGas(self.gamma)
        if self.rho is None:
            raise BadInput("deck: a gas without `material` needs its density `rho`")
        return Material(eos, self.rho, "the deck")

    def make(self) -> tuple[EquationOfState, float]:
        """Equation of state and density at the start."""
        found = self.find()
        return found.eos, self.rho or found.rho0


def make_plane_grid(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Nodes (2, x.size, y.size) of the rectangular grid with lines at `x` and `y` [m]."""
    return np.array(np.meshgrid(x, y, indexing="ij"))


def swing_square(cells: int, low: float, period: float, swing: float) -> np.ndarray:
    """Nodes (2, cells+1, cells+1) of a periodic square displaced by a sine wave each way [m].

    The square has its corner at (low, low) and sides of length `period`; x goes up by `swing` times
    sin(k (x - low)) sin(k (y - low)), k = 2 pi/period, and y down by as much.  Bitwise periodic:
    the far sides take the displacement of the near ones.
    """
    x, y = BlockPlan("", (cells, cells), (low, low), (low + period, low + period)).make_nodes()
    k = 2.0 * np.pi / period
    wave = np.sin(k * (x - low)) * np.sin(k * (y - low))
    wave[-1] = wave[0]
    wave[:, -1] = wave[:, 0]
    return np.array([x + swing * wave, y - swing * wave])


def lay_rays(
    radius: float, box: tuple[float, float, float], cells: int, rows: int, finest: float = 0.5
) -> tuple[np.ndarray, list[int]]:
    """Nodes (2, n + 1, rows + 1) of rays from half a circle about the origin, clockwise, to the
    walls of a box around it, and numbers of the box's corners in the n + 1.

    box: x of its ends and its height over the radius.  Each wall has its part of the half turn of
    `cells`, 3 at least; the rows at the circle are `finest` of the mean as high.
    """
    low, high, top = box
    corners = radius * np.array([[low, 0.0], [low, top], [high, top], [high, 0.0]]).T
    turn = -np.diff(np.unwrap(np.arctan2(*corners[::-1])))
    places = np.cumsum([0, *np.maximum(3, np.rint(cells * turn / np.pi).astype(int))])
    along = np.arange(places[-1] + 1)
    outer = np.array([np.interp(along, places, row) for row in corners])
    angle = np.pi * (1.0 - np.linspace(0.0, 1.0, along.size))
    inner = radius * np.array([np.cos(angle), np.sin(angle)])
    inner[1, [0, -1]] = 0.0
    part = np.linspace(0.0, 1.0, rows + 1)
    part = finest * part + (1.0 - finest) * part**2
    return inner[:, :, None] * (1.0 - part) + outer[:, :, None] * part, places.tolist()


def put_walls(*blocks: Block, curved: bool = False) -> None:
    """Walls on all faces of these blocks that have nothing else on them; where `curved`, the axis
    on sides that lie on y = 0."""
    for block, side in itertools.product(blocks, SIDE_NAMES):
        kind = "axis" if curved and not block.side_line(side, block.nodes)[1].any() else "wall"
        free = np.ones(block.side_faces(side)[1], dtype=int)
        for segment in block.segments:
            if segment.side == side:
                free[segment.start : segment.stop] = 0
        ends = np.flatnonzero(np.diff(np.pad(free, 1))).reshape(-1, 2)
        for start, stop in ends.tolist():
            put(block, side, kind, start, stop)


def follow_gas(block: Block, dt: float) -> np.ndarray:
    """Nodes after dt [s] that move with the mean velocity of the four cells around, by impedance.

    Weights rho c, as in a contact between sound waves: cold gas has no say before the shock.  With
    the masses as weights the nodes at the shock's foot set off late.
    """
    rho, u, v, p = block.state[:, 1:-1, 1:-1]
    impedance = rho * block.eos.sound_speed(rho, p)
    around = np.array([impedance, impedance * u, impedance * v])
    around = np.pad(around, ((0, 0), (1, 1), (1, 1)), mode="edge")
    around[1, [0, -1]] *= -1.0  # mirror images beyond the sides
    around[2][:, [0, -1]] *= -1.0
    total = (around[:, 1:, 1:] + around[:, :-1, :-1]) + (around[:, 1:, :-1] + around[:, :-1, 1:])
    return block.nodes + dt * (total[1:] / total[0])


class RadialProblem(Problem):
    """A flow of one block, "gas", that depends on the radius alone, on a rectangular grid that does
    not know it.

    In one dimension a strip, the radius being x; in two a quarter of the plane; in three the
    quarter between the axis and the plane of symmetry, in axisymmetric flow.  `peers`: what other
    codes have with 100 cells, by the deck's `geometry`.
    """

    counted = ("cells", "cells")
    t_unit = "1"
    peers: ClassVar[dict[str, str]] = {}

    def __init__(self, deck, dimensions: int):
        super().__init__(deck)
        self.dimensions = dimensions
        self.plane = dimensions == 1
        self.curved = dimensions == 3
        self.geometry = "axisymmetric" if self.curved else "plane"  # that of the `Simulation`

    def compute_density(self, r: np.ndarray, t: float) -> np.ndarray:
        """Exact density at radii r and time t."""
        raise NotImplementedError

    def lay_nodes(self, size: float) -> np.ndarray:
        """Nodes (2, cells + 1, n) of the rectangle from the centre to `size` [m]."""
        line = np.linspace(0.0, size, self.deck.cells + 1)
        return make_plane_grid(line, line[: STRIP_CELLS + 1] if self.plane else line)

    def simulate(self, blocks, links=(), kind=None, **options) -> Simulation:
        """As the base has it; the axis, and walls on sides that nothing is put on, come first."""
        put_walls(*blocks, curved=self.curved)
        return super().simulate(blocks, links, kind, geometry=self.geometry, **options)

    def compute_radii(self, points: np.ndarray) -> np.ndarray:
        """Radii (...) of points (2, ...)."""
        return np.abs(points[0]) if self.plane else np.hypot(*points)

    def measure_error(self, evolution, within: float = np.inf) -> float:
        """At the end the relative error of the density against its means over cells, sum |rho -
        exact| V / sum exact V, in r < within; NaN before, and where no cell lies within."""
        if evolution.finished is None:
            return math.nan
        (block,) = evolution.blocks

        def sample(point, _):
            weight = point[1] if self.curved else 1.0
            return self.compute_density(self.compute_radii(point), evolution.t), weight

        places = [((n + 0.5) / CELL_MEAN_POINTS, 1.0) for n in range(CELL_MEAN_POINTS)]
        exact = average_points(block.nodes, places, sample)
        weight = block.volume * (self.compute_radii(block.centres) < within)
        error = np.abs(block.rho - exact)
        whole = float((exact * weight).sum())
        return float((error * weight).sum()) / whole if whole > 0.0 else math.nan

    def list_notes(self, run: RunSoFar) -> list[str]:
        """Sentences below the report."""
        deck = self.deck
        notes = run.say_unreached("error_rho")
        known = deck.cells == 100 and deck.geometry in self.peers
        return notes + ([f"other codes: {self.peers[deck.geometry]}"] if known else [])

    def find_shock(self, block: Block) -> float:
        """Mean radius [m] of a shock that runs outwards into gas of density 1.

        On every grid line that crosses it, inwards from the far side, where the density first is
        half way from 1 to the greatest of all; in a straight line between centres.  0 where nothing
        is denser than the cold gas.
        """
        r = self.compute_radii(block.centres)
        rho = block.rho
        level = 0.5 * (1.0 + float(rho.max()))
        lines = [*zip(r.T, rho.T, strict=True), *zip(r, rho, strict=True)]
        found = np.array([find_crossing(*line, level) for line in lines])
        known = np.isfinite(found)
        return float(found[known].mean()) if level > 1.0 + 0.5 * LEAST_RISE and known.any() else 0.0

    def draw(self, figure, dump, reach: float, high: float | None = None, every: int = 0) -> None:
        """Density out to `reach` [m], and of every cell against its radius beside the exact one."""
        left, right = make_panels(figure, 11.5, 4.8, 1, 2)
        draw_field(left, dump, "rho", Colours(low=0.0, high=high), every=every, bar="density")
        if not self.plane:
            left.set(xlim=(0.0, reach), ylim=(0.0, reach))
        gas = dump["gas"]
        r = self.compute_radii(gas.centres)
        right.plot(r.ravel(), gas.rho.ravel(), ".", ms=1.5, color="tab:blue")
        r = np.linspace(1e-3, reach, 2000)
        right.plot(r, self.compute_density(r, max(dump.t, 1e-9)), color="k", lw=0.8)
        right.set(xlim=(0.0, reach), xlabel="r", ylabel="density, exact in black")
        figure.suptitle(f"{self.deck.geometry}, {title_time(dump)}", fontsize="medium")


def mix_states(eos, fraction: np.ndarray, first, second):
    """rho, u, v, p of cells with the volume `fraction` in state `first`, the rest in `second`.

    fraction: (ni, nj) in [0, 1], from `regrid.measure.cells`; the states are (rho, u, v, p) of
    numbers or arrays (ni, nj), both of the material `eos`.  Density, momentum and total energy are
    mixed; the pressure is that of the mixed energy.  Returns four arrays (ni, nj); whole cells
    (fraction 0 or 1) keep their state bitwise.
    """
    fraction = np.asarray(fraction, dtype=float)
    conserved = [compute_conserved(eos, state) for state in (first, second)]
    mixed = [
        fraction * one + (1.0 - fraction) * other for one, other in zip(*conserved, strict=True)
    ]
    state = find_held(eos, np.array(mixed))["state"]
    return tuple(
        np.where(fraction == 1.0, one, np.where(fraction == 0.0, other, value))
        for value, one, other in zip(state, first, second, strict=True)
    )


RUN_IN = 64  # cells that the shock runs before
KEPT_CELLS_BEHIND = 32  # cells behind it that keep what was computed
CELLS_AHEAD = 16  # cells before it
MARGIN_CELLS_BEHIND = 24  # cells behind the shock's first place
# of the shock's speed beside the contact: its least speed over the cells beyond that
SLOWEST_SHOCK_PART = 0.5
RUN_IN_ROWS = 2  # cells across
State = tuple[float, float, float]  # density [kg/m3], velocity outwards [m/s], pressure [Pa]


@dataclass(frozen=True)
class Front:
    """A shock that runs outwards from a contact, at `speed` [m/s], between two uniform states.

    `nodes` (n + 1): first distances [m] of the cells' nodes from the contact; the shock is at
    `nodes[place]`.  Nodes move in proportion between the contact and the last one, whose velocity
    is `end_speed` [m/s].
    """

    eos: EquationOfState
    behind: State
    ahead: State
    speed: float
    nodes: np.ndarray
    place: int
    end_speed: float

    def measure_signal(self) -> float:
        """Greatest speed [m/s] of waves through the cells, summed over both directions."""
        contact = self.behind[1]
        sound = self.eos.sound_speed
        states = self.behind, self.ahead
        return max(abs(u - contact) + 2.0 * float(sound(rho, p)) for rho, u, p in states)


def settle_front(front: Front, *, cfl: float, limiter: str) -> tuple[int, np.ndarray]:
    """The cells about a settled shock: the number of the first, and density, velocity outwards and
    pressure (3, n) of all; beyond them the uniform states go on.

    The shock's place is that of the mass in these cells.  For a material of ours the result is kept
    in the cache of kernels, until a file of the packages changes.
    """
    if not is_of_packages(type(front.eos).__module__):
        return _settle(front, cfl, limiter)
    eos = front.eos
    numbers = [getattr(front, one.name) for one in fields(front)[1:]]
    key_numbers = type(eos).__qualname__, eos.parameters, numbers, cfl, limiter
    return remember("settled", key_numbers, lambda: _settle(front, cfl, limiter))


def _settle(front: Front, cfl: float, limiter: str) -> tuple[int, np.ndarray]:
    nodes = front.nodes
    place = front.place
    contact = front.behind[1]
    # number of the strip's first node
    size = nodes[1] - nodes[0]
    lowest = place - RUN_IN - MARGIN_CELLS_BEHIND
    numbers = np.arange(lowest, min(place + CELLS_AHEAD + 4, nodes.size - 1) + 1)
    first = np.where(numbers < 0, numbers * size, nodes[np.clip(numbers, 0, nodes.size - 1)])
    begin = first[MARGIN_CELLS_BEHIND]
    relative = front.speed - contact
    rate = beyond = (front.end_speed - contact) / nodes[-1]
    if begin < 0.0:  # cells beyond the contact go on as those before it, but let a shock pass
        beyond = max(rate, SLOWEST_SHOCK_PART * relative / begin)
    stretch = np.where(first < 0.0, beyond, rate)
    duration = (nodes[place] - begin) / (relative - begin * beyond)

    def place_nodes(t):
        since = t - duration
        return contact * since + first * (1.0 + stretch * since)

    states = [(rho, 0.0, u, p) for rho, u, p in (front.behind, front.ahead)]
    ends = [{"kind": "inflow", "state": state} for state in states]
    kept = slice(place - KEPT_CELLS_BEHIND - lowest, None)
    last = place_nodes(duration)
    shift = 0.0
    for _ in range(2):  # what the shock's start leaves behind moves its place
        begin = nodes[place] - front.speed * duration + shift
        strip = Strip(front.eos, place_nodes, size, begin, states, ends)
        rho, u, p = run_strip(strip, duration, cfl=cfl, limiter=limiter)
        excess = ((rho - front.ahead[0]) * np.diff(last))[kept].sum()
        shift -= excess / (front.behind[0] - front.ahead[0]) - (nodes[place] - last[kept][0])
    start = max(0, place - KEPT_CELLS_BEHIND)
    return start, np.array([rho, u, p])[:, start - lowest :]


class Strip(NamedTuple):
    """A row of cells in which a shock runs; it lies along j, as do the cells in memory.

    place_nodes: time -> places (n + 1) [m] of the nodes; cell_width: its width over RUN_IN_ROWS
    [m]; before `begin` [m] is the first of both states (rho, 0, u, p), beyond it the second; ends:
    what the first and the last side are, as for `put`.
    """

    eos: EquationOfState
    place_nodes: Callable[[float], np.ndarray]
    cell_width: float
    begin: float
    states: Sequence[tuple[float, ...]]
    ends: Sequence[Mapping[str, Any]]


def run_strip(
    strip: Strip, duration: float, *, cfl: float, limiter: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Density, velocity and pressure (n,) of the cells of a strip after `duration` [s]."""
    x = np.broadcast_to(
        strip.cell_width * np.arange(RUN_IN_ROWS + 1.0)[:, None],
        (RUN_IN_ROWS + 1, strip.place_nodes(0.0).size),
    )

    def lay_nodes(_, t):
        nodes = np.empty((2, *x.shape))
        nodes[0] = x
        nodes[1] = strip.place_nodes(t)
        return nodes

    nodes = lay_nodes("", 0.0)
    part = compute_area_fractions(nodes, strip.begin, along="x")
    state = mix_states(strip.eos, part, *strip.states)
    block = Block("strip", strip.eos, nodes, *state, limiter=limiter)
    for side, end in zip(("j_min", "j_max"), strip.ends, strict=True):
        put(block, side, **end)
    for side in ("i_min", "i_max"):
        put(block, side, "wall")
    flow = Simulation([block], [], t_end=duration, cfl=cfl, small_cells=0.0, mesh=lay_nodes).flow
    while not take_step(flow).last:
        pass
    rho, _, u, p = block.state[:, 1, 1:-1].copy()
    return rho, u, p


USED_ROOM_PART = 0.8  # part of the room between piston and shock that it may use
MOST_KEPT = 24  # cells behind the shock that keep what was computed, at most:
CLEAN_WAY_PART = 0.5  # part of the way to the spot that the shock's start as a jump has left
CELLS_BEYOND_STRIP = 12  # cells that the strip goes on beyond the last node, for the shock's foot


@dataclass(frozen=True)
class SettledShock:
    """A plane shock on the cells of a line: nodes `x` (n + 1) [m] and, of the cells (n), density
    [kg/m3], velocity [m/s] and pressure [Pa].
    """

    eos: EquationOfState
    x: np.ndarray
    rho: np.ndarray
    u: np.ndarray
    p: np.ndarray

    def lay_on(self, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Density, velocity and pressure (ni, nj) of the cells of a grid (2, ni + 1, nj + 1).

        Each cell gets the mass, momentum and energy between the means of its near and of its far
        nodes' x; beyond the ends of the line is what is at its ends.  Rows that lie on the cells of
        the line get their states to round-off, cells ahead of the shock the state there.
        """
        momentum = self.rho * self.u
        energy = self.rho * self.eos.energy(self.rho, self.p) + 0.5 * momentum * self.u
        ends = 0.5 * (nodes[0, :, 1:] + nodes[0, :, :-1])
        x = self.x.copy()
        width = np.diff(ends, axis=0)
        means = []
        x[0], x[-1] = min(x[0], ends.min()), max(x[-1], ends.max())
        for density in (self.rho, momentum, energy):
            # of what is over the state ahead, which comes out as it is, to the last bit
            total = np.concatenate([[0.0], np.cumsum((density - density[-1]) * np.diff(x))])
            means.append(density[-1] + np.diff(np.interp(ends, x, total), axis=0) / width)
        rho, momentum, energy = means
        u = momentum / rho
        p = self.eos.pressure(rho, energy / rho - 0.5 * u * u)
        ahead = (rho == self.rho[-1]) & (u == self.u[-1])
        return rho, u, np.where(ahead, self.p[-1], p)


def settle_shock(
    eos: EquationOfState, x: np.ndarray, position: float, shock: Shock, *, cfl: float, limiter: str
) -> SettledShock:
    """A shock that stands at `position` [m] among the nodes `x` (n + 1) [m], run in.

    It runs towards larger x through gas at rest, driven by a piston at x[0]; the nodes move in
    proportion between the piston and x[-1], which rests, as in a run with straight lines; the line
    returned goes on a little beyond.  Where
    there is less room than RUN_IN cells between piston and shock it has run less.
    """
    behind = (shock.rho, 0.0, shock.particle_speed, shock.p)
    ahead = (shock.rho_ahead, 0.0, 0.0, shock.p_ahead)
    cell = int(np.clip(np.searchsorted(x, position) - 1, 0, x.size - 2))
    size = float(x[cell + 1] - x[cell])
    room = USED_ROOM_PART * (position - x[0]) / (1.0 - shock.particle_speed / shock.shock_speed)
    way = min(RUN_IN * size, room)
    duration = way / shock.shock_speed
    line = np.concatenate([x, x[-1] + (x[-1] - x[-2]) * np.arange(1.0, CELLS_BEYOND_STRIP + 1.0)])
    part = np.maximum(x[-1] - line, 0.0) / (x[-1] - x[0])

    def place_nodes(t):
        return line - part * shock.particle_speed * (duration - t)

    ends = {"kind": "piston", "velocity": (0.0, shock.particle_speed)}, {"kind": "wall"}
    strip = Strip(eos, place_nodes, size, position - way, (behind, ahead), ends)
    rho, u, p = run_strip(strip, duration, cfl=cfl, limiter=limiter)
    spot = way / size * (1.0 - shock.particle_speed / shock.shock_speed)  # cells behind the shock
    front = max(0, cell - min(MOST_KEPT, int(CLEAN_WAY_PART * spot)))
    rho[:front] = shock.rho
    u[:front] = shock.particle_speed
    p[:front] = shock.p
    return SettledShock(eos, line, rho, u, p)


@dataclass(frozen=True)
class MovingShock(Shock):
    """A plane shock in gas at rest that runs towards larger x."""

    eos: EquationOfState

    def start(self, nodes, position: float, *, cfl: float = 0.8, limiter: str = DEFAULT_LIMITER):
        """rho, u, v, p (ni, nj) of a block with the shock, settled, at x = `position` [m].

        nodes: (2, ni + 1, nj + 1) of a block that a piston at i_min pushes, `velocity=(shock.
        particle_speed, 0.0)`; its lines i = const are upright, or nearly so.  Raises BadInput for a
        shock that is not in the block.
        """
        x = nodes[0].mean(axis=1)
        if not x[0] < position < x[-1]:
            raise BadInput(f"no shock at x = {position:g} m: the block is at {x[0]:g} to {x[-1]:g}")
        line = settle_shock(self.eos, x, position, self, cfl=cfl, limiter=limiter)
        rho, u, p = line.lay_on(nodes)
        return rho, u, np.zeros_like(u), p


def shock(eos: EquationOfState, ahead: tuple[float, float], mach: float) -> MovingShock:
    """The shock of a Mach number into material at rest, `ahead` its density [kg/m3] and pressure
    [Pa]; BadInput where there is none."""
    return MovingShock(**asdict(shock_with_mach(eos, *ahead, mach)), eos=eos)
