"""What `shockgrid verify` runs: one entry a statement, with its bar and what others reach.

`quantity` is a name of the problem's `errors` or a column of its history, whose last finite value
counts; all are errors, the smaller the better.  A new standard problem adds its line here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


def _cells(n: int) -> tuple[str, ...]:
    return (f"cells={n}",)


@dataclass(frozen=True)
class Case:
    """A problem at several sizes, and one error of it.

    deck: a problem or packaged deck; sizes: rising, the bar is for the one at `judged`; the short
    form runs `short` alone; order: the least order between neighbouring sizes that is asked for.
    """

    deck: str
    what: str
    quantity: str
    sizes: tuple[int, ...]
    short: int
    bar: float | None = None
    judged: int = -1
    order: float | None = None
    others: str = ""
    settings: tuple[str, ...] = ()
    refine: Callable[[int], tuple[str, ...]] = _cells


CASES = (
    Case(
        "vortex", "mean density error at t = 10, swinging grid", "error_rho",
        (32, 64, 128), 16, order=1.9,
        others="fixed grid, computed independently: 6.7e-3, 1.6e-3, 3.7e-4",
    ),
    Case(
        "riemann", "Sod, L1 of density at t = 0.2", "l1_rho", (100, 200, 400), 50, bar=0.0044,
        judged=0, others="plain MUSCL on a fixed grid: 4.4e-3, 2.8e-3, 1.5e-3",
    ),
    Case(
        "saltzmann", "density 4 behind the first shock, mean", "mean_error_1", (100, 200), 50,
        bar=0.02, judged=0, refine=lambda n: (f"cells={n}", f"rows={n // 10}"),
    ),
    Case(
        "saltzmann", "density 10 after the wall, mean", "mean_error_2", (100, 200), 50,
        bar=0.02, judged=0, refine=lambda n: (f"cells={n}", f"rows={n // 10}"),
    ),
    Case(
        "saltzmann", "density 20 after the piston, mean", "mean_error_3", (100, 200), 50,
        bar=0.02, judged=0, refine=lambda n: (f"cells={n}", f"rows={n // 10}"),
    ),
    Case(
        "kidder", "outer radius at h = 1/2", "outer_error", (10, 20, 40), 10, order=1.7,
        refine=lambda n: (f"cells={n}", f"rays={3 * n}"),
    ),
    Case(
        "kidder", "inner radius at h = 1/2", "inner_error", (10, 20, 40), 10, order=1.7,
        refine=lambda n: (f"cells={n}", f"rays={3 * n}"),
    ),
    Case(
        "noh", "cylinder, density in r < 0.4", "error_rho", (50, 100, 200), 40, bar=0.035,
        judged=1, others="at 100: Athena++ .036, pyro2 .051, BookLeaf (polar grid) .033",
    ),
    Case(
        "noh", "sphere in axisymmetric flow, density in r < 0.4", "error_rho", (50, 100, 200), 40,
        bar=0.10, judged=1, settings=("geometry=spherical",), others="at 100: PENNANT .14",
    ),
    Case(
        "sedov", "cylinder, density", "error_rho", (50, 100, 200), 40, bar=0.018, judged=1,
        others="at 100: BookLeaf .018",
    ),
    Case(
        "sedov", "sphere in axisymmetric flow, density", "error_rho", (50, 100), 40,
        settings=("geometry=spherical",),
    ),
    Case(
        "sedov", "sphere in axisymmetric flow, energy gained", "energy", (50, 100), 40, bar=1e-12,
        settings=("geometry=spherical",), others="PENNANT .11",
    ),
    Case(
        "conical-target", "pressure at the impact face", "impact", (32, 48), 32, bar=0.01,
        judged=0, settings=("run.t_end=6e-7",), others="26.980 GPa from both Hugoniots",
    ),
    Case("gresho", "kinetic energy lost in one turn", "lost", (20, 40, 80), 20, bar=0.02, judged=1),
    Case(
        "taylor-green", "mean velocity error at t = 0.75, swinging grid", "error_velocity",
        (16, 32, 64), 16, order=1.9,
        others="grids that follow the material tangle by then",
    ),
    Case(
        "rayleigh-taylor", "growth rate, 2:1", "rate", (32, 64), 16, bar=0.02,
        others="1.447197 without compression",
    ),
    Case(
        "rayleigh-taylor", "frequency of a standing wave", "rate", (32, 64), 16, bar=0.01,
        settings=("above=nothing",), others="2.506620 without compression",
    ),
    Case("oblique-shock", "angle of the shock, Mach 2.5 on 15 degrees", "angle", (50, 100), 40,
         bar=0.005),
    Case("oblique-shock", "pressure on the wedge", "pressure", (50, 100), 40, bar=0.005),
    Case(
        "triple-point", "pressure and velocity beside the first contacts, worst", "star",
        (20, 40), 20, bar=0.02, settings=("run.t_end=0.26",),
    ),
    Case(
        "shock-bubble", "upwind end of helium, mean over 0.3 radii, to the plane contact",
        "upwind_speed", (8, 16), 6, settings=("run.t_end=4e-5",),
        others="no bar: the curved contact leaves the plane one's speed at once",
    ),
    Case(
        "detonation", "TNT, speed of a front left to itself", "cj_speed", (100, 200, 400), 100,
        bar=0.005, settings=("behind=wall", "clock=0.1"), others="6929 m/s, of the JWL",
    ),
    Case(
        "detonation", "TNT, Taylor's wave", "taylor", (100, 200, 400), 100, order=0.9,
        settings=("behind=wall",), others="quadrature on the JWL isentrope",
    ),
    Case(
        "detonation", "TNT, peak, from below", "cj_pressure", (100, 200, 400), 100, bar=0.05,
        settings=("behind=wall",), others="21.00 GPa",
    ),
    Case(
        "detonation", "Comp B, speed of a front left to itself", "cj_speed", (100, 200, 400), 100,
        bar=0.005, settings=("explosive=Comp-B", "behind=wall", "clock=0.1"),
        others="7980 m/s, of the JWL",
    ),
    Case(
        "detonation", "Comp B, Taylor's wave", "taylor", (100, 200, 400), 100, order=0.9,
        settings=("explosive=Comp-B", "behind=wall",), others="quadrature on the JWL isentrope",
    ),
    Case(
        "detonation", "Comp B, peak, from below", "cj_pressure", (100, 200, 400), 100, bar=0.05,
        settings=("explosive=Comp-B", "behind=wall",), others="29.50 GPa",
    ),
    Case(
        "detonation", "TNT, pressure before a piston", "cj_pressure", (100, 400), 60, bar=0.03,
        others="21.00 GPa",
    ),
)  # fmt: skip
