"""The Boussinesq equations on one tensor grid: conservative staggered finite volumes.

The unknowns are the stream function psi on the free nodes and the temperature T in the cells.  The
volume flux through a face is the difference of psi along it, so what leaves a cell is zero to
round-off whatever psi is.  The same differences, transposed, sum the momentum of the faces around
each node and so eliminate the pressure: what is solved is the marker-and-cell scheme itself, in
its divergence-free unknowns.

    M dpsi/dt + E [(S D psi) (C u)] - nu K psi - (b · B) T = 0,       u = D psi / length
    A dT/dt + W [(D psi) (I T) - kappa G(T)] = 0

D curl, S spread, C carry, E balance, K friction, B buoyancy of `staggered.Momentum`; I values,
G gradient (with the walls), W balance of `staggered.Heat`; A areas of the cells.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy import sparse

from hydro.convection.box.axis import Axis
from hydro.convection.box.fluid import Fluid
from hydro.convection.box.staggered import Momentum, make_heat, make_topology, scale_rows
from hydro.convection.box.walls import PAIRS, SIDES, Wall, check_walls


class Equations:
    """The discrete equations of one grid; psi (free,) [m2/s], temperature (cells,) [K] are flat."""

    def __init__(self, x: np.ndarray, y: np.ndarray, walls: Mapping[str, Wall]):
        """Nodes x (nx + 1,), y (ny + 1,) [m].  Raises BadInput from the axes and the walls."""
        check_walls(walls)
        self.walls = dict(walls)
        periodic = [walls[low].flow == "periodic" for low, _ in PAIRS]
        self.axes = (Axis(x, periodic[0], "x"), Axis(y, periodic[1], "y"))
        self.shape = tuple(axis.cells for axis in self.axes)
        self.areas = np.outer(*(axis.widths for axis in self.axes)).ravel()
        self.topology = make_topology(self.shape, tuple(periodic))
        self.free, self.through = self.topology.free, self.topology.through
        slip = [tuple(float(walls[s].flow != "free") for s in pair) for pair in PAIRS]
        self.momentum = Momentum(self.axes, (slip[1], slip[0]), self.topology)
        held = [
            tuple(float(walls[s].temperature is not None or walls[s].flow == "periodic") for s in p)
            for p in PAIRS
        ]
        self.heat = make_heat(self.axes, tuple(held), self.topology)
        self.wall_temperature, self.wall_gradient, self.wall_flux = self._wall_terms()

    @property
    def face_shapes(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Shapes of the faces across x and across y."""
        across, up = self.axes
        return (across.node_count, up.cells), (across.cells, up.node_count)

    @property
    def sizes(self) -> tuple[int, int]:
        """Numbers of unknowns: stream function, temperature."""
        return self.free.shape[1], self.areas.size

    def split_faces(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """An array over all faces as its two parts, in their shapes."""
        first, second = self.face_shapes
        cut = first[0] * first[1]
        return values[:cut].reshape(first), values[cut:].reshape(second)

    def _wall_terms(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """On all faces: temperature of isothermal walls [K]; slope times length from it [K];
        the given heat through the others, in +x or +y [K m2/s].  Zero elsewhere."""
        whole = [np.zeros(self.momentum.lengths.size) for _ in range(3)]
        for k, (low, high) in enumerate(PAIRS):
            own, cross = self.axes[k], self.axes[1 - k]
            if own.periodic:
                continue
            parts = [self.split_faces(values)[k] for values in whole]
            if k == 1:
                parts = [part.T for part in parts]
            for end, sign, side in ((0, -1.0, low), (-1, 1.0, high)):
                temperature, flux = self.walls[side].sample(cross.centres)
                if temperature is not None:
                    parts[0][end] = temperature
                    parts[1][end] = sign * temperature / own.distances[end] * cross.widths
                parts[2][end] = sign * flux * cross.widths
        return tuple(whole)

    def buoyancy(self, fluid: Fluid) -> sparse.csr_matrix:
        """Temperature -> sums of the buoyancy around the free nodes."""
        across, up = self.momentum.buoyancy
        return fluid.buoyancy[0] * across + fluid.buoyancy[1] * up

    def compute_fluxes(self, psi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Volume fluxes [m2/s] through the faces across x and across y."""
        return self.split_faces(self.momentum.curl @ psi)

    def compute_velocities(self, psi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Velocities [m/s] on the faces across x (u) and across y (v)."""
        return self.split_faces((self.momentum.curl @ psi) / self.momentum.lengths)

    def compute_divergence(self, psi: np.ndarray) -> np.ndarray:
        """What leaves each cell [m2/s], shape of the cells: zero to round-off."""
        return (self.heat.balance @ (self.momentum.curl @ psi)).reshape(self.shape)

    def compute_conduction(self, fluid: Fluid, temperature: np.ndarray) -> np.ndarray:
        """kappa dT/dn times length on all faces [K m2/s], n in +x or +y."""
        slope = self.heat.gradient @ temperature + self.wall_gradient
        return fluid.diffusivity * slope + self.wall_flux

    def compute_wall_heat(self, fluid: Fluid, temperature: np.ndarray, side: str) -> np.ndarray:
        """Heat over rho cp that enters through each face of a wall [K m2/s], shape (cells,)."""
        k, high = divmod(SIDES.index(side), 2)
        faces = self.split_faces(self.compute_conduction(fluid, temperature))[k]
        return np.take(faces, -1 if high else 0, axis=k) * (1.0 if high else -1.0)

    def compute_residual(
        self, fluid: Fluid, psi: np.ndarray, temperature: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """All but the time derivatives of both equations, zero in the steady state."""
        momentum = self.momentum.balance @ (
            (self.momentum.volume_flux @ psi) * (self.momentum.velocity @ psi)
        )
        momentum -= fluid.viscosity * (self.momentum.friction @ psi)
        momentum -= self.buoyancy(fluid) @ temperature
        carried = (self.momentum.curl @ psi) * (self.heat.values @ temperature)
        heat = self.heat.balance @ (carried - self.compute_conduction(fluid, temperature))
        return momentum, heat

    def compute_jacobian(
        self, fluid: Fluid, psi: np.ndarray, temperature: np.ndarray
    ) -> sparse.csc_matrix:
        """Derivative of `compute_residual` by (psi, temperature)."""
        flux, velocity = self.momentum.volume_flux @ psi, self.momentum.velocity @ psi
        carried = scale_rows(flux, self.momentum.velocity)
        carried += scale_rows(velocity, self.momentum.volume_flux)
        momentum = self.momentum.balance @ carried - fluid.viscosity * self.momentum.friction
        curl, values = self.momentum.curl, self.heat.values
        heat_by_psi = self.heat.balance @ (scale_rows(values @ temperature, curl))
        heat = self.heat.balance @ (scale_rows(curl @ psi, values))
        heat -= fluid.diffusivity * self.heat.conduction
        return sparse.bmat([[momentum, -self.buoyancy(fluid)], [heat_by_psi, heat]], "csc")
