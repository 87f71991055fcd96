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

    deck: a problem or packaged deck; sizes: rising, the bar is for the one at `judged`; order: the
    least order that is asked for between the last two.  The short form runs `short` alone (None: no
    part of it) and judges it by `short_bar`, at most a third above what is reached there.
    `converges` is False where the error is round-off, passes through zero or is of an experiment:
    no order is printed.
    """

    deck: str
    what: str
    quantity: str
    sizes: tuple[int, ...]
    short: int | None
    short_bar: float | None = None
    bar: float | None = None
    judged: int = -1
    order: float | None = None
    converges: bool = True
    others: str = ""
    settings: tuple[str, ...] = ()
    refine: Callable[[int], tuple[str, ...]] = _cells


def _saltzmann(n: int) -> tuple[str, ...]:
    return (f"cells={n}", f"rows={n // 10}")


def _kidder(n: int) -> tuple[str, ...]:
    return (f"cells={n}", f"rays={3 * n}")


BUBBLE = ("run.t_end=2.6e-4",)
HEAVY_BUBBLE = ("run.t_end=4.1e-4",)

CASES = (
    Case(
        "free-stream", "deviation from a stream through a grid shaken at random, 100 steps",
        "deviation", (24,), 12, 1e-13, bar=1e-13, converges=False,
    ),
    Case(
        "vortex", "mean density error at t = 10, swinging grid", "error_rho",
        (32, 64, 128), 16, 0.021, order=1.9,
        others="fixed grid, computed independently: 6.7e-3, 1.6e-3, 3.7e-4",
    ),
    Case(
        "riemann", "Sod, L1 of density at t = 0.2", "l1_rho", (100, 200, 400), 50, 0.006,
        bar=0.0044, judged=0, others="plain MUSCL on a fixed grid: 4.4e-3, 2.8e-3, 1.5e-3",
    ),
    *(
        Case(
            "saltzmann", f"density {density} behind {shock} shock, {words}", f"{kind}_error_{n}",
            (100, 200), 50, short_bar, bar=0.02, judged=0, converges=False, refine=_saltzmann,
        )
        for n, density, shock, short_bars in (
            (1, 4, "the first", (0.0085, 0.0205, 0.0445)),
            (2, 10, "the wall's", (0.0043, 0.0157, 0.027)),
            (3, 20, "the piston's", (0.0025, 0.0152, 0.0322)),
        )
        for kind, words, short_bar in zip(
            ("mean", "rms", "worst"), ("mean", "rms", "worst cell"), short_bars, strict=True
        )
    ),
    Case(
        "saltzmann", "largest speed across the tube at t = 0.93, piston 1", "transverse_speed",
        (100, 200), 50, 0.055, refine=_saltzmann,
    ),
    Case(
        "kidder", "outer radius at h = 1/2", "outer_error", (20, 40, 80), 10, 0.00072, order=1.9,
        refine=_kidder,
    ),
    Case(
        "kidder", "inner radius at h = 1/2", "inner_error", (20, 40, 80), 10, 0.0055,
        converges=False, refine=_kidder,
        others="the error passes through zero: orders mean little",
    ),
    Case("kidder", "mean density at h = 1/2", "error_rho", (20, 40, 80), 10, 0.045,
         order=1.9, refine=_kidder),
    Case(
        "noh", "cylinder, density in r < 0.4", "error_rho", (50, 100, 200), 50, 0.052, bar=0.035,
        judged=1, others="at 100: Athena++ .036, pyro2 .051, BookLeaf (polar grid) .033",
    ),
    Case(
        "noh", "sphere in axisymmetric flow, density in r < 0.4", "error_rho", (50, 100, 200), 50,
        0.09, bar=0.10, judged=1, settings=("geometry=spherical",), others="at 100: PENNANT .14",
    ),
    Case("noh", "plane, density in r < 0.4", "error_rho", (50, 100, 200), 50, 0.029,
         settings=("geometry=plane",)),
    Case(
        "sedov", "cylinder, density", "error_rho", (50, 100, 200), 50, 0.018, bar=0.018, judged=1,
        others="at 100: BookLeaf .018",
    ),
    Case(
        "sedov", "sphere in axisymmetric flow, density", "error_rho", (50, 100), 50, 0.058,
        settings=("geometry=spherical",),
    ),
    Case(
        "sedov", "sphere in axisymmetric flow, energy gained", "energy", (50, 100), 50, 1e-12,
        bar=1e-12, converges=False, settings=("geometry=spherical",), others="PENNANT .11",
    ),
    Case("sedov", "plane, grid at rest, density", "error_rho", (50, 100, 200), 50, 0.083,
         settings=("geometry=plane",)),
    Case(
        "conical-target", "pressure at the impact face", "impact", (32, 48), 32, 0.0094, bar=0.01,
        judged=0, converges=False, settings=("run.t_end=6e-7",),
        others="26.980 GPa from both Hugoniots",
    ),
    Case("gresho", "kinetic energy lost in one turn", "lost", (20, 40, 80), 20, 0.135, bar=0.02,
         judged=1),
    Case(
        "taylor-green", "mean velocity error at t = 0.75, grid on the gas's paths",
        "error_velocity", (16, 32, 64), 16, 0.08, order=1.9, settings=("mesh=follow",),
        others="grids that computed velocities move tangle by then",
    ),
    Case(
        "taylor-green", "mean velocity error at t = 0.75, grid swung out", "error_velocity",
        (16, 32, 64), 16, 0.007, order=1.9,
    ),
    Case(
        "rayleigh-taylor", "growth rate, 2:1", "rate", (32, 64), 32, 0.025, bar=0.02,
        others="1.447197 without compression",
    ),
    Case(
        "rayleigh-taylor", "frequency of a standing wave", "rate", (32, 64), 32, 0.0088, bar=0.01,
        settings=("above=nothing",), others="2.506620 without compression",
    ),
    Case("oblique-shock", "angle of the shock, Mach 2.5 on 15 degrees", "angle", (50, 100), 50,
         0.0009, bar=0.005),
    Case("oblique-shock", "pressure on the wedge", "pressure", (50, 100), 50, 0.0007,
         bar=0.005),
    Case(
        "triple-point", "pressure and velocity beside the first contacts, worst", "star",
        (20, 40), 20, 0.024, bar=0.02, settings=("run.t_end=0.26",),
    ),
    Case(
        "triple-point", "mass of each gas to t = 5", "mass", (10,), None, bar=1e-12,
        converges=False,
    ),
    *(
        Case(
            "shock-bubble", f"helium, {words}", words, (8,), 8, short_bar, bar=0.10,
            converges=False, settings=BUBBLE, others=f"experiment {speed} m/s, good to 10 %",
        )
        for words, speed, short_bar in (
            ("refracted shock", 900, 0.036), ("transmitted shock", 393, 0.017),
            ("upwind end", 170, 0.026), ("jet of air", 230, 0.09), ("downwind end", 145, 0.1),
        )
    ),
    *(
        Case(
            "shock-bubble-r22", words, quantity, (8, 12), None, bar=bar, converges=False,
            settings=HEAVY_BUBBLE, others=others,
        )
        for words, quantity, bar, others in (
            ("refracted shock", "refracted shock", 0.10, "experiment 240 m/s (from memory)"),
            ("upwind end until the refracted shock leaves", "upwind end", 0.10,
             "experiment 73 m/s (from memory)"),
            ("upwind end to 400 us", "upwind end to 400 us", 0.02, "fixed grid 65.0 m/s"),
            ("downwind end's turn", "focus", 0.02, "fixed grid 200.8 us"),
            ("downwind end, no bar: finer grids pierce farther", "downwind end", None,
             "experiment 78 m/s (from memory), fixed grids 72, 78, 92 m/s"),
        )
    ),
    Case(
        "detonation", "TNT, speed of a front left to itself", "cj_speed", (100, 200, 400), 100,
        0.011, bar=0.005, converges=False,
        settings=("behind=wall", "clock=0.1"), others="6929 m/s, of the JWL",
    ),
    Case(
        "detonation", "TNT, Taylor's wave", "taylor", (100, 200, 400), 100, 0.085, order=0.9,
        settings=("behind=wall",), others="quadrature on the JWL isentrope",
    ),
    Case(
        "detonation", "TNT, peak, from below", "cj_pressure", (100, 200, 400), 100, 0.12,
        bar=0.05, settings=("behind=wall",), others="21.00 GPa",
    ),
    Case(
        "detonation", "Comp B, speed of a front left to itself", "cj_speed", (100, 200, 400), 100,
        0.0075, bar=0.005, converges=False,
        settings=("explosive=Comp-B", "behind=wall", "clock=0.1"),
        others="7980 m/s, of the JWL",
    ),
    Case(
        "detonation", "Comp B, Taylor's wave", "taylor", (100, 200, 400), 100, 0.085, order=0.9,
        settings=("explosive=Comp-B", "behind=wall",), others="quadrature on the JWL isentrope",
    ),
    Case(
        "detonation", "Comp B, peak, from below", "cj_pressure", (100, 200, 400), 100, 0.12,
        bar=0.05, settings=("explosive=Comp-B", "behind=wall",), others="29.50 GPa",
    ),
    Case(
        "detonation", "TNT, pressure before a piston", "cj_pressure", (100, 400), 100, 0.001,
        bar=0.03, converges=False, others="21.00 GPa",
    ),
)  # fmt: skip
