"""Richtmyer–Meshkov instability: a shock hits a perturbed interface between two materials.

The shock, driven by a piston or an inflow, runs through the first material towards larger x; the
second material is at rest beyond the interface.  Each material is a block, and the interface is the
grid line between them.  A second, stronger shock may follow.  The problem measures the amplitude of
the interface, its growth rate and the transverse velocity in the far field.  It compares them with
linear compressible theory for the deck's materials and with non-linear models.

Use any consistent units: SI for the materials of the library, or rho = p = 1.
"""

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import put
from shockgrid.hydro.eos.gases import IdealGas
from shockgrid.hydro.eos.mixture import SEEN_FIELDS, Mixture, mix
from shockgrid.hydro.links import Link, join
from shockgrid.hydro.mixture.phases import make_fraction_fields
from shockgrid.hydro.motion.following import Sizes, ZoneFollowing
from shockgrid.hydro.motion.line import LineRule, Respacing
from shockgrid.hydro.motion.smoothing import THICK_CELLS
from shockgrid.hydro.rows import V
from shockgrid.hydro.simulation import Joining, Simulation
from shockgrid.problems.deck import MOST_CELLS
from shockgrid.problems.initial_states import put_walls, settle_shock
from shockgrid.problems.interface_instability.crossed_start import (
    CLEAR_TIME_RATIO,
    CrossedStart,
    find_nearer_speed,
)
from shockgrid.problems.interface_instability.deck import InterfaceDeck, check_sense
from shockgrid.problems.interface_instability.line import (
    FreeLine,
    Harmonic,
    Mode,
    Perturbation,
    draw_modes,
    find_harmonics,
    measure_mode,
    measure_shape,
    read_line,
)
from shockgrid.problems.interface_instability.report import Results
from shockgrid.problems.interface_instability.shocked import Echo, Shocked
from shockgrid.problems.interface_instability.spacing import (
    FINE_ZONE_WAVELENGTHS,
    NODE_SPEED,
    Spacing,
)
from shockgrid.problems.interface_instability.theories import find_cautions, sum_slopes
from shockgrid.problems.interface_instability.zone import (
    ZONE_BLOCK,
    ZONE_UNITS,
    make_zone_nodes,
    measure_contact,
    measure_line,
    measure_zone,
)
from shockgrid.problems.problem import BlockPlan, Problem
from shockgrid.problems.references.diffuse_layers import mix_densities
from shockgrid.problems.references.hugoniot import (
    Shock,
    shock_to_pressure,
    shock_with_mach,
    shock_with_particle_speed,
)
from shockgrid.problems.references.linear_growth import LinearGrowth, compute_linear_growth
from shockgrid.problems.solids import find_laws
from shockgrid.regrid.compilation.first_calls import is_interpreting
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.measure.corners import compute_centres
from shockgrid.regrid.measure.quality import find_bad_cells
from shockgrid.regrid.roots import find_root

# least reach over the amplitude: cells shrink or grow by no more than a quarter
LEAST_REACH_RATIO = 6.0
# least length over what waves take of it before a start after the passage
LEAST_LENGTH_RATIO = 1.25
MOST_SLOPE = 0.3  # sum of the k a0 up to which the state after the passage is that of linear theory
LAYER_PART = 0.1875  # of the shortest wave, to the nearer front at a start after the passage
LEAST_LAYER_CELLS = 3.0
CLEAR_LAYER_CELLS = 8.0  # that keep a captured front clear of the interface
COARSE_LAYER_PART = 0.25  # of a wave of few cells, up to CLEAR_LAYER_CELLS
# diffusion thicknesses of a layer to the shock and the far sides: nothing of it is as far away
CLEAR_THICKNESSES = 2.0
# a field needs finer cells than a line where it is to go on as fast
HANDOVER_REFINEMENT = 2
FAR_FIELD_PART = 0.25  # part of each block, counted from its far side, that is called the far field


def choose_layer(cells: float) -> float:
    """Cells between interface and nearer front at a start after the passage.

    cells: of the shortest wave.  The error that a captured front beside the interface makes falls
    with the cells only if the front is the same part of a wave away on all grids.
    """
    least = min(COARSE_LAYER_PART * cells, CLEAR_LAYER_CELLS)
    return max(LAYER_PART * cells, least, LEAST_LAYER_CELLS)


class InterfaceInstability(Results, Problem):
    Deck = InterfaceDeck
    units: ClassVar[dict[str, str]] = {
        **dict.fromkeys(("interface_mean", "interface_max", "interface_min", "amplitude"), "m"),
        **{"roughness": "m", "largest_turn": "deg", "far_transverse_speed": "m/s"},
    }

    def __init__(self, deck: InterfaceDeck, perturbation: Perturbation | None = None):
        """Check the deck; `perturbation`: heights y (n,) -> places x (n,) [m] added to its line.

        Raises BadInput for what the deck's keys say together.
        """
        super().__init__(deck)
        deck.regrid.check_weight()
        if deck.pressure == 1.0 and not (deck.first.material or deck.second.material):
            self.t_unit = "1"  # the pressure ahead of the shock is the unit
        self.eos_first, self.rho_first = deck.first.make()
        self.eos_second, self.rho_second = deck.second.make()
        self.laws = find_laws(deck, {"first": deck.first.find(), "second": deck.second.find()})
        self.k = 2.0 * math.pi / deck.wavelength
        if deck.mach is not None and deck.shock_pressure is not None:
            raise BadInput("deck: give `mach` or `shock_pressure`, not both")
        self.shock = self._make_shock()
        if late := deck.second_shock:
            if late.pressure <= self.shock.p:
                raise deck.error(
                    "second_shock.pressure",
                    f"it must be above the pressure behind the first shock, {self.shock.p:g}",
                )
            if deck.lengths is None:
                raise deck.error(
                    "lengths",
                    "with a second_shock it must be given; it is found for one shock only",
                )
        even = deck.sides == "wall"
        drawn = draw_modes(deck, even)
        check_sense(deck, (self.rho_first, self.rho_second), drawn)
        self.modes = [*deck.modes, *drawn]
        self.file_line = None
        self.free_lines = self._find_free_lines(perturbation, even)
        self.amplitude = sum(abs(mode.ka0) for mode in deck.modes) / self.k
        if drawn or self.free_lines:  # far less than the sum of their amplitudes
            y = self.make_heights()
            self.amplitude += float(np.abs(self.shape(y) - self._sum_modes(deck.modes, y)).max())
        free = [mode for line in self.free_lines for mode in line.find_modes(self.k)]
        self.harmonics = find_harmonics([*self.modes, *free], self.k)
        self.followed = [h for h in self.harmonics if h.number == 1] or [Harmonic(1, 0.0, 0.0)]
        self.followed += [h for h in self.harmonics if h.number > 1]
        self._numbers = np.array([h.number for h in self.harmonics], dtype=np.int64)
        self.units = type(self).units | {h.column: "m" for h in self.followed}
        # of the shock at the mean line, on the clock of a run that begins before it
        arrival = (deck.gap * deck.wavelength + self.amplitude) / self.shock.shock_speed
        self.is_captured = deck.start == "captured"
        self.may_hand_over = self.is_captured or deck.handover or deck.handover_kct is not None
        if self.may_hand_over:
            self.units |= ZONE_UNITS
        self._check_handover()
        self._check_diffuse_layer()
        self.start = self._choose_start()
        self.begun = arrival + self._choose_since() if self.start == "crossed" else 0.0
        self.arrival = arrival - self.begun
        if self.start == "crossed" and deck.run.t_end is None:
            wanted = (
                f"the run begins at k c t = {-self.arrival * self._rate:.3g}"
                "; take a greater one, or start = 'incident'"
            )
            if self.t_end <= 0.0:
                raise deck.error("kct_end", wanted)

    def _check_handover(self) -> None:
        """Raise BadInput for keys that one grid of both materials cannot have, and for bonds of
        fluids."""
        deck = self.deck
        name = "start" if self.is_captured else "handover"
        solids = [body for body, laws in self.laws.items() if laws.strength is not None]
        if deck.line.contact == "bonded" and len(solids) < 2:
            raise deck.error(
                "line.contact", "only solids stick together; give both materials a `strength`"
            )
        if self.may_hand_over and solids:
            raise deck.error(
                "strength", f"{name} lays both materials on one grid, whose cells bear no shear"
            )
        if self.may_hand_over and deck.refine:
            raise deck.error(
                "refine",
                f"{name} lays both materials on one grid, whose lines do not follow the interface",
            )
        if self.may_hand_over and deck.line.tension > 0.0:
            raise deck.error(
                "line.tension",
                f"{name} lays both materials on one grid, where no line has a tension",
            )

    def _check_diffuse_layer(self) -> None:
        """Raise BadInput for keys that a layer of graded density cannot have."""
        deck = self.deck
        width = CLEAR_THICKNESSES * deck.diffusion_thickness
        if not width:
            return
        if not all(isinstance(eos, IdealGas) for eos in (self.eos_first, self.eos_second)):
            raise deck.error(
                "diffusion_thickness", "only ideal gases mix into a layer of graded density"
            )
        if deck.start == "crossed":
            raise deck.error(
                "start",
                "linear theory has no state for a layer of graded density (diffusion_thickness); "
                "take 'incident'",
            )
        if width > deck.gap * deck.wavelength:
            raise deck.error(
                "gap",
                f"the shock begins inside the layer of graded density; take at least "
                f"{width / deck.wavelength:.4g}",
            )
        if deck.lengths is not None and min(deck.lengths) <= width + self.amplitude:
            raise deck.error(
                "lengths",
                f"the layer of graded density reaches the far side; each must be greater than "
                f"{width + self.amplitude:.4g}",
            )

    @functools.cached_property
    def mixture(self) -> Mixture:
        """The equation of state of both materials on one grid."""
        densities = self.rho_first, self.rho_second
        return mix(self.eos_first, self.eos_second, densities, ("first", "second"))

    def make_handover(self) -> Joining | None:
        """When and how both blocks become one, if they may."""
        if not self.may_hand_over:
            return None
        from shockgrid.hydro.remap.merging import Handover  # with scipy: slow to load

        kct = self.deck.handover_kct
        time = None if kct is None or self.is_captured else self.arrival + kct / self._rate
        is_periodic = self.deck.sides == "periodic"
        period = self.deck.width * self.deck.wavelength if is_periodic else None
        following = None
        if not self.is_captured:
            usual = self.deck.wavelength / self.deck.cells
            sizes = Sizes(usual / self.zone_refinement, usual, self.deck.stretch)
            following = ZoneFollowing(sizes)
        return Handover(
            time,
            self.mixture,
            self._make_zone_nodes,
            self._assemble_zone,
            ZONE_BLOCK,
            following=following,
            period=period,
        )

    def _make_zone_nodes(self, blocks: Sequence[Block]) -> np.ndarray:
        first, second = blocks
        sides = first.nodes[:, 0, :], second.nodes[:, -1, :]
        line = first.nodes[:, -1, :]
        return make_zone_nodes(self.deck, sides, line, self.zone_refinement)

    @property
    def zone_refinement(self) -> int:
        """Cells of the grid of both materials along each direction, for one beside the line."""
        given = self.deck.handover_refinement
        if given is None:
            return 1 if self.is_captured else HANDOVER_REFINEMENT
        return given

    def _assemble_zone(self, nodes: np.ndarray, held: dict) -> tuple:
        """The block of both materials, its links, and what makes its regridder."""
        fields = make_fraction_fields(held["mass_fraction"], held["volume_fraction"])
        state = [held[name] for name in ("rho", "u", "v", "p")]
        block = Block(
            ZONE_BLOCK,
            self.mixture,
            nodes,
            *state,
            material="first+second",
            limiter=self.deck.limiter,
            carried=fields,
        )
        # without lengths of the deck both ends go with the interface, so that the even cells do
        self._bound_ends((block, 1.0), (block, 0.0), self.deck.lengths is None)
        links = []
        if self.deck.sides == "periodic":
            links.append(join("periodic", (block, "j_min"), (block, "j_max")))
        put_walls(block)
        choice = self.choose_family(block.nodes)
        return (
            [block],
            links,
            lambda: self.deck.regrid.make(threads=self.deck.run.threads, **choice),
        )

    def _choose_start(self) -> str:
        """How the run begins: as the deck says, or after the passage where that can be had.

        Raises BadInput where the deck asks for what cannot be.
        """
        if self.deck.start == "incident" or self.deck.diffusion_thickness > 0.0:
            return "incident"
        base = self.linear_growth.base
        lengths = self.deck.lengths
        fault = ""
        if base.gap:
            fault = "the materials part behind it"
        elif lengths is not None:
            ways = self._find_ways(self._choose_since())
            short = [n for n in (0, 1) if lengths[n] < LEAST_LENGTH_RATIO * ways[n]]
            if short:
                fault = (
                    f"lengths.{short[0]} is {lengths[short[0]]:g}, of which the waves take "
                    f"{ways[short[0]]:.3g}"
                )
        if self.deck.start == "crossed":
            if fault:
                raise self.deck.error("start", f"{fault}; take 'incident'")
            return "crossed"
        begins_in_time = (
            self.deck.run.t_end is not None or self._choose_since() * self._rate < self.deck.kct_end
        )
        can_cross = (
            not fault and begins_in_time and sum_slopes(self.harmonics, self.k) <= MOST_SLOPE
        )
        return "crossed" if can_cross else "incident"

    def _choose_since(self) -> float:
        """Time [s] from the shock's arrival at the mean line to a start after the passage."""
        shortest = max((h.number for h in self.harmonics), default=1)
        cells = self.deck.layer or choose_layer(self.deck.cells / shortest)
        layer = cells * self.deck.wavelength / self.deck.cells
        passage = self.amplitude / self.shock.shock_speed
        return max(layer / find_nearer_speed(self.linear_growth.base), CLEAR_TIME_RATIO * passage)

    def _find_ways(self, since: float) -> tuple[float, float]:
        """What of both lengths [m] waves take up to `since` [s] after the shock's arrival: how far
        the piston is behind it then and the reflected wave on its way back, and the other's way."""
        base = self.linear_growth.base
        shock = self.shock
        begun = (self.deck.gap * self.deck.wavelength + self.amplitude) / shock.shock_speed + since
        back = shock.particle_speed * begun - base.left_wave.head * since
        return max(0.0, back), base.right_wave.head * since

    @functools.cached_property
    def shocked(self) -> Shocked:
        """What is known of the shock and the interface before the run."""
        single = self.deck.second_shock is None
        return Shocked(
            self.deck,
            self.eos_first,
            self.eos_second,
            self.rho_first,
            self.rho_second,
            self.shock,
            self.linear_growth,
            self.k,
            self.amplitude,
            self.harmonics,
            self.make_heights(),
            self.file_line,
            self.arrival,
            self.t_end,
            self.find_echoes() if single else {},
            self.may_hand_over,
        )

    @functools.cached_property
    def crossed(self) -> CrossedStart:
        """The state after the passage."""
        line = self.shape(self.make_heights())
        return CrossedStart(self.shocked, line, self.find_ends(), self.has_open_ends)

    def _make_shock(self) -> Shock:
        deck = self.deck
        if deck.shock_pressure is None:
            return shock_with_mach(self.eos_first, self.rho_first, deck.pressure, deck.mach or 1.5)
        if deck.shock_pressure <= deck.pressure:
            raise deck.error(
                "shock_pressure", f"it must be above the pressure ahead, {deck.pressure:g}"
            )
        return shock_to_pressure(self.eos_first, self.rho_first, deck.pressure, deck.shock_pressure)

    @property
    def thickness(self) -> float:
        """Thickness of the interface [m]: the deck's, or THICK_CELLS first cells."""
        given = self.deck.line.thickness
        return THICK_CELLS * self.deck.wavelength / self.deck.cells if given is None else given

    @functools.cached_property
    def linear_growth(self) -> LinearGrowth:
        """Linear compressible growth for the deck's materials and shock."""
        fluids = self.eos_first, self.rho_first, self.eos_second, self.rho_second
        end = max(30.0, self.deck.kct_end)
        return compute_linear_growth(*fluids, self.deck.pressure, self.shock.p, kct_end=end)

    @functools.cached_property
    def c_first(self) -> float:
        """Sound speed [m/s] of the first material behind the wave that the interface sends back."""
        base = self.linear_growth.base
        return float(self.eos_first.sound_speed(base.rho_left, base.p))

    @property
    def t_end(self) -> float:
        """End time: the deck's, or the one its `kct_end` means."""
        if self.deck.run.t_end is not None:
            return self.deck.run.t_end
        return self.arrival + self.deck.kct_end / self._rate

    @property
    def _rate(self) -> float:
        """k c [1/s]."""
        return self.k * self.linear_growth.sound_speed

    def shape(self, y: np.ndarray) -> np.ndarray:
        """First place x of the interface at the heights `y` (its mean is x = 0)."""
        places = self._sum_modes(self.modes, y)
        for line in self.free_lines:
            places = places + line.get_places(y)
        return places

    def _sum_modes(self, modes: list[Mode], y: np.ndarray) -> np.ndarray:
        waves = (
            mode.ka0 / self.k * np.cos(mode.number * self.k * y + mode.phase) for mode in modes
        )
        return sum(waves, np.zeros_like(y))

    def _find_free_lines(self, perturbation: Perturbation | None, even: bool) -> list[FreeLine]:
        """Lines that are no sums of modes: of the deck's file, of a function."""
        deck = self.deck
        y = self.make_heights()
        sources = [("the perturbation", perturbation)] if perturbation is not None else []
        if deck.line_file is not None:
            self.file_line = read_line(deck.line_file, y[-1], deck.line_curve)
            sources.append((f"line_file {deck.line_file!r}", self.file_line))
        return [FreeLine(source, y, even, what) for what, source in sources]

    def make_heights(self) -> np.ndarray:
        """First heights y (n,) [m] of the interface's nodes."""
        width = self.deck.width * self.deck.wavelength
        return np.linspace(0.0, width, self.count_rows() + 1)

    def count_rows(self) -> int:
        """Cells along the interface; BadInput for more than a side may have."""
        rows = max(2, round(self.deck.cells * self.deck.width))
        if rows > 10 * MOST_CELLS:
            raise self.deck.error(
                "width",
                f"that makes {rows:.3g} cells along the interface; it may have {10 * MOST_CELLS}",
            )
        return rows

    @property
    def has_open_ends(self) -> bool:
        """Do the far sides go with the interface, open to what lies beyond them?

        Cells then keep their size: a shock over cells that shrink leaves a wrong density behind.
        """
        return self.start == "crossed" and self.deck.lengths is None

    def find_ends(self) -> tuple[float, float]:
        """First places x [m] of the far sides."""
        first, second = self.choose_lengths()
        if self.has_open_ends:
            place = -self.linear_growth.base.u * self.arrival
            return place - first, place + second
        return self.shock.particle_speed * self.begun - first, second

    def choose_lengths(self) -> tuple[float, float]:
        """Lengths of the two materials: the deck's, or such that no echo returns in time.

        Open ends are so far from the interface that no wave reaches them.
        """
        if self.deck.lengths is not None:
            return self.deck.lengths
        base = self.linear_growth.base
        t0 = self.arrival
        t_end = self.deck.run.t_set_up or self.t_end
        margin = self.amplitude + 0.5 * self.deck.wavelength
        if self.has_open_ends:
            waves = base.u - base.left_wave.head, base.right_wave.head - base.u
            return tuple(1.02 * wave * (t_end - t0) + margin for wave in waves)

        def late_echo(length):
            return self._find_first_echo(length) - t_end

        least = margin + 2.0 * self.deck.gap * self.deck.wavelength
        longest = 50.0 * self.c_first * t_end + least
        first = least if late_echo(least) >= 0.0 else find_root(late_echo, least, longest)
        front, back = self._find_second_echo()
        second = (t_end - t0) * front * back / (front - base.u + back)
        return 1.02 * first + margin, 1.02 * second + margin

    def _find_first_echo(self, length: float) -> float:
        """When the wave that the interface sends to the piston is back, at the earliest [s]."""
        base = self.linear_growth.base
        t0 = self.arrival
        push = self.shock.particle_speed
        head = base.left_wave.head
        first = push * self.begun - length  # the piston's first place
        meet = -(first + head * t0) / (push - head)
        position = push * meet + first
        gap = base.u * (meet - t0) - position
        return meet + gap / self._find_chase()

    def _find_chase(self) -> float:
        """At most how fast the wave that the piston sends back nears the interface [m/s]."""
        u = self.linear_growth.base.u
        return 1.1 * self.c_first + max(self.shock.particle_speed, u) - u

    def _find_second_echo(self) -> tuple[float, float]:
        """Speeds [m/s] of the transmitted shock, and of the one back from the far wall."""
        base = self.linear_growth.base
        echo = shock_with_particle_speed(self.eos_second, base.rho_right, base.p, base.u)
        return base.right_wave.head, echo.shock_speed

    def find_echoes(self) -> dict[str, Echo]:
        """Waves that are back from the far ends, by the block's name."""
        first, second = self.choose_lengths()
        base = self.linear_growth.base
        if self.has_open_ends:
            waves = (
                ("first", first, base.u - base.left_wave.head, self.c_first),
                ("second", second, base.right_wave.head - base.u, self.linear_growth.sound_speed),
            )
            return {
                name: Echo(self.arrival + way / out + way / c, c) for name, way, out, c in waves
            }
        front, back = self._find_second_echo()
        late = second * (front - self.linear_growth.base.u + back) / (front * back)
        return {
            "first": Echo(self._find_first_echo(first), self._find_chase()),
            "second": Echo(self.arrival + late, back),
        }

    @functools.cached_property
    def spacing(self) -> Spacing:
        """Cells across the interface of a run that begins before the shock's passage.

        A weight of the regridder places its cells itself.
        """
        finer = self.start == "incident" and not self.deck.regrid.weight
        return Spacing(self.deck, self.deck.passage_refinement if finer else 1.0)

    def make_respacing(self) -> Respacing | None:
        """How cells that are finer for the passage grow when its waves have left them."""
        if self.spacing.finer == 1.0:
            return None
        base = self.linear_growth.base
        laws = {}
        ways = []
        for name, length in zip(("first", "second"), self.choose_lengths(), strict=True):
            law = self.spacing.make_last_spacing(length)
            ways.append(np.abs(law * length - self.spacing.make(length)).max())
            laws[name] = law if name == "second" else (1.0 - law)[::-1]
        start = (
            self._find_last_arrival()
            + FINE_ZONE_WAVELENGTHS * self.deck.wavelength / find_nearer_speed(base)
        )
        slowest = min(self.linear_growth.sound_speed, self.c_first)
        return Respacing(laws, start, start + 1.5 * max(ways) / (NODE_SPEED * slowest))

    def estimate_cells(self) -> int:
        """Rows of the interface times the columns of `spacing`, without making them."""
        columns = sum(self.spacing.make(length).size - 1 for length in self.choose_lengths())
        return columns * self.count_rows()

    def make_interface(self) -> np.ndarray:
        """First nodes (2, n) of the interface, a place for each height; lengths are checked."""
        deck = self.deck
        y = self.make_heights()
        front = self.shape(y)
        lengths = self.choose_lengths()
        start = deck.gap * deck.wavelength + self.amplitude
        if min(lengths) <= 2.0 * self.amplitude:
            raise deck.error(
                "lengths",
                f"each must be greater than twice the interface's amplitude, {self.amplitude:g}",
            )
        if lengths[0] <= start:
            raise deck.error(
                "lengths", f"the first must be greater than {start:g}, the gap and the amplitude"
            )
        return np.array([front, y])

    def plan(self) -> tuple[float, list[BlockPlan]]:
        """End time and sizes of both blocks."""
        front, y = self.make_interface()
        low, high = self.find_ends()
        columns = [len(self.spacing.make(length)) - 1 for length in self.choose_lengths()]
        if self.start == "crossed":  # whose cells fit to the fronts
            columns = [side.away.size - 1 for side in self.crossed.sides]
            front = front - self.linear_growth.base.u * self.arrival
        spans = (("first", low, front.max()), ("second", front.min(), high))
        plans = [
            BlockPlan(name, (count, len(y) - 1), (float(low), 0.0), (float(high), float(y[-1])))
            for count, (name, low, high) in zip(columns, spans, strict=True)
        ]
        return self.t_end, plans

    def make_grids(self) -> Sequence[np.ndarray]:
        """First grids of both blocks: lines parallel to the far sides, bent near the interface.

        A shock that runs over bent lines meets cells of other sizes in every row, and prints that.
        The bend fades out without a change of the cells' size at either end.  Those of a start
        after the shock's passage: see `crossed_start`.
        """
        front, y = self.make_interface()
        if self.start == "crossed":
            grids = [side.make_nodes() for side in self.crossed.sides]
            if any(len(find_bad_cells(grid)) for grid in grids):
                raise self.deck.error(
                    "start",
                    "the interface is too steep for a first grid by linear theory; take 'incident'",
                )
            return grids
        reach = max(self.deck.reach * self.deck.wavelength, LEAST_REACH_RATIO * np.abs(front).max())
        grids = []
        for sign, length in zip((-1.0, 1.0), self.choose_lengths(), strict=True):
            away = self.spacing.make(length)
            away = away[::-1] if sign < 0.0 else away
            left = np.maximum(0.0, 1.0 - away / min(reach, length))
            part = left * left * (3.0 - 2.0 * left)
            x = front[None, :] * part[:, None] + sign * away[:, None]
            grids.append(np.array([x, np.broadcast_to(y, x.shape)]))
        return grids

    def build(self) -> Simulation:
        """Blocks at the start: the shock, run in, `gap` waves before the interface or beyond it."""
        deck = self.deck
        grids = self.make_grids()
        blocks, links, make_regridder = self.assemble(grids, self._make_states(grids))
        del grids  # the blocks have them
        refining = None
        if deck.refine:
            from shockgrid.hydro.remap.flow import Refinement  # with scipy: slow to load

            refining = Refinement(blocks, self.assemble)
        simulation = self.simulate(
            blocks,
            links,
            line_rule=LineRule(
                deck.line.shape, deck.line.relax, self.thickness, self.make_respacing()
            ),
            make_regridder=make_regridder,
            refining=refining,
            handover=self.make_handover(),
        )
        if self.is_captured and not is_interpreting():
            simulation.hand_over()
        return simulation

    def _make_states(self, grids: Sequence[np.ndarray]) -> Sequence:
        """rho, u, v, p of the cells of both blocks, which have these grids."""
        deck = self.deck
        if self.start == "crossed":
            return self.crossed.make_states()
        spacing = -self.spacing.make(self.choose_lengths()[0])[::-1]
        position = -(deck.gap * deck.wavelength + self.amplitude)
        choice = {"cfl": deck.run.cfl, "limiter": deck.limiter}
        shock = settle_shock(self.eos_first, spacing, position, self.shock, **choice)
        rho, u, p = shock.lay_on(grids[0])
        rho_second = self.rho_second
        if deck.diffusion_thickness > 0.0:
            layer_first, layer_second = map(self._grade_density, grids)
            rho = rho + layer_first - self.rho_first
            rho_second = layer_second
        return (rho, u, 0.0, p), (rho_second, 0.0, 0.0, deck.pressure)

    def _grade_density(self, grid: np.ndarray) -> np.ndarray:
        """Density (ni, nj) of the diffuse layer in the cells of a grid."""
        x, y = compute_centres(grid)
        rho = self.rho_first, self.rho_second
        return mix_densities(x - self.shape(y), self.deck.diffusion_thickness, rho)

    def assemble(self, grids, states) -> tuple[list[Block], list[Link], Callable[[], object]]:
        """Both blocks on their first grids with states rho, u, v, p, between the piston and the
        far wall or between open ends; their links, and what makes their regridders."""
        deck = self.deck
        first, second = blocks = [
            Block(
                name,
                eos,
                grid,
                *state,
                material=name,
                limiter=deck.limiter,
                **self.laws[name].options,
            )
            for name, eos, grid, state in zip(
                ("first", "second"), (self.eos_first, self.eos_second), grids, states, strict=True
            )
        ]
        contact: dict[str, Any] = {"tension": deck.line.tension}
        if deck.line.contact == "bonded":
            contact["bonded"] = True
        links = [join("interface", (first, "i_max"), (second, "i_min"), **contact)]
        self._bound_ends((first, None), (second, None), self.has_open_ends)
        if deck.sides == "periodic":
            links += [join("periodic", (block, "j_min"), (block, "j_max")) for block in blocks]
        put_walls(*blocks)
        # The sides that deform are known.  Lines straight from wall to wall, too, would meet the
        # walls at an angle; with their mirror images they make a kink, and the crest gets one.
        # Each line keeps the law that it has at first: a mean of the outer ones' would bend lines.
        choices = iter([self.choose_family(block.nodes) for block in blocks])
        return blocks, links, lambda: deck.regrid.make(threads=deck.run.threads, **next(choices))

    def _bound_ends(self, low: tuple, high: tuple, are_open: bool) -> None:
        """Put what bounds the far sides of two blocks, or of one: open ends, or the piston.

        low, high: a block, and what its material there has of the fractions, None without these.
        """
        if not are_open:
            put(low[0], "i_min", "piston", velocity=self.make_piston())
            return
        shock = self.shock
        behind = shock.rho, shock.particle_speed, 0.0, shock.p
        ahead = self.rho_second, 0.0, 0.0, self.deck.pressure
        for (block, part), side, state in ((low, "i_min", behind), (high, "i_max", ahead)):
            options = {} if part is None else {"carried": dict.fromkeys(SEEN_FIELDS, part)}
            speed = self.linear_growth.base.u, 0.0
            put(block, side, "inflow", state=state, velocity=speed, **options)

    def choose_family(self, nodes: np.ndarray) -> dict:
        """Options of the regridder of a block with these first nodes, besides the deck's."""
        regrid = self.deck.regrid
        if regrid.name != "barrier":
            return {}
        keeps = regrid.method == "newton" and "family" not in regrid.options
        return {"family": "i", "first_grid": nodes} if keeps else {"family": "i"}

    def _make_second_shock(self) -> tuple[float, Shock]:
        """When [s] the piston sends it, and what it is in the first material."""
        late = self.deck.second_shock
        later = shock_to_pressure(self.eos_first, self.shock.rho, self.shock.p, late.pressure)
        return self.arrival + late.kct / self._rate, later

    def _find_last_arrival(self) -> float:
        """When [s] the last shock meets the interface, about."""
        if self.deck.second_shock is None:
            return self.arrival
        start, later = self._make_second_shock()
        piston = self.shock.particle_speed
        interface = self.linear_growth.base.u
        between = interface * (start - self.arrival) + self.choose_lengths()[0] - piston * start
        return start + max(0.0, between / (piston + later.shock_speed - interface))

    def make_piston(self):
        """Velocity of the piston as a function of time."""
        speed = self.shock.particle_speed
        if self.deck.second_shock is None:
            return (speed, 0.0)
        start, later = self._make_second_shock()

        def velocity(t):
            return (speed if t < start else speed + later.particle_speed, 0.0)

        return velocity

    def measure(self, evolution: Simulation) -> dict[str, float]:
        """Amplitudes and places of the interface, and transverse motion in the far field."""
        first = evolution.blocks[0]
        is_periodic = self.deck.sides == "periodic"
        far = {"far_transverse_speed": max(map(measure_far_speed, evolution.blocks))}
        if first.name == ZONE_BLOCK:
            contact = measure_contact(first, self.k, self.followed)
            return contact | far | measure_zone(first, self.make_heights(), is_periodic)
        line = first.nodes[:, -1, :]
        mean, most, least, roughness, turn = measure_shape(
            line, self.k, self._numbers, not is_periodic
        )
        zone = {}
        if self.may_hand_over:
            zone = measure_line(evolution.blocks, self.make_heights(), is_periodic)
        return {
            "interface_mean": mean,
            "interface_max": most,
            "interface_min": least,
            "amplitude": 0.5 * (most - least),
            **{h.column: measure_mode(line, self.k, h.number, h.phase) for h in self.followed},
            "roughness": roughness,
            "largest_turn": math.degrees(turn),
            **far,
            **zone,
        }

    def cautions(self, run) -> list[str]:
        return find_cautions(self.shocked, run)


def measure_far_speed(block: Block) -> float:
    """The greatest transverse speed [m/s] in the far field of a block."""
    depth = max(1, int(FAR_FIELD_PART * block.ni))
    if block.name == ZONE_BLOCK:
        ends = block.state[V, 1 : depth + 1, 1:-1], block.state[V, -depth - 1 : -1, 1:-1]
        return max(float(np.abs(v).max()) for v in ends)
    start = 1 if block.name == "first" else block.ni - depth + 1
    v = block.state[V, start : start + depth, 1:-1]
    return max(0.0, float(v.max()), -float(v.min()))
