"""An equation of state of one's own: a gas whose molecules take up room (Noble and Abel)."""

from dataclasses import dataclass

import numpy as np

import shockgrid as sg

GAMMA, COVOLUME = range(2)


@sg.inlined
def pressure(rho, e, parameters):
    return (parameters[GAMMA] - 1.0) * rho * e / (1.0 - parameters[COVOLUME] * rho)


@sg.inlined
def energy(rho, p, parameters):
    return p * (1.0 - parameters[COVOLUME] * rho) / ((parameters[GAMMA] - 1.0) * rho)


@sg.inlined
def sound_speed_squared(rho, p, parameters):
    return parameters[GAMMA] * p / (rho * (1.0 - parameters[COVOLUME] * rho))


@sg.inlined
def least_pressure(parameters):
    return -1e300


@dataclass(frozen=True)
class NobleAbel(sg.EquationOfState):
    """p (1/rho - covolume) = (gamma - 1) e."""

    gamma: float = 1.4
    covolume: float = 1e-3

    kind = "noble-abel"
    opens_voids = False
    pressure_part = staticmethod(pressure)
    energy_part = staticmethod(energy)
    sound_speed_squared_part = staticmethod(sound_speed_squared)
    least_pressure_part = staticmethod(least_pressure)

    @property
    def wave_law(self):
        slope = 0.25 * (self.gamma + 1.0)
        return slope, slope, 0.0


eos = NobleAbel(1.25, 1e-3)
sg.testing.check_eos(eos, (100.0, 200.0), (1e8, 2e8))
nodes = sg.make_plane_grid(np.linspace(0.0, 0.5, 61), np.linspace(0.0, 0.05, 5))
gas = sg.Block("gas", eos, nodes, 150.0, 0.0, 0.0, 1.2e8)
sg.put(gas, "i_min", "piston", velocity=(200.0, 0.0))
sg.put_walls(gas)
run = sg.run(sg.Simulation([gas], [], t_end=2e-4), "out/stiff-gas", force=True)
p = run.dumps[-1]["gas"].p[5:15].mean()
# jump conditions of this gas: those of an ideal one in 1/rho - covolume, at rest
free = 1.0 / 150.0 - 1e-3
rise = 0.25 * 2.25 * 200.0**2 / free
exact = 1.2e8 + rise + np.sqrt(rise**2 + 1.25 * 1.2e8 * 200.0**2 / free)
print(f"pressure behind the shock {p:.5g} Pa, exact {exact:.5g} Pa")
assert abs(p / exact - 1.0) < 3e-3
