"""The stress of a block of solid, through the phases of a step.

Deviatoric stress and plastic strain are carried fields: they ride with the mass.  In a step,
beside the phases of the flow (`hydro.phases`):

    start     shear modulus; ghosts beyond walls, normal stress at the faces of the sides
    predict   ghosts beyond contacts, stress at mid-time and its divergence        theory F20.3
    trace     stress at the faces of the sides, in the fluxes of walls and open sides
    prepare   stress on the faces inside, for the flow's update                    theory F20.5
    relax     after fluxes and fields: strain, rotation and yield                  theory F20.8
    spall     after all that finds pressures of cells: voids open by a law         theory F21
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from shockgrid.hydro.carried.fields import CarriedField
from shockgrid.hydro.eos.conversion import (
    compute_energy,
    compute_temperature,
    compute_whole_pressure,
    has_voids,
    open_voids,
)
from shockgrid.hydro.eos.materials import check_solid
from shockgrid.hydro.eos.temperature import REST_TEMPERATURE
from shockgrid.hydro.formulas.strength import LONGITUDINAL_PART, add_shear_wave
from shockgrid.hydro.interior.solid import make_solid_arrays
from shockgrid.hydro.rows import RHO, P
from shockgrid.hydro.strength.laws.base import StrengthLaw
from shockgrid.hydro.strength.rates import (
    EQUIVALENT,
    PLASTIC_STRAIN,
    RATE_ROWS,
    make_fill_face_stress,
    make_fill_rates,
    make_measure_rates,
    make_predict_stress,
    update_stress,
)
from shockgrid.hydro.strength.sides import (
    SIDE_ROWS,
    fill_stress_ghosts,
    start_stress,
    trace_stress,
    trace_stress_moving,
)
from shockgrid.hydro.strength.spall.base import SolidCells, SpallLaw
from shockgrid.regrid.errors import BadInput

STRESS_FIELDS = (
    CarriedField("s_xx", "Pa", "deviatoric stress xx"),
    CarriedField("s_yy", "Pa", "deviatoric stress yy"),
    CarriedField("s_xy", "Pa", "deviatoric stress xy"),
    CarriedField("plastic_strain", "1", "equivalent plastic strain"),
)


def strip_ghosts(held: Sequence[np.ndarray]) -> list[np.ndarray]:
    """The arrays of HELD_ARRAYS of a block without the ghosts of its state."""
    state, *others = held
    return [state[:, 1:-1, 1:-1], *others]


def find_shorter_extent(nodes: np.ndarray) -> np.ndarray:
    """The shorter distance (ni, nj) [m] between the middles of opposite faces of cells."""
    edges_i = np.diff(nodes, axis=1)
    edges_j = np.diff(nodes, axis=2)
    along_i = 0.5 * (edges_i[:, :, 1:] + edges_i[:, :, :-1])
    along_j = 0.5 * (edges_j[:, 1:] + edges_j[:, :-1])
    return np.minimum(np.hypot(*along_i), np.hypot(*along_j))


def add_stress_fields(
    block: str, eos: Any, fields: tuple[CarriedField, ...], spall: SpallLaw | None = None
) -> tuple[CarriedField, ...]:
    """The carried fields of a block of solid: those given, and those of its stress that lack.

    A field of the stress may be among those given, with first values of its own.  Raises BadInput
    for the equation of state of a gas, and one without a density at rest.
    """
    check_solid(f"block {block!r}", eos)
    if getattr(eos, "rho0", None) is None:
        raise BadInput(
            f"block {block!r}: strength wants an equation of state with a density at rest, rho0; "
            f"{eos.kind!r} has none"
        )
    fields_by_name = {field.name: field for field in fields}
    wanted = (*STRESS_FIELDS, *(spall.fields if spall is not None else ()))
    own_fields = [fields_by_name.pop(field.name, field) for field in wanted]
    return (*own_fields, *fields_by_name.values())


def stiffen_wave_law(wave_law: tuple[float, ...], eos: Any, law: StrengthLaw) -> tuple[float, ...]:
    """`EquationOfState.wave_law` with the impedance at rest of longitudinal waves."""
    a, b, z = wave_law
    shear, _ = law.find_at_rest(eos.rho0, REST_TEMPERATURE)
    return a, b, float(z * z + LONGITUDINAL_PART * shear * eos.rho0) ** 0.5


class Stress:
    """Arrays of the stress of a block of ni × nj cells, and its phases.

    arrays: what the flow's kernels take, with the shear modulus; rates (5, ni, nj): see
    `hydro.strength.rates`; sides (4, faces): see `hydro.strength.sides`.  The fields of the stress
    are the first of the block's carried ones.
    """

    FIRST_FIELD = 0

    def __init__(self, law: StrengthLaw, ni: int, nj: int, spall: SpallLaw | None = None):
        self.law = law
        self.spall = spall
        self.broken_cells = 0  # of the whole block, in the last step
        self._states_at_start: tuple = ()  # from the phase `start` to `predict`
        self.arrays = make_solid_arrays(ni, nj)
        self.rates = np.zeros((RATE_ROWS, ni, nj))
        self.gains = np.zeros((PLASTIC_STRAIN, nj))  # scratch of a row
        self.sides = np.zeros((SIDE_ROWS, 2 * (ni + nj)))
        # increase of the plastic strain in a step, for a law of spall
        self.strained = np.zeros((ni, nj) if spall is not None else (1, 1))

    def start(self, block: Any) -> None:
        """Phase 2, when the cells along the sides are gathered: see `start_stress`."""
        held = block.list_starts()
        self._states_at_start = self._list_state(block, held)
        shear = self._find_shear(self._states_at_start, block.get_start("carried"))
        failed = has_voids(held, slice(None), slice(None))
        self.arrays.shear[...] = np.where(failed, 0.0, shear)
        rho = held[0][RHO, 1:-1, 1:-1]
        with np.errstate(all="ignore"):
            self.arrays.shear_wave[...] = add_shear_wave(0.0, self.arrays.shear, rho)
        start_stress(
            block.get_start("carried"), block.start, self.arrays.shear, self._list_walls(block),
            block.plan.inwards, self.FIRST_FIELD, self.sides, block.rim.rows,
        )  # fmt: skip

    def predict(self, block: Any, dt: float) -> None:
        """Phase 2, after the couplings, in place of the transport's phase."""
        half_dt = 0.5 * dt
        arrays = self.arrays
        transport = block.transport
        rows = block.rows.start, block.rows.stop
        values = block.get_start("carried")
        fill_stress_ghosts(
            arrays.shear, block.plan.flowing_spans, self.FIRST_FIELD, self.sides, block.rim.rows
        )
        transport.predict(block, half_dt, make_fill_rates(block.geometry), self.rates)
        laws = self._find_laws(self._states_at_start, values)
        predict_stress = make_predict_stress(block.geometry)
        predict_stress(
            (values, transport.slopes), self.rates, laws, half_dt, transport.centres, rows,
            self.gains, arrays,
        )  # fmt: skip

    def trace_moving(self, block: Any) -> None:
        """Phase 2, at the end: the traces at faces that go with the flow."""
        transport = block.transport
        trace_stress_moving(
            transport.slopes, transport.centres, self.arrays, block.plan.flowing_spans,
            self.FIRST_FIELD, block.rim.rows,
        )  # fmt: skip

    def trace(self, block: Any) -> None:
        """Phase 6, with the traces of the sides known, before the couplings' fluxes."""
        trace_stress(
            self.arrays, (self._list_walls(block), block.plan.opened), block.wave_law,
            self.FIRST_FIELD, block.geometry.curved, self.sides, block.rim.rows,
        )  # fmt: skip

    @staticmethod
    def _list_walls(block: Any) -> tuple[np.ndarray, ...]:
        """The walls of a block, their velocities, and whether they are clamped."""
        return block.plan.walls, block.plan.wall_speeds, block.plan.clamped

    def prepare(self, block: Any) -> None:
        """Phase 6, before the flow's update: stress on the faces inside."""
        transport = block.transport
        fill_face_stress = make_fill_face_stress(block.geometry)
        fill_face_stress(
            transport.slopes, transport.centres, block.nodes, block.nodes_new,
            (block.rows.start, block.rows.stop), self.arrays,
        )  # fmt: skip

    def relax(self, block: Any, dt: float) -> None:
        """Phase 6, with the new state and the fields carried: the new stress."""
        arrays = self.arrays
        rows = block.rows.start, block.rows.stop
        measure_rates = make_measure_rates(block.geometry)
        measure_rates(
            block.nodes, block.nodes_new, arrays.speed_i, arrays.speed_j, self.sides, rows,
            self.rates,
        )  # fmt: skip
        held = block.list_new()
        states = self._list_state(block, held)
        laws = self._find_laws(states, block.carried_new)
        shear = self._find_shear(states, block.carried_new)
        plastic_strain = block.carried_new[self.FIRST_FIELD + PLASTIC_STRAIN, 1:-1, 1:-1]
        if self.spall is not None:
            np.negative(plastic_strain, out=self.strained)
        update_stress(block.carried_new, self.rates, laws, shear, tuple(held), dt, rows)
        if self.spall is not None:
            self.strained += plastic_strain

    def spall_new_cells(self, block: Any, dt: float) -> int:
        """Phase 6, last: the law of spall on this process's rows; how many cells are broken."""
        rows = slice(block.rows.start, block.rows.stop)
        held = [array[..., rows, :] for array in strip_ghosts(block.list_new())]
        carried = block.carried_new[:, 1:-1, 1:-1][:, rows]
        nodes = block.nodes_new[:, rows.start : rows.stop + 1]
        strained = self.strained[rows]
        return self._spall(
            block.eos, held, carried, nodes, strained, self.rates[EQUIVALENT][rows], dt
        )

    def spall_again(
        self, eos: Any, held: Sequence[np.ndarray], carried: np.ndarray, nodes: np.ndarray
    ) -> None:
        """The law of spall, in no time, on cells whose pressures have been found anew.

        held: arrays of HELD_ARRAYS without ghosts, carried (n, mi, mj), nodes (2, mi + 1, mj + 1).
        """
        if self.spall is not None:
            nothing = np.zeros(carried.shape[1:])
            self._spall(eos, held, carried, nodes, nothing, nothing, 0.0)

    def _spall(
        self,
        eos: Any,
        held: Sequence[np.ndarray],
        carried: np.ndarray,
        nodes: np.ndarray,
        strained: np.ndarray,
        strain_rate: np.ndarray,
        dt: float,
    ) -> int:
        """Advance the fields of spall; voids open, and broken cells lose their stress.

        As of `spall_again`; strained, strain_rate: increase of the plastic strain in the step, and
        rate [1/s].  Returns how many cells are broken.
        """
        assert self.spall is not None
        state, *others = held
        rho, p = state[RHO], state[P]
        stress = carried[self.FIRST_FIELD : self.FIRST_FIELD + PLASTIC_STRAIN]
        values = carried[self._find_spall_fields()].copy()
        temperature = None
        if self.spall.needs_temperature:
            temperature = compute_temperature(eos, state, *others)
        cells = SolidCells(
            eos=eos,
            density=rho,
            pressure=compute_whole_pressure(eos, state, *others),
            energy=compute_energy(eos, state, *others),
            sound=eos.sound_speed(rho, p),
            stress=stress,
            strained=strained,
            strain_rate=strain_rate,
            temperature=temperature,
            extent=find_shorter_extent(nodes),
        )
        pressure = self.spall.relax(values, cells, dt)
        open_voids(eos, pressure, state, *others)
        carried[self._find_spall_fields()] = values
        broken = self.spall.find_broken(values)
        stress[:, broken | (others[0] != 0.0)] = 0.0
        return int(np.count_nonzero(broken))

    def _find_spall_fields(self) -> slice:
        """Where the fields of spall are among the carried ones: after those of the stress."""
        first = self.FIRST_FIELD + len(STRESS_FIELDS)
        return slice(first, first + len(self.spall.fields) if self.spall else first)

    def _list_state(self, block: Any, held: Sequence[np.ndarray]) -> tuple:
        """Density, pressure and, where the law asks for it, temperature of cells, (ni, nj) each.

        held: what the cells hold, in the order of HELD_ARRAYS.
        """
        state, *void_arrays = held
        inside = state[:, 1:-1, 1:-1]
        temperature = None
        if self.law.needs_temperature:
            with np.errstate(all="ignore"):
                temperature = compute_temperature(block.eos, inside, *void_arrays)
        return inside[RHO], inside[P], temperature

    def _find_shear(self, states: tuple, carried: np.ndarray) -> np.ndarray:
        """Shear modulus (ni, nj) [Pa] of the law; no number where there is no state, and 0 in
        broken cells.

        states: of `_list_state`.
        """
        with np.errstate(all="ignore"):
            shear = self.law.shear_modulus(*states)
        if self.spall is not None:
            broken = self.spall.find_broken(carried[self._find_spall_fields(), 1:-1, 1:-1])
            shear = np.where(broken, 0.0, shear)
        return np.ascontiguousarray(shear)

    def _find_laws(self, states: tuple, carried: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Flow stress and hardening (ni, nj) [Pa] of the law, at the rates of `rates`.

        states: of `_list_state`.
        """
        strain = carried[self.FIRST_FIELD + PLASTIC_STRAIN, 1:-1, 1:-1]
        with np.errstate(all="ignore"):
            flow_stress = self.law.flow_stress(strain, self.rates[EQUIVALENT], *states)
            hardening = self.law.hardening(strain, self.rates[EQUIVALENT], *states)
        return np.ascontiguousarray(flow_stress), np.ascontiguousarray(hardening)

    def list_for_link(self, block: Any) -> tuple:
        """What `stick_together` takes of a block."""
        return block.rim.rows, self.sides, self.arrays.shear, self.FIRST_FIELD
