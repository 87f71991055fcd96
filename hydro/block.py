"""A block: a structured grid of one material, its state, and its perimeter of segments.

The new state of a step has arrays of its own, so a step can be rejected at no cost until `accept`
swaps them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hydro import rim as on
from hydro import rows as of
from hydro.eos import EquationOfState
from hydro.eos.base import check_eos, check_formulas
from hydro.formulas.geometry import PLANE, Geometry, compute_volumes
from hydro.formulas.reconstruction import DEFAULT_LIMITER, FIRST_ORDER_LIMITER
from hydro.formulas.riemann import DEFAULT_FLUX
from hydro.interior.advance import allocate_scratch, count_tiles, make_flow_kernels
from hydro.interior.cell_fields import (
    SLAB_ROWS,
    CellFields,
    check_first_state,
    make_fill_sound_speed,
)
from hydro.interior.update import sum_tiles
from hydro.perimeter.contacts import fill_open_flux
from hydro.perimeter.strips import make_side_kernels
from hydro.rim import find_first_face, make_rim
from hydro.workers import LEAST_INSIDE
from regrid.errors import BadInput, Place, RunFailure, suggest
from regrid.measure.corners import compute_centres
from regrid.measure.quality import find_bad_cells
from regrid.sides import J_MIN, SIDE_NAMES, get_side, get_sides

UNITS = {"rho": "kg/m3", "u": "m/s", "v": "m/s", "p": "Pa", "e": "J/kg"}
LONG_NAMES = {
    "rho": "density",
    "u": "velocity x",
    "v": "velocity y",
    "p": "pressure",
    "e": "specific internal energy",
}


def _check_name(name: object, what: str, other: str = "/,") -> None:
    """Raise BadInput for a name invalid in dumps and histories; `other`: forbidden characters."""
    if not isinstance(name, str):
        raise BadInput(f"{what} is called {name!r}: a name is text")
    if not name.strip() or name == "." or not name.isprintable() or set(name) & set(other):
        signs = " or ".join(other)
        raise BadInput(f"{what} is called {name!r}: a name has one sign at least, and no {signs}")


class PerimeterPlan:
    """Data of a block's segments (`hydro.boundary.Segment`) for the phases of a step, made once.

    `ghosts`, `speeds`, `fluxes`: the segments that fill these themselves; `walls` (n, 3), `opened`
    (n, 3): the others, for kernels, with their kinds and the rows of the states beyond; `pistons`:
    indices of moving walls, whose velocities are in `wall_speeds` (n, 2); `inwards` (faces,): faces
    that need the next cells inward; `moving` (n, 2): the spans of faces that move with the flow;
    `counted` (n, 2): the spans through which totals change, of segments without a partner or with
    surface tension; `is_follower`: whether a sliding contact places nodes of these segments on
    another's line.
    """

    def __init__(self, segments: Sequence[Any], faces: int = 0):
        self.segments = list(segments)
        self.ghosts, self.speeds, self.fluxes = (
            [segment for segment in segments if segment.has(phase)]
            for phase in ("fill_ghosts", "fill_speeds", "fill_flux")
        )
        walls = [s for s in segments if s.wall is not None]
        self.walls = _collect([(s.first, s.last, s.wall) for s in walls], 3)
        self.opened = _collect(
            [(s.first, s.last, s.beyond) for s in segments if s.beyond is not None], 3
        )
        self.pistons = [(n, wall) for n, wall in enumerate(walls) if wall.moves]
        self.wall_speeds = np.zeros((len(walls), 2))
        self.moving = _collect([(s.first, s.last) for s in segments if s.follows_flow], 2)
        self.inwards = np.zeros(faces, dtype=np.bool_)
        for segment in segments:
            self.inwards[segment.first : segment.last] = segment.moves
        counted = [(s.first, s.last) for s in segments if not s.linked or s.tension > 0.0]
        self.counted = _collect(counted, 2)
        self.is_follower = any(segment.is_follower for segment in segments)


def _collect(rows: list, width: int) -> np.ndarray:
    return np.array(rows, dtype=np.int64).reshape(-1, width)


class Block:
    """One material on one structured grid.

    nodes (2, ni + 1, nj + 1); rho, u, v, p: numbers or arrays (ni, nj), cell averages, SI.
    flux: "hllc", with HLL at strong shocks, or "hll" on all faces, which damps the errors that
    skewed grid lines leave behind a shock, but smears contacts inside the block.
    Raises BadInput for a grid with a bad cell, for a density or sound speed that is not positive,
    and for an equation of state whose formulas disagree.
    """

    units = UNITS
    long_names = LONG_NAMES

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
    ):
        _check_name(name, "a block")
        _check_name(material or name, f"the material of block {name!r}", other=",")
        check_eos(name, eos)
        self.name = name
        self.material = material or name
        self.eos = eos
        try:
            self.nodes = np.array(nodes, dtype=np.float64, order="C")
        except (TypeError, ValueError) as error:
            raise BadInput(
                f"block {name!r}: its nodes are not an array of numbers ({error})"
            ) from None
        if self.nodes.ndim != 3 or self.nodes.shape[0] != 2 or min(self.nodes.shape[1:]) < 3:
            raise BadInput(
                f"block {name!r}: nodes have shape {self.nodes.shape}; "
                "they must be (2, ni + 1, nj + 1) with at least 2 cells each way"
            )
        self.ni, self.nj = (size - 1 for size in self.nodes.shape[1:])
        bad = find_bad_cells(self.nodes)
        if len(bad):
            i, j = (int(index) for index in bad[0])
            raise BadInput(
                f"block {name!r}: {len(bad)} cells of the first grid are not convex or are turned "
                f"over (the first is cell i={i}, j={j}); i and j must turn counter-clockwise"
            )
        self.state = np.zeros((of.STATE_ROWS, self.ni + 2, self.nj + 2))
        for row, (label, value) in enumerate(
            zip(("rho", "u", "v", "p"), (rho, u, v, p), strict=True)
        ):
            value = value(*self.centres) if callable(value) else value
            try:
                self.state[row, 1:-1, 1:-1] = value
            except (TypeError, ValueError):
                if not np.shape(value):
                    raise BadInput(f"block {name!r}: {label} is {value!r}, no number") from None
                raise BadInput(
                    f"block {name!r}: {label} has shape {np.shape(value)}; "
                    f"the block has {self.ni} x {self.nj} cells"
                ) from None
        check_first_state(name, eos, self.state[:, 1:-1, 1:-1])
        check_formulas(name, eos, *self.state[[of.RHO, of.P], 1:-1, 1:-1])
        # rates of the cells (theory F7.1), and the number of cells redistributed in the step
        self.rates = np.zeros((self.ni, self.nj))
        self.rates_new = np.zeros((self.ni, self.nj))
        self.crowding = np.zeros((self.ni, self.nj))  # of the new grid, theory F7.3
        # after those: memory freed by the checks is reused for arrays that are written anyway
        self.void_energy = np.zeros((self.ni, self.nj))
        self.void_energy_new = np.zeros((self.ni, self.nj))
        self.shared_cells = 0
        self.is_here = True  # whether this process holds the whole block (`hydro.ranks`)
        self.take_rows(0, self.ni)
        self.nodes_new = self.nodes.copy()
        self.state_new = np.zeros(self.state.shape)
        # separate if a body source acts
        self._starts: dict[str, np.ndarray] = {}  # separate if a body source acts
        # of the types for which kernels are compiled, as those of a user's own need not be
        self.parameters = tuple(
            np.ascontiguousarray(value, dtype=float) if np.ndim(value) else float(value)
            for value in eos.parameters
        )
        self.wave_law = tuple(float(value) for value in eos.wave_law)
        self.limiter = limiter
        self.flux_name = flux
        # one row per tile, and one for polygon cells of sliding contacts and sources
        self.tile_totals = np.zeros((count_tiles(self.ni, self.nj) + 1, of.TOTAL_ROWS))
        self.tile_totals[-1, of.LEAST_C2] = of.NO_C2
        self.sums_array = np.zeros(of.TOTAL_ROWS)  # of the tiles, and their list while valid
        self._summed: list[float] | None = None
        self.scratch = allocate_scratch(1)
        count = 2 * (self.ni + self.nj)
        self.rim = make_rim(count)
        # acceleration by a body source of the rim's cells
        self.body_acceleration: np.ndarray | None = None
        self.excess_volume = np.zeros(count)  # areas of polygon cells beyond their straight faces
        self.excess_volume_new = np.zeros(count)
        self.segments: list[Any] = []  # `hydro.boundary.put` adds them
        self.set_geometry(PLANE)

    def set_geometry(self, geometry: Geometry) -> None:
        """Make the flow plane or axisymmetric; called by the simulation.

        Raises BadInput if an axisymmetric block extends below the axis y = 0.
        """
        self.geometry = geometry
        self._plan = PerimeterPlan([], self.rim.faces)
        self.is_first_order = False
        self._choose_kernels(self.limiter)
        lowest = self.nodes[1].min()
        if geometry.curved and lowest < 0.0:
            raise BadInput(
                f"block {self.name!r}: its nodes reach down to y = {lowest:g} m; "
                "in axisymmetric flow y is the radius and may not be negative"
            )

    def _choose_kernels(self, limiter: str) -> None:
        variant: tuple[Any, ...] = type(self.eos), limiter, self.geometry, self.flux_name
        self.flow = make_flow_kernels(*variant)
        self.sides = make_side_kernels(*variant)

    def use_first_order(self, lowered: bool) -> None:
        """Set whether the following steps take cells for constant, as a last resort."""
        if lowered != self.is_first_order:
            self.is_first_order = lowered
            self._choose_kernels(FIRST_ORDER_LIMITER if lowered else self.limiter)

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

    # --- phases of a step ----------------------------------------------------------------------

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

    def gather(self, t: float = 0.0) -> None:
        """Compute faces at the old time, perimeter cell states, and ghosts beyond walls."""
        plan = self.plan
        for number, wall in plan.pistons:
            plan.wall_speeds[number] = wall.velocity(t)
        self.sides.start_sides.entry(
            self.start, self.nodes, self.parameters, plan.inwards, plan.walls, plan.wall_speeds,
            self.scratch, self.rim.rows,
        )  # fmt: skip
        if self.body_acceleration is not None:
            self._add_weight(self.body_acceleration)

    def _add_weight(self, acceleration: np.ndarray) -> None:
        """Hydrostatic ghosts: pressure mirrored about that of a layer at rest on the wall."""
        rim = self.rim
        normal = rim.rows[on.NORMAL]
        centres = self.take_perimeter(compute_centres(self.nodes))
        across = (acceleration * normal).sum(axis=0) / (normal * normal).sum(axis=0)
        way = ((rim.rows[on.AREA_CENTRE] - centres) * normal).sum(axis=0)
        for first, last, _ in self.plan.walls:
            rim.p_ghost[first:last] += (2.0 * rim.rho * across * way)[first:last]

    @staticmethod
    def take_perimeter(field: np.ndarray) -> np.ndarray:
        """Values (2, faces) of a field (2, ni, nj) in the cells along the perimeter."""
        return np.concatenate(get_sides(field), axis=1)

    def fill_ghosts(self, t: float) -> None:
        """Fill the ghosts of the other sides at time t, and contact states of moving sides."""
        for segment in self.plan.ghosts:
            segment.fill_ghosts(t)

    def predict(self, dt: float) -> None:
        """From the ghosts: mid-time predictions, and traces at moving faces at the old time."""
        self.sides.predict_sides.entry(
            self.start, self.start_void_energy, self.nodes, 0.5 * dt, self.parameters,
            self.plan.moving, self.scratch, self.rim.rows,
        )  # fmt: skip

    def fill_speeds(self, t: float) -> None:
        """Contact states from the traces at mid-time t on all sides that move with the flow."""
        for segment in self.plan.speeds:
            segment.fill_speeds(t)

    def trace(self, dt: float) -> None:
        """From the new nodes: mid-time faces, their traces, and fluxes that need nothing else."""
        plan = self.plan
        self.sides.trace_sides.entry(
            self.nodes, self.nodes_new, 1.0 / dt, self.parameters, self.wave_law, plan.walls,
            plan.opened, self.rim.rows,
        )  # fmt: skip

    def fill_flux(self, t: float) -> None:
        """Outward fluxes through the other sides from the traces at mid-time t."""
        for segment in self.plan.fluxes:
            segment.fill_flux(t)

    def fill_open_flux(self, spans: np.ndarray) -> None:
        """Outward fluxes between traces and the states beyond, through the faces `spans` (n, 2)."""
        opened = np.array([(first, last, on.RHO_BEYOND) for first, last in spans])
        fill_open_flux(self.rim.rows, opened, self.geometry.curved)

    def update(self, dt: float, threads: int = 1) -> None:
        """From the fluxes through the perimeter: the new state and its totals.

        In a cut block: the rows of this process only, without polygon cells.
        """
        if (self.last_row - self.first_row) * self.nj < LEAST_INSIDE:
            threads = 1
        self._summed = None
        if threads > 1 and self.scratch.shape[0] != threads:
            self.scratch = allocate_scratch(threads)
        self.tile_totals[-1, of.LEAST_C2] = of.NO_C2
        self.tile_totals[-1, of.VOIDED] = 0.0
        advance = self.flow.advance_threaded if threads > 1 else self.flow.advance
        advance.entry(
            self._old, self._new, self.rim.rows, dt, self.parameters, self.scratch, self.tiles,
            self.tile_totals[:-1],
        )  # fmt: skip
        if self.is_follower and not self.is_cut:
            self.fill_polygons()

    def take_rows(self, first: int, last: int) -> None:
        """From now on update only the cell rows first..last - 1, which are whole rows of tiles."""
        self.first_row = first
        self.last_row = last
        self.tiles = count_tiles(first, self.nj), count_tiles(last, self.nj)
        self.is_cut = last - first < self.ni

    def fill_polygons(self) -> None:
        """Add the parts of polygon cells beyond their straight faces to the new state."""
        excess = self.excess_volume, self.excess_volume_new
        self.sides.fill_polygons(
            self._old, self._new, excess, self.parameters, self.tile_totals[-1]
        )

    @property
    def _old(self) -> tuple[np.ndarray, ...]:
        """Kernel input at the start of the step: state, void energy, nodes."""
        return self.start, self.start_void_energy, self.nodes

    @property
    def _new(self) -> tuple[np.ndarray, ...]:
        """Kernel output for known new nodes: the same three, rates and crowding."""
        return (
            self.state_new, self.void_energy_new, self.nodes_new, self.rates_new, self.crowding
        )  # fmt: skip

    def count_ghosts(self, array: np.ndarray) -> int:
        """Rows of ghosts before the first cells in an array of this block: 1 or 0."""
        return int(array.shape[-2] == self.ni + 2)

    def get_inside(self, name: str) -> np.ndarray:
        """A view of an array of the block by its name, such as those of STEP_ARRAYS: no ghosts."""
        array = getattr(self, name)
        return array[..., 1:-1, 1:-1] if self.count_ghosts(array) else array

    def list_new(self) -> list[np.ndarray]:
        """The arrays of HELD_ARRAYS that a step makes."""
        return [getattr(self, f"{name}_new") for name in of.HELD_ARRAYS]

    def list_starts(self) -> list[np.ndarray]:
        """The arrays of HELD_ARRAYS that a step starts from; see `get_start`."""
        return [self.get_start(name) for name in of.HELD_ARRAYS]

    def get_start(self, name: str) -> np.ndarray:
        """One of HELD_ARRAYS as a step starts from it: the present one, or a source's copy."""
        return self._starts.get(name, getattr(self, name))

    @property
    def start(self) -> np.ndarray:
        """The state (4, ni + 2, nj + 2) that a step starts from."""
        return self.get_start("state")

    @property
    def start_void_energy(self) -> np.ndarray:
        """The void energy (ni, nj) [J/kg] of `start`."""
        return self.get_start("void_energy")

    def part_start(self, apart: bool) -> None:
        """Set whether steps start from copies of what cells hold, which a source may modify."""
        self._starts = {name: getattr(self, name).copy() for name in of.HELD_ARRAYS if apart}

    def copy_start(self) -> None:
        """Let the next step start from the present state, where it starts from copies."""
        for name, copy in self._starts.items():
            copy[...] = getattr(self, name)

    @property
    def is_follower(self) -> bool:
        """Whether a sliding contact places nodes of this block on another's line."""
        return self.plan.is_follower

    def accept(self) -> None:
        """Make the new grid and state the current ones."""
        for name in of.STEP_ARRAYS:
            old = getattr(self, name)
            setattr(self, name, getattr(self, f"{name}_new"))
            setattr(self, f"{name}_new", old)

    def find_failure(self) -> RunFailure | None:
        """Why the new state is not admissible, with the cell's indices, or None."""
        totals = self.tile_totals
        rho, _, _, p = self.state_new[:, 1:-1, 1:-1]
        with np.errstate(all="ignore"):
            c = self.eos.sound_speed(rho, p)
        bad = ~((rho > 0.0) & (c > 0.0))
        if not bad.any():
            return self._find_failed_totals(totals)
        i, j = (int(index) for index in np.argwhere(bad)[0])
        rho, p = self.state_new[[of.RHO, of.P], i + 1, j + 1]
        known = f", its pressure {p:.6g} Pa" if np.isfinite(p) else ""
        return RunFailure(
            f"flow: block {self.name!r}, cell i={i}, j={j}: {self.eos.failure}; "
            f"its density is {rho:.6g} kg/m3{known}",
            cause=self.eos.failure_cause,
            place=Place(self.name, (i, j)),
        )

    def _find_failed_totals(self, totals: np.ndarray) -> RunFailure | None:
        """Why the totals of the new state are none though every cell has a state, or None."""
        names = np.array(("mass", "momentum x", "momentum y", "energy"))
        lost = names[~np.isfinite(totals[:, of.CONSERVED]).all(axis=0)]
        if lost.size:
            return RunFailure(
                f"flow: block {self.name!r}: its {' and '.join(lost)} cannot be summed to a finite "
                "number, though the state of every cell is one",
                cause=self.eos.failure_cause,
                place=Place(self.name),
            )
        if self.shared_cells:
            return None  # the failed cells have been redistributed since
        flat = find_bad_cells(self.nodes_new)
        cell = (int(flat[0, 0]), int(flat[0, 1])) if len(flat) else None
        where = f"cell i={cell[0]}, j={cell[1]}" if cell else "a cell"
        return RunFailure(
            f"flow: block {self.name!r}: the area of {where} is lost to round-off in the step",
            cause="flat-cell",
            place=Place(self.name, cell),
        )

    def find_rate(self) -> float:
        """Largest rate [1/s] of the cells updated by this process: the inverse of their step."""
        return float(self.rates[self.first_row : self.last_row].max())

    def take_shared(self, least_c2: float, voided: int) -> None:
        """Update the sums after redistribution of the new state."""
        self._summed = None
        last = self.tile_totals[-1]
        last[of.LEAST_C2] = min(last[of.LEAST_C2], least_c2)
        last[of.VOIDED] += voided

    @property
    def sums(self) -> list[float]:
        """Sums over the tiles (7,) in the last step, columns as in `hydro.rows` (c²: minimum)."""
        if self._summed is None:
            self.sum_up()
            assert self._summed is not None
        return self._summed

    def sum_up(self) -> bool:
        """Sum the tiles; returns whether the state is valid.  See `sum_tiles`."""
        good = sum_tiles(self.tile_totals, self.sums_array)
        self.take_sums()
        return good

    def share_sums(self) -> np.ndarray:
        """The array of `sums`, filled on the rank that has the block; `take_sums` reads it."""
        if self.is_here and self._summed is None:
            self.sum_up()
        return self.sums_array

    def take_sums(self) -> None:
        """Read `sums` from `sums_array`."""
        self._summed = self.sums_array.tolist()

    def add_source_totals(self, gained: np.ndarray) -> None:
        """Add momentum x, y and energy (3,) of a body source after the update."""
        self._summed = None
        last = self.tile_totals[-1]
        if not self.is_follower:  # otherwise the polygons' part is there
            last[of.CONSERVED] = 0.0
        last[of.MOMENTUM_AND_ENERGY] += gained

    # --- fields for pictures and dumps -----------------------------------------------------------

    @property
    def cell_fields(self) -> Mapping[str, np.ndarray]:
        """Density, velocity, pressure and specific internal energy, each (ni, nj).

        Views of the state; the energy is computed at every access in the rows of this process, and
        is 0 in the others.
        """
        rho, u, v, p = self.state[:, 1:-1, 1:-1]
        rows = slice(0, self.ni) if self.is_here else slice(self.first_row, self.last_row)

        def compute_energy() -> np.ndarray:
            e = np.zeros(rho.shape)
            self.fill_energy(rho[rows], p[rows], self.void_energy[rows], e[rows])
            return e

        return CellFields({"rho": rho, "u": u, "v": v, "p": p}, compute_energy)

    def compute_fields(self, state: np.ndarray) -> dict[str, np.ndarray]:
        """`cell_fields` of a state (4, ni + 2, nj + 2) of this block: views, and a new `e`."""
        rho, u, v, p = state[:, 1:-1, 1:-1]
        e = np.empty(rho.shape)
        self.fill_energy(rho, p, self.void_energy, e)
        return {"rho": rho, "u": u, "v": v, "p": p, "e": e}

    def fill_energy(self, rho: np.ndarray, p: np.ndarray, voids: np.ndarray, e: np.ndarray) -> None:
        """Specific internal energies `e` [J/kg] from density, pressure and void energy: (n, nj)."""
        for first in range(0, len(e), SLAB_ROWS):
            rows = slice(first, first + SLAB_ROWS)
            e[rows] = self.eos.energy(rho[rows], p[rows]) + voids[rows]

    def compute_sound_speed(self, state: np.ndarray) -> np.ndarray:
        """Sound speeds (ni, nj) [m/s] of a state (4, ni + 2, nj + 2).

        The result is in `rates_new`, which the next update overwrites.  In a cut block only the
        rows of this process are computed.
        """
        kind: Any = type(self.eos)
        make_fill_sound_speed(kind).entry(
            state, self.parameters, self.first_row, self.last_row, self.rates_new
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
