"""A block: a structured grid of one material, its state, and its perimeter of segments.

The new state of a step has arrays of its own, so a step can be rejected at no cost until `accept`
swaps them.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

import numpy as np

from shockgrid.hydro.carried.fields import CarriedField, read_fields
from shockgrid.hydro.carried.transport import Transport
from shockgrid.hydro.eos import EquationOfState
from shockgrid.hydro.eos.base import check_eos, check_formulas
from shockgrid.hydro.eos.conversion import compute_energy, compute_temperature
from shockgrid.hydro.eos.mixture import SEEN_FIELDS, Mixture
from shockgrid.hydro.formulas.geometry import PLANE, Geometry, compute_volumes
from shockgrid.hydro.formulas.reconstruction import (
    DEFAULT_LIMITER,
    FIRST_ORDER_LIMITER,
    LIMITERS,
    limit_gently,
    limit_van_leer,
)
from shockgrid.hydro.formulas.riemann import DEFAULT_FLUX, HLL_JUMP_THRESHOLDS
from shockgrid.hydro.interior.advance import count_tiles
from shockgrid.hydro.interior.cell_fields import (
    SLAB_ROWS,
    CellFields,
    check_first_state,
    make_fill_sound_speed,
)
from shockgrid.hydro.kernels import BlockKernels
from shockgrid.hydro.mixture.phases import MixedCells
from shockgrid.hydro.mixture.sides import RIM_FIELDS
from shockgrid.hydro.perimeter.contacts import fill_open_flux
from shockgrid.hydro.perimeter.plan import PerimeterPlan
from shockgrid.hydro.rim import RHO_BEYOND, find_first_face, make_rim
from shockgrid.hydro.rows import (
    HELD_ARRAYS,
    MIXED_TOTAL_ROWS,
    RHO,
    TOTAL_ROWS,
    P,
    U,
    V,
    make_held,
)
from shockgrid.hydro.strength.laws.base import StrengthLaw
from shockgrid.hydro.strength.spall.base import SpallLaw
from shockgrid.hydro.strength.stress import Stress, add_stress_fields, stiffen_wave_law
from shockgrid.hydro.totals import TileTotals
from shockgrid.regrid.errors import BadInput, Place, RunFailure, suggest
from shockgrid.regrid.measure.corners import compute_centres
from shockgrid.regrid.measure.quality import find_bad_cells
from shockgrid.regrid.sides import J_MIN, SIDE_NAMES, get_side, get_sides

UNITS = {"rho": "kg/m3", "u": "m/s", "v": "m/s", "p": "Pa", "e": "J/kg", "T": "K"}
LONG_NAMES = {
    "rho": "density",
    "u": "velocity x",
    "v": "velocity y",
    "p": "pressure",
    "e": "specific internal energy",
    "T": "temperature",
}


def _check_name(name: object, what: str, forbidden: str = "/,") -> None:
    """Raise BadInput for a name invalid in dumps and histories, or with `forbidden` characters."""
    if not isinstance(name, str):
        raise BadInput(f"{what} is called {name!r}: a name is text")
    if not name.strip() or name == "." or not name.isprintable() or set(name) & set(forbidden):
        signs = " or ".join(forbidden)
        raise BadInput(f"{what} is called {name!r}: a name has one sign at least, and no {signs}")


def _check_choice(name: str, what: str, choice: object, choices: Collection[str]) -> None:
    """Raise BadInput where a block's limiter or flux is none of the `choices`."""
    if not isinstance(choice, str) or choice not in choices:
        hint = suggest(choice, choices) if isinstance(choice, str) else ""
        raise BadInput(
            f"block {name!r}: there is no {what} {choice!r}{hint}; there are: {', '.join(choices)}"
        )


def _read_nodes(name: str, nodes: Any) -> np.ndarray:
    """The nodes (2, ni + 1, nj + 1) of a new block; raises BadInput where they make no grid."""
    try:
        nodes = np.array(nodes, dtype=np.float64, order="C")
    except (TypeError, ValueError) as error:
        raise BadInput(f"block {name!r}: its nodes are not an array of numbers ({error})") from None
    if nodes.ndim != 3 or nodes.shape[0] != 2 or min(nodes.shape[1:]) < 3:
        raise BadInput(
            f"block {name!r}: nodes have shape {nodes.shape}; "
            "they must be (2, ni + 1, nj + 1) with at least 2 cells each way"
        )
    bad_cells = find_bad_cells(nodes)
    if len(bad_cells):
        i, j = (int(index) for index in bad_cells[0])
        raise BadInput(
            f"block {name!r}: {len(bad_cells)} cells of the first grid are not convex or are "
            f"turned over (the first is cell i={i}, j={j}); i and j must turn counter-clockwise"
        )
    return nodes


def _read_parameters(eos: EquationOfState) -> tuple:
    """The numbers of an equation of state, of types for which kernels are compiled."""
    if isinstance(eos, Mixture):
        return eos.parameters
    return tuple(
        np.ascontiguousarray(value, dtype=float) if np.ndim(value) else float(value)
        for value in eos.parameters
    )


class Block:
    """One material on one structured grid: nodes, state, equation of state and segments.

    `hydro.phases` advances it, with the kernels of `kernels`; its sums are in `totals`.
    nodes (2, ni + 1, nj + 1); rho, u, v, p: numbers or arrays (ni, nj), cell averages, SI.
    flux: "hllc", with HLL at strong shocks, or "hll" on all faces, which damps the errors that
    skewed grid lines leave behind a shock, but smears contacts inside the block.
    carried: fields that move with the mass, `hydro.carried`; their values are in `carried`
    (fields, ni + 2, nj + 2).
    strength: law of a solid, `hydro.strength.laws`; its stress and plastic strain are then the
    first carried fields.  None: a fluid.
    spall: law by which a solid opens under tension, `hydro.strength.spall`.  None: voids open at
    the tension of the equation of state.
    Raises BadInput for a grid with a bad cell, for a density or sound speed that is not positive,
    and for an equation of state whose formulas disagree.
    """

    def __init__(
        self,
        name: str,
        eos: EquationOfState,
        nodes: np.ndarray,
        rho,
        u,
        v,
        p,
        *,
        material: str | None = None,
        limiter: str = DEFAULT_LIMITER,
        flux: str = DEFAULT_FLUX,
        carried: Sequence[CarriedField] = (),
        strength: StrengthLaw | None = None,
        spall: SpallLaw | None = None,
    ):
        _check_name(name, "a block")
        _check_name(material or name, f"the material of block {name!r}", forbidden=",")
        check_eos(name, eos)
        _check_choice(name, "limiter", limiter, (*LIMITERS, FIRST_ORDER_LIMITER))
        _check_choice(name, "flux", flux, HLL_JUMP_THRESHOLDS)
        self.name = name
        self.material = material or name
        self.eos = eos
        self.nodes = _read_nodes(name, nodes)
        self.ni, self.nj = (size - 1 for size in self.nodes.shape[1:])
        held = make_held(self.ni, self.nj)
        self.state = held["state"]
        self._read_state({"rho": rho, "u": u, "v": v, "p": p})
        if not isinstance(eos, Mixture):  # whose formulas need the fractions of each cell
            check_first_state(name, eos, self.state[:, 1:-1, 1:-1])
            check_formulas(name, eos, *self.state[[RHO, P], 1:-1, 1:-1])
        # what a step finds besides the state: rates of the cells (theory F7.1), their crowding on
        # the new grid (F7.3), and the number of those that were redistributed
        self.rates = np.zeros((self.ni, self.nj))
        self.rates_new = np.zeros((self.ni, self.nj))
        self.crowding = np.zeros((self.ni, self.nj))
        self.redistributed_cells = 0
        # made after those: memory freed by the checks is reused for arrays that are written anyway
        self.nodes_new = self.nodes.copy()
        self.state_new: np.ndarray
        for array_name, array in make_held(self.ni, self.nj).items():
            setattr(self, array_name, held[array_name])
            setattr(self, f"{array_name}_new", array)
        self.strength = strength
        self.stress: Stress | None = None
        if strength is not None:
            carried = add_stress_fields(name, eos, tuple(carried), spall)
            self.stress = Stress(strength, self.ni, self.nj, spall)
        elif spall is not None:
            raise BadInput(f"block {name!r}: a law of spall wants a law of strength besides")
        self._carry(carried)
        self.mixed = self._mix(eos, limiter, flux) if isinstance(eos, Mixture) else None
        self._start_copies: dict[str, np.ndarray] = {}  # separate if a body source acts
        # the equation of state's numbers, of the types for which kernels are compiled, as those of
        # a user's own need not be
        self.parameters = _read_parameters(eos)
        self.wave_law = tuple(float(value) for value in eos.wave_law)
        if strength is not None:
            self.wave_law = stiffen_wave_law(self.wave_law, eos, strength)
        self.limiter = limiter
        self.flux_name = flux
        self.kernels = BlockKernels(type(eos), limiter, flux, strength is not None)
        # which cells this process updates, and whether it holds all of them (`hydro.ranks`)
        self.set_own_rows(0, self.ni)
        self.is_here = True
        columns = MIXED_TOTAL_ROWS if self.mixed else TOTAL_ROWS
        self.totals = TileTotals(count_tiles(self.ni, self.nj), columns)
        # the perimeter: its faces, accelerations (2, faces) by a body source of their cells, and
        # volumes of polygon cells beyond their straight faces
        faces = 2 * (self.ni + self.nj)
        self.rim = make_rim(faces, RIM_FIELDS if self.mixed else len(self.carried_fields))
        self.body_acceleration: np.ndarray | None = None
        self.excess_volume = np.zeros(faces)
        self.excess_volume_new = np.zeros(faces)
        self.segments: list[Any] = []  # `hydro.boundary.put` adds them
        self.set_geometry(PLANE)

    def _read_state(self, values_by_name: Mapping[str, Any]) -> None:
        """Fill the first state with numbers, arrays (ni, nj) or functions of the cells' centres."""
        for row, (label, value) in enumerate(values_by_name.items()):
            value = value(*self.centres) if callable(value) else value
            try:
                self.state[row, 1:-1, 1:-1] = value
            except (TypeError, ValueError):
                if not np.shape(value):
                    raise BadInput(
                        f"block {self.name!r}: {label} is {value!r}, no number"
                    ) from None
                raise BadInput(
                    f"block {self.name!r}: {label} has shape {np.shape(value)}; "
                    f"the block has {self.ni} x {self.nj} cells"
                ) from None

    def _carry(self, fields_given: Sequence[CarriedField]) -> None:
        """Give the cells carried fields, and name what they hold (`HELD_ARRAYS` and these)."""
        self.carried_fields = fields = read_fields(self.name, fields_given)
        self.carried = np.zeros((len(fields), self.ni + 2, self.nj + 2))
        self.carried_new = np.zeros(self.carried.shape)
        for number, field in enumerate(fields):
            self.carried[number, 1:-1, 1:-1] = field.find_first(self.name, self.centres)
        limit = limit_van_leer if self.stress is None else limit_gently
        moved = 0 if isinstance(self.eos, Mixture) else len(fields)  # fractions move by themselves
        self.transport = Transport(moved, self.ni, self.nj, limit)
        self.held_arrays = (*HELD_ARRAYS, "carried") if fields else HELD_ARRAYS
        self.step_arrays = ("nodes", *self.held_arrays, "rates")
        self.units = UNITS | {field.name: field.unit for field in fields}
        self.long_names = LONG_NAMES | {
            field.name: field.long_name or field.name for field in fields
        }

    def _mix(self, eos: Mixture, limiter: str, flux: str) -> MixedCells:
        """What cells of two materials need besides; BadInput where they do not carry fractions."""
        names = tuple(field.name for field in self.carried_fields)
        if names != SEEN_FIELDS:
            raise BadInput(
                f"block {self.name!r}: its equation of state is a mixture; carried must be what "
                "make_fraction_fields gives, and nothing else"
            )
        check_first_state(self.name, eos, self.state[:, 1:-1, 1:-1], self.carried[:, 1:-1, 1:-1])
        return MixedCells(eos, limiter, flux, (self.ni, self.nj))

    @property
    def eos_of_cells(self) -> EquationOfState:
        """The equation of state, with the fractions of all cells (ni, nj) where it sees them."""
        return self.eos.with_fields(self.carried[:, 1:-1, 1:-1])

    def set_geometry(self, geometry: Geometry) -> None:
        """Make the flow plane or axisymmetric; called by the simulation.

        Raises BadInput if an axisymmetric block extends below the axis y = 0.
        """
        self.geometry = geometry
        self._plan = PerimeterPlan([], self.rim.faces)
        self.kernels.set_geometry(geometry)
        lowest = self.nodes[1].min()
        if geometry.curved and lowest < 0.0:
            raise BadInput(
                f"block {self.name!r}: its nodes reach down to y = {lowest:g} m; "
                "in axisymmetric flow y is the radius and may not be negative"
            )

    # --- perimeter -----------------------------------------------------------------------------

    def side_faces(self, side: str) -> tuple[int, int]:
        """First face of a side on the perimeter, and the number of its faces."""
        if side not in SIDE_NAMES:
            hint = suggest(side, SIDE_NAMES, cutoff=0.85)  # "x_min" is ambiguous
            raise BadInput(f"block {self.name!r} has no side {side!r}{hint}")
        code = SIDE_NAMES.index(side)
        count = self.nj if code < J_MIN else self.ni
        return find_first_face(code, self.ni, self.nj), count

    def side_line(self, side: str, nodes: np.ndarray) -> np.ndarray:
        """View (2, n + 1) of the nodes of a side."""
        return get_side(nodes, side)

    def fill_open_flux(self, spans: np.ndarray) -> None:
        """Outward fluxes between traces and the states beyond, through the faces `spans` (n, 2).

        For kinds of segments (`fill_flux`) that write the state beyond themselves.
        """
        opened = np.array([(first, last, RHO_BEYOND) for first, last in spans])
        fill_open_flux(self.rim.rows, opened, self.geometry.curved)

    # --- states of a step ----------------------------------------------------------------------

    @property
    def centres(self) -> np.ndarray:
        """Centres of the cells (2, ni, nj) [m], computed at every access."""
        return compute_centres(self.nodes)

    @property
    def plan(self) -> PerimeterPlan:
        """Data of the segments for the phases; rebuilt when the segments change."""
        if self._plan.segments != self.segments:
            self._plan = PerimeterPlan(self.segments, self.rim.faces)
        return self._plan

    @staticmethod
    def gather_perimeter(field: np.ndarray) -> np.ndarray:
        """Values (2, faces) of a field (2, ni, nj) in the cells along the perimeter."""
        return np.concatenate(get_sides(field), axis=1)

    def set_own_rows(self, first: int, last: int) -> None:
        """From now on update only the cell rows first..last - 1, which are whole rows of tiles."""
        self.rows = range(first, last)
        self.tiles = count_tiles(first, self.nj), count_tiles(last, self.nj)

    @property
    def is_cut(self) -> bool:
        """Whether this process updates only some of the rows of cells (`hydro.ranks`)."""
        return len(self.rows) < self.ni

    def count_ghosts(self, array: np.ndarray) -> int:
        """Rows of ghosts before the first cells in an array of this block: 1 or 0."""
        return int(array.shape[-2] == self.ni + 2)

    def get_inside(self, name: str) -> np.ndarray:
        """A view, without ghosts, of the block's array of this name (see `step_arrays`)."""
        array = getattr(self, name)
        return array[..., 1:-1, 1:-1] if self.count_ghosts(array) else array

    def list_new(self, names: Sequence[str] = HELD_ARRAYS) -> list[np.ndarray]:
        """The arrays that a step makes: the flow's own, or those named of `held_arrays`."""
        return [getattr(self, f"{name}_new") for name in names]

    def list_starts(self, names: Sequence[str] = HELD_ARRAYS) -> list[np.ndarray]:
        """The arrays that a step starts from, of such names; see `get_start`."""
        return [self.get_start(name) for name in names]

    def get_start(self, name: str) -> np.ndarray:
        """One of `held_arrays` as a step starts from it: the present one, or a source's copy."""
        return self._start_copies.get(name, getattr(self, name))

    @property
    def start(self) -> np.ndarray:
        """The state (4, ni + 2, nj + 2) that a step starts from."""
        return self.get_start("state")

    def use_start_copies(self, wanted: bool) -> None:
        """Set whether steps start from copies of what cells hold, which a source may modify."""
        self._start_copies = {
            name: getattr(self, name).copy() for name in self.held_arrays if wanted
        }

    def copy_start(self) -> None:
        """Let the next step start from the present state, where it starts from copies."""
        for name, copy in self._start_copies.items():
            copy[...] = getattr(self, name)

    @property
    def is_follower(self) -> bool:
        """Whether a sliding contact places nodes of this block on another's line."""
        return self.plan.is_follower

    def accept(self) -> None:
        """Make the new grid and state the current ones."""
        for name in self.step_arrays:
            old = getattr(self, name)
            setattr(self, name, getattr(self, f"{name}_new"))
            setattr(self, f"{name}_new", old)

    def find_failure(self) -> RunFailure | None:
        """Why the new state is not admissible, with the cell's indices, or None."""
        rho, _, _, p = self.state_new[:, 1:-1, 1:-1]
        with np.errstate(all="ignore"):
            c = self.eos.with_fields(self.carried_new[:, 1:-1, 1:-1]).sound_speed(rho, p)
        is_bad = ~((rho > 0.0) & (c > 0.0))
        if not is_bad.any():
            return self._find_failed_totals()
        i, j = (int(index) for index in np.argwhere(is_bad)[0])
        rho, p = self.state_new[[RHO, P], i + 1, j + 1]
        known = f", its pressure {p:.6g} Pa" if np.isfinite(p) else ""
        return RunFailure(
            f"flow: block {self.name!r}, cell i={i}, j={j}: {self.eos.failure}; "
            f"its density is {rho:.6g} kg/m3{known}",
            cause=self.eos.failure_cause,
            place=Place(self.name, (i, j)),
        )

    def _find_failed_totals(self) -> RunFailure | None:
        """Why the totals of the new state are none though every cell has a state, or None."""
        lost_totals = self.totals.find_lost()
        if lost_totals:
            return RunFailure(
                f"flow: block {self.name!r}: its {' and '.join(lost_totals)} cannot be summed to a "
                "finite number, though the state of every cell is one",
                cause=self.eos.failure_cause,
                place=Place(self.name),
            )
        if self.redistributed_cells:
            return None  # the failed cells have been redistributed since
        flat_cells = find_bad_cells(self.nodes_new)
        cell = (int(flat_cells[0, 0]), int(flat_cells[0, 1])) if len(flat_cells) else None
        where = f"cell i={cell[0]}, j={cell[1]}" if cell else "a cell"
        return RunFailure(
            f"flow: block {self.name!r}: the area of {where} is lost to round-off in the step",
            cause="flat-cell",
            place=Place(self.name, cell),
        )

    def find_rate(self) -> float:
        """Largest rate [1/s] of the cells updated by this process: the inverse of their step."""
        return float(self.rates[self.rows.start : self.rows.stop].max())

    # --- fields for problems, pictures and dumps -------------------------------------------------

    @property
    def rho(self) -> np.ndarray:
        """Density (ni, nj) [kg/m3], a view of the state."""
        return self.state[RHO, 1:-1, 1:-1]

    @property
    def u(self) -> np.ndarray:
        """Velocity along x (ni, nj) [m/s], a view of the state."""
        return self.state[U, 1:-1, 1:-1]

    @property
    def v(self) -> np.ndarray:
        """Velocity along y (ni, nj) [m/s], a view of the state."""
        return self.state[V, 1:-1, 1:-1]

    @property
    def p(self) -> np.ndarray:
        """Pressure (ni, nj) [Pa], a view of the state."""
        return self.state[P, 1:-1, 1:-1]

    @property
    def cell_fields(self) -> Mapping[str, np.ndarray]:
        """Density, velocity, pressure and specific internal energy, each (ni, nj); carried fields.

        Where the material has a heat capacity, then its temperature T.  Views of the state; energy
        and temperature are computed at every access in the rows of this process, 0 in the others.
        """
        rho, u, v, p = self.state[:, 1:-1, 1:-1]
        stored = {"rho": rho, "u": u, "v": v, "p": p} | self._list_carried()
        computed = {"e": functools.partial(self._compute_in_own_rows, compute_energy)}
        if self.eos.heat_capacity > 0.0:
            computed["T"] = functools.partial(self._compute_in_own_rows, compute_temperature)
        return CellFields(stored, computed)

    def _compute_in_own_rows(self, compute: Callable[..., np.ndarray]) -> np.ndarray:
        """What `compute` finds of the cells (ni, nj) of this process, 0 in the others."""
        values = np.zeros((self.ni, self.nj))
        rows = slice(0, self.ni) if self.is_here else slice(self.rows.start, self.rows.stop)
        self._fill(values, rows, self.state, compute)
        return values

    def _list_carried(self) -> dict[str, np.ndarray]:
        """Views (ni, nj) of the carried fields by name."""
        inside = self.carried[:, 1:-1, 1:-1]
        return {field.name: inside[n] for n, field in enumerate(self.carried_fields)}

    def compute_fields(self, state: np.ndarray) -> dict[str, np.ndarray]:
        """`cell_fields` of a state (4, ni + 2, nj + 2) of this block: views, and a new `e`."""
        rho, u, v, p = state[:, 1:-1, 1:-1]
        e = np.empty(rho.shape)
        self._fill(e, slice(0, self.ni), state, compute_energy)
        return {"rho": rho, "u": u, "v": v, "p": p, "e": e}

    def _fill(
        self, values: np.ndarray, rows: slice, state: np.ndarray, compute: Callable[..., np.ndarray]
    ) -> None:
        """Fill these rows of an array (ni, nj) with what `compute` finds of a state.

        A few rows at a time, so that intermediate arrays fit into the cache.
        """
        inside = state[:, 1:-1, 1:-1]
        void_arrays = [self.get_inside(name) for name in HELD_ARRAYS if name != "state"]
        for first in range(rows.start, rows.stop, SLAB_ROWS):
            slab = slice(first, min(first + SLAB_ROWS, rows.stop))
            eos = self.eos.with_fields(self.carried[:, 1:-1, 1:-1][:, slab])
            values[slab] = compute(eos, inside[:, slab], *(held[slab] for held in void_arrays))

    def compute_at(self, name: str, i: np.ndarray, j: np.ndarray) -> np.ndarray:
        """Specific internal energies "e" [J/kg], temperatures "T" [K] of the cells [i, j]."""
        compute = {"e": compute_energy, "T": compute_temperature}[name]
        eos = self.eos.with_fields(self.get_inside("carried")[..., i, j])
        return compute(eos, *(self.get_inside(held)[..., i, j] for held in HELD_ARRAYS))

    def compute_sound_speed(self, state: np.ndarray) -> np.ndarray:
        """Sound speeds (ni, nj) [m/s] of a state (4, ni + 2, nj + 2).

        The result is in `rates_new`, which the next update overwrites.  In a cut block only the
        rows of this process are computed.
        """
        if self.mixed is not None:
            rho, _, _, p = state[:, 1:-1, 1:-1]
            self.rates_new[...] = self.eos_of_cells.sound_speed(rho, p)
            return self.rates_new
        kind: Any = type(self.eos)
        fill_sound_speed = make_fill_sound_speed(kind)
        fill_sound_speed.entry(
            state, self.parameters, self.rows.start, self.rows.stop, self.rates_new
        )
        return self.rates_new

    @property
    def volume(self) -> np.ndarray:
        """Volumes of the cells, (ni, nj): m² (per depth), in axisymmetric flow m³ per radian.

        Those of polygon cells include the parts beyond their straight faces.
        """
        volume = compute_volumes(self.geometry, self.nodes)
        if self.is_follower:
            for side in SIDE_NAMES:
                first, count = self.side_faces(side)
                cells = get_side(volume[None], side)[0]
                cells += self.excess_volume_new[first : first + count]
        return volume
