"""Convection in time on grids that may move: second order, implicit in diffusion.

Second-order backward differences of the contents of the control volumes; friction, conduction and
buoyancy at the new time, convection extrapolated to it [AscherRuuthWetton1995]:

    sum_k a_k (A T)^{n+1-k} + dt W [(D psi* - s) (I T*) - kappa G(T^{n+1})] = dt heat
    sum_k a_k O (reach D psi)^{n+1-k}
                      + dt { E [S (D psi* - s) (C u*)] - nu K psi - (b·B) T } = dt O force

The a_k hold for steps of any length; starred values are extrapolated; O sums around the free nodes,
the other letters are those of `equations`, and all matrices are those of the new grid.  s is the
swept volume per dt, in the same backward difference as the contents, so uniform temperature and
uniform velocity are preserved to round-off on any moving grid (the geometric conservation law).
The fluxes come from a stream function on any grid, so mass is conserved to round-off in every cell.

Note: the matrices contain a_0/dt.  They are factorised again only when dt or the grid changes; a
grid that moves in every step costs a factorisation in every step.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from shockgrid.hydro.convection.box import Fluid
from shockgrid.hydro.convection.equations import Equations, Factors
from shockgrid.regrid.errors import BadInput, RunFailure

# (equations of the new grid, time) -> (force on the control volumes of all faces [m4/s2],
# heat over rho cp into the cells [K m2/s])
Sources = Callable[[Equations, float], tuple[np.ndarray, np.ndarray]]
BOX_STEP_GROWTH = 1.25  # dt grows only if it may grow by this factor, so that matrices are reused


@dataclass(frozen=True)
class Level:
    """The state at one time: its grid's equations, psi (free,), temperature (cells,).

    `entered`: heat over rho cp [K m2] added by walls and sources since the start.
    """

    equations: Equations
    psi: np.ndarray
    temperature: np.ndarray
    entered: float = 0.0

    @property
    def momentum(self) -> np.ndarray:
        """Momentum over rho of the control volumes of all faces [m3/s]."""
        momentum = self.equations.momentum
        return momentum.reaches * (momentum.curl @ self.psi)

    @property
    def velocity(self) -> np.ndarray:
        """Velocity on all faces [m/s]."""
        momentum = self.equations.momentum
        return (momentum.curl @ self.psi) / momentum.lengths

    @property
    def heat(self) -> np.ndarray:
        """Content of the cells [K m2]."""
        return self.equations.areas * self.temperature


def compute_swept(old: Equations, new: Equations) -> np.ndarray:
    """Areas swept by all faces between two grids, positive in +x and +y [m2].

    Nodes move uniformly: a face's displacement times its mean length is exact, and the areas that
    the faces of a cell sweep add up exactly to its growth.
    """
    swept_volumes = []
    for k in (0, 1):
        shift = (new.axes[k].nodes - old.axes[k].nodes)[: new.axes[k].node_count]
        length = 0.5 * (new.axes[1 - k].widths + old.axes[1 - k].widths)
        swept = np.outer(shift, length)
        swept_volumes.append((swept if k == 0 else swept.T).ravel())
    return np.concatenate(swept_volumes)


class March:
    """A convecting box in time: `level` is the current state, `t` its time [s]."""

    def __init__(
        self,
        equations: Equations,
        fluid: Fluid,
        psi: np.ndarray,
        temperature: np.ndarray,
        t: float = 0.0,
        cfl: float = 0.5,
        longest: float = math.inf,
        sources: Sources | None = None,
    ):
        """Begin from psi (free,) [m2/s] and temperature (cells,) [K]; `longest` bounds dt [s].

        cfl: fraction of the time in which a cell's content flows out of it.  Raises BadInput.
        """
        if not 0.0 < cfl <= 1.0:
            raise BadInput(f"convection: cfl = {cfl:g} must be above 0 and at most 1")
        if not longest > 0.0:
            raise BadInput(f"convection: the longest step, {longest:g} s, must be positive")
        self.fluid = fluid
        self.cfl = cfl
        self.longest = longest
        self.sources = sources
        self.level = Level(
            equations, np.array(psi, dtype=np.float64), np.array(temperature, dtype=np.float64)
        )
        self.before: Level | None = None
        self.t = t
        self.dt = 0.0
        self.step = 0
        self.dt_limit = "longest"
        # of the matrices: what they were made for, and what is made with them
        self._key: tuple | None = None
        self._held: Equations | None = None
        self._factors: tuple[Factors, Factors] | None = None
        self._buoyancy: sparse.csr_matrix | None = None

    @property
    def equations(self) -> Equations:
        """Those of the current grid."""
        return self.level.equations

    def compute_longest_step(self) -> tuple[float, str]:
        """(the longest step [s], its limit): "flow" through a cell, or the given "longest"."""
        equations = self.equations
        flux = np.abs(equations.momentum.curl @ self.level.psi)
        across, up = equations.split_faces(flux)
        through = np.zeros(equations.shape)
        for k, speeds in ((0, across), (1, up)):
            speeds = np.moveaxis(speeds, k, 0)
            ends = (
                speeds + np.roll(speeds, -1, axis=0)
                if equations.axes[k].periodic
                else (speeds[1:] + speeds[:-1])
            )
            through += 0.5 * np.moveaxis(ends, 0, k)
        fastest = float((through / equations.areas.reshape(equations.shape)).max())
        if fastest == 0.0 or fastest * self.longest <= self.cfl:
            return self.longest, "longest"
        return self.cfl / fastest, "flow"

    def choose_step(self, remaining: float = math.inf) -> float:
        """dt [s] of the next step: the last one if it is still allowed, at most `remaining`."""
        longest, dt_limit = self.compute_longest_step()
        if not math.isfinite(longest):
            raise BadInput(
                "convection: the fluid is at rest and no longest step is given; give one"
            )
        dt = self.dt
        if not self.dt or dt > longest or longest > BOX_STEP_GROWTH * dt:
            dt = longest if dt_limit == "longest" else longest / math.sqrt(BOX_STEP_GROWTH)
            self.dt_limit = dt_limit
        if dt >= remaining * (1.0 - 1e-12):
            self.dt_limit = "end"
            return remaining
        return 0.5 * remaining if 2.0 * dt > remaining else dt

    def advance(self, dt: float, axes: tuple[np.ndarray, np.ndarray] | None = None) -> None:
        """One step of length dt [s], to the nodes `axes` (x, y) if the grid moves.

        Raises RunFailure if the state is no longer finite.
        """
        old = self.level
        before = self.before
        new = old.equations if axes is None else Equations(*axes, old.equations.walls)
        ratio = dt / self.dt if before is not None else 0.0
        a0 = (1.0 + 2.0 * ratio) / (1.0 + ratio)
        a2 = ratio * ratio / (1.0 + ratio)
        a1 = -(a0 + a2)

        def extrapolate(name: str) -> np.ndarray:
            value = getattr(old, name)
            return value if before is None else value + ratio * (value - getattr(before, name))

        def past(name: str) -> np.ndarray:
            value = a1 * getattr(old, name)
            return value if before is None else value + a2 * getattr(before, name)

        # W (a0 swept - a2 swept before) is the backward difference of the areas
        relative = new.momentum.curl @ extrapolate("psi")
        if new is not old.equations:
            relative -= a0 / dt * compute_swept(old.equations, new)
        if before is not None and before.equations is not old.equations:
            relative += a2 / dt * compute_swept(before.equations, old.equations)
        t = self.t + dt
        force, heat = (0.0, 0.0) if self.sources is None else self.sources(new, t)
        conduction, friction = self._factorise(new, a0 / dt)

        carried = relative * (new.heat.values @ extrapolate("temperature"))
        wall_heat = self.fluid.diffusivity * new.wall_gradient + new.wall_flux
        temperature = conduction.solve(
            heat - past("heat") / dt - new.heat.balance @ (carried - wall_heat)
        )
        momentum = new.momentum
        velocity = momentum.carry @ extrapolate("velocity")
        right = momentum.sum_around(force - past("momentum") / dt)
        right -= momentum.sum_carried((new.topology.spread @ relative) * velocity)
        right += self._buoyancy @ temperature
        psi = friction.solve(right)
        if not (np.isfinite(psi).all() and np.isfinite(temperature).all()):
            raise RunFailure(
                f"convection: the state is not finite at t = {t:.6g} s (step {self.step + 1})",
                cause="not-finite",
            )
        entering = heat + new.heat.balance @ new.compute_conduction(self.fluid, temperature)
        entered = (dt * float(entering.sum()) - past("entered")) / a0
        self.before = old
        self.level = Level(new, psi, temperature, entered)
        self.t = t
        self.dt = dt
        self.step = self.step + 1

    def _factorise(self, new: Equations, rate: float) -> tuple[Factors, Factors]:
        """LU of the matrices of heat and momentum; reused while grid and rate are unchanged."""
        key = (id(new), rate)
        if self._key != key:
            fluid = self.fluid
            self._buoyancy = new.buoyancy(fluid)
            heat = rate * sparse.diags(new.areas) - fluid.diffusivity * new.heat.conduction
            flow = rate * new.momentum.mass - fluid.viscosity * new.momentum.friction
            self._factors = Factors(heat, "matrix of the heat"), Factors(flow, "matrix of the flow")
            self._key = key
            self._held = new  # so that its id is not reused
        return self._factors

    def get_state(self) -> dict[str, np.ndarray | float | int | str]:
        """All that the next step depends on; the current level twice where there is none before."""
        state = {"t": self.t, "dt": self.dt, "step": self.step, "limit": self.dt_limit}
        state["levels"] = 1 if self.before is None else 2
        for name, level in (("now", self.level), ("before", self.before or self.level)):
            x, y = (axis.nodes for axis in level.equations.axes)
            state |= {f"{name}/x": x, f"{name}/y": y}
            state |= {f"{name}/psi": level.psi, f"{name}/temperature": level.temperature}
            state[f"{name}/entered"] = level.entered
        state["still"] = int(self.before is None or self.before.equations is self.equations)
        return state

    def set_state(self, state) -> None:
        """Restore a state of `get_state`."""
        walls = self.equations.walls
        now = Equations(state["now/x"], state["now/y"], walls)
        same = bool(state["still"])
        equations_before = now if same else Equations(state["before/x"], state["before/y"], walls)
        levels = [
            Level(
                grid,
                np.array(state[f"{name}/psi"]),
                np.array(state[f"{name}/temperature"]),
                float(state[f"{name}/entered"]),
            )
            for name, grid in (("now", now), ("before", equations_before))
        ]
        self.level = levels[0]
        self.before = levels[1] if int(state["levels"]) == 2 else None
        self.t = float(state["t"])
        self.dt = float(state["dt"])
        self.step = int(state["step"])
        self.dt_limit = str(state["limit"])
        self._key = None
