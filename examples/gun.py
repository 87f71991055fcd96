"""A piston drives a shock into gas at rest: pressure behind it and its speed against theory."""

import math

import numpy as np

import shockgrid as sg


class GunDeck(sg.Deck, kw_only=True):
    run: sg.RunControl = sg.RunControl(t_end=0.4)
    speed: sg.key(float, "of the piston over the sound speed at rest", gt=0, le=20) = 1.0
    gamma: sg.key(float, "ratio of specific heats", gt=1, le=5) = 1.4
    cells: sg.key(int, "along the tube", ge=16, le=4000) = 100


class Gun(sg.Problem):
    Deck = GunDeck

    def compute_shock(self):
        """Mach number of the shock and pressure behind it, over that at rest."""
        half = 0.25 * (self.deck.gamma + 1.0) * self.deck.speed
        mach = half + math.sqrt(half * half + 1.0)
        return mach, 1.0 + 2.0 * self.deck.gamma / (self.deck.gamma + 1.0) * (mach * mach - 1.0)

    def build(self):
        x = np.linspace(0.0, 1.0, self.deck.cells + 1)
        nodes = sg.make_plane_grid(x, 4.0 * x[1] * np.linspace(0.0, 1.0, 5))
        rest = self.deck.gamma, 0.0, 0.0, 1.0  # the speed of sound is 1
        gas = sg.Block("gas", sg.IdealGas(self.deck.gamma), nodes, *rest)
        sg.put(gas, "i_min", "piston", velocity=(self.deck.speed, 0.0))
        sg.put_walls(gas)
        return self.simulate([gas])

    def measure(self, evolution):
        p = evolution["gas"].p[:, 0]
        shocked = p > 0.5 * (1.0 + p[0])
        return {"pressure": float(p[: max(1, shocked.sum() // 2)].mean())}

    def report(self, run):
        mach, pressure = self.compute_shock()
        row = run.compare("pressure", pressure, "pressure behind", error="pressure")
        return sg.Report(f"a shock of Mach {mach:.3f}", [row])
