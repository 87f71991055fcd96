"""The cases: states, references, and how the error is measured from what a code computed.

Every case is a dictionary of plain numbers, so that a script under another interpreter reads it
from JSON.  Units are those of the decks (gas at density 1 and pressure 1, wavelength 1).
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import shockgrid as sg

GAMMA = 1.4


@dataclass(frozen=True)
class Case:
    """One case: its title, the numbers that peers get, the reference, and grids by code."""

    name: str
    title: str
    error_name: str
    numbers: dict[str, Any]
    cells: dict[str, tuple[int, ...]] = field(default_factory=dict)

    def measure(self, found: dict[str, Any]) -> float:
        """Relative error of what a code found (see `python_peers.py` for its keys)."""
        numbers = self.numbers
        if "rate" in numbers:
            first, last = numbers["times"]
            t = np.array(found["t"])
            a = np.array(found["amplitude"])
            rate = np.diff(np.interp((first, last), t, a))[0] / (last - first)
            return float(rate / numbers["rate"] - 1.0)
        if "amplitude" in numbers:
            t = np.array(found["t"])
            a = np.array(found["amplitude"])
            return float(np.interp(numbers["times"][-1], t, a) / numbers["amplitude"] - 1.0)
        x, y = np.array(found["x"]), np.array(found["y"])
        rho = np.array(found["rho"])
        volume = np.array(found["volume"])
        exact = compute_exact_density(self, x, y)
        near = np.hypot(x, y) < numbers["radius"] if "radius" in numbers else np.full(x.shape, True)
        off = np.abs(rho - exact) * volume
        return float(off[near].sum() / (exact * volume)[near].sum())


def compute_exact_density(case: Case, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Exact density at points at the end of `noh`, `sedov` or `contact`."""
    numbers = case.numbers
    if case.name == "contact":
        inside = np.abs(x - numbers["centre"]) < 0.5 * numbers["width"]
        return np.where(inside, numbers["rho"][1], numbers["rho"][0])
    problem = sg.load(case.name.split("-")[0], geometry=numbers["geometry"]).problem
    radii = np.hypot(x, y)
    t = numbers["t_end"]
    if case.name == "noh":
        return problem.compute_density(radii, t)
    return problem.blast.sample(radii, t)[0]


def make_shocked_interface(deck: str, **settings: Any) -> dict[str, Any]:
    """Numbers of a shocked interface of one gas in the frame of the interface after the shock.

    The front meets the mean interface x = 0 at t = 0; `left`, `right` and `heavy` are
    (rho, u, p) behind the shock, before it and beyond the interface.
    """
    problem = sg.load(deck, cells=16, **settings).problem
    base = problem.linear_growth.base
    shock = problem.shock
    sound = problem.linear_growth.sound_speed
    ka0 = problem.deck.modes[0].ka0
    return {
        "gamma": GAMMA,
        "front": shock.shock_speed,
        "interface": base.u_left,
        "left": (shock.rho, shock.particle_speed - base.u_left, shock.p),
        "right": (1.0, -base.u_left, 1.0),
        "heavy": (problem.deck.second.rho, -base.u_left, 1.0),
        "shocked": (base.rho_left, base.rho_right),
        "a0": ka0 / (2.0 * math.pi),
        "k_c": 2.0 * math.pi * sound,
    }


def make_growth(name: str = "growth") -> Case:
    """Rate of growth against linear compressible theory less its first saturation.

    The first Fourier mode grows more slowly by (4 A² + 1) (k a)²/8 [ZhangSohn1997].
    `growth`: all codes compute the shock's passage.  `growth-behind`: the default deck, which
    begins with theory's flow behind the shocks, as only this code does.
    """
    numbers = make_shocked_interface("interface-instability")
    problem = sg.load("interface-instability", cells=16, kct_end=25.0).problem
    wavenumber = 2.0 * math.pi
    times = [kct / numbers["k_c"] for kct in (6.0, 25.0)]
    first, last = (float(problem.linear_growth.get_amplitude(wavenumber, t)) for t in times)
    scale = numbers["a0"]  # theory's amplitude is in parts of the first
    mean_square = (wavenumber * scale) ** 2 * (first**2 + first * last + last**2) / 3.0
    saturation = (4.0 * problem.linear_growth.atwood**2 + 1.0) / 8.0 * mean_square
    rate = scale * (last - first) / (times[1] - times[0])
    numbers |= {"times": times, "rate": rate * (1.0 - saturation)}
    title = "growth of a shocked interface, Mach 1.5, density ratio 3, k a0 = 0.02"
    cells: dict[str, tuple[int, ...]] = {"shockgrid": (16, 24, 32, 64, 128)}
    if name == "growth":
        cells = {
            "shockgrid": (16, 24, 32, 48, 64, 96),
            "cloverleaf": (32, 64, 128, 256),
            "pyclaw": (32, 64, 128, 256),
            "amrclaw": (64, 128, 256, 512),
            "athena": (64, 128, 256),
            "pyro": (32, 64, 128),
        }
    else:
        title = "the same, initialised from linear theory after the shock's passage"
    error_name = "growth rate of the first mode, 6 < k c t < 25, against theory"
    return Case(name, title, error_name, numbers, cells)


def make_mushroom() -> Case:
    """A steep wave of one gas: half its width at k c t = 15, against this code on 256 cells."""
    numbers = make_shocked_interface("interface-instability-mushroom", **MUSHROOM)
    numbers |= {"times": [15.0 / numbers["k_c"]], "amplitude": math.nan}
    return Case(
        "mushroom",
        "large-amplitude growth, Mach 1.2, density ratio 5.1, gamma 1.4, k a0 = 0.5, to k c t = 15",
        "half the width of the interface, relative to shockgrid at 256 cells per wavelength",
        numbers,
        {
            "shockgrid": (16, 32, 64, 128),
            "cloverleaf": (32, 64, 128, 256),
            "pyclaw": (32, 64, 128, 256),
            "amrclaw": (64, 128, 256, 512),
            "athena": (64, 128, 256),
            "pyro": (32, 64, 128),
        },
    )


def make_contact() -> Case:
    """A slab ten times as dense as its surroundings moves by ten times its width."""
    numbers = {
        "gamma": GAMMA,
        "rho": (1.0, 10.0),
        "u": 1.0,
        "p": 1.0,
        "width": 1.0,
        "t_end": 10.0,
        "length": 2.0,  # of a periodic domain: the cheapest for a grid at rest
        "centre": 1.0,
        "rows": 8,
    }
    return Case(
        "contact",
        "a slab ten times as dense, advected over ten of its widths",
        "L1 of the density",
        numbers,
        {"shockgrid": (8, 16), "pyclaw": (16, 32, 64, 128, 256, 512), "pyro": (16, 32, 64, 128)},
    )


def make_noh() -> Case:
    """Noh's sphere on a rectangle beside the axis."""
    numbers = {"gamma": 5.0 / 3.0, "t_end": 0.6, "radius": 0.4, "size": 1.0}
    return Case(
        "noh",
        "spherical Noh problem on a rectangular axisymmetric grid",
        "L1 of the density out to twice the shock's radius",
        numbers | {"geometry": "spherical"},
        {"shockgrid": (50, 100, 200, 400, 800), "pennant": (50, 100, 200)},
    )


def make_sedov(geometry: str = "spherical") -> Case:
    """Sedov's blast on a quarter; the energy starts in the corner's cell."""
    blast = sg.load("sedov", geometry=geometry).problem.blast
    sphere = geometry == "spherical"
    share = 0.25 / math.pi if sphere else 0.25  # of a quarter, for a sphere a radian
    numbers = {"gamma": GAMMA, "p": 1e-8, "t_end": 1.0, "size": 1.2, "energy": share * blast.energy}
    grids = (50, 100, 200)
    peers = {"pennant": grids} if sphere else {"pyclaw": (*grids, 400), "pyro": grids}
    return Case(
        "sedov" if sphere else "sedov-cylinder",
        f"{'spherical' if sphere else 'cylindrical'} Sedov blast on a rectangular grid",
        "L1 of the density",
        numbers | {"geometry": geometry},
        {"shockgrid": (50, 100, 200, 400)} | peers,
    )


MUSHROOM = {"second": {"gamma": GAMMA, "rho": 5.1}, "kct_end": 15.0}
CASES = {
    "growth": make_growth,
    "growth-behind": functools.partial(make_growth, "growth-behind"),
    "mushroom": make_mushroom,
    "contact": make_contact,
    "noh": make_noh,
    "sedov": make_sedov,
    "sedov-cylinder": functools.partial(make_sedov, "cylindrical"),
}
