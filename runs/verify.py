"""`shockgrid verify`: the standard problems at stated sizes: errors, orders, bars.

`quantity` of a case is a name of the problem's `errors` or a column of its history, whose last
finite value counts; all are errors, the smaller the better.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from regrid.errors import BadInput, RunFailure
from runs.deck.reading import read_deck, suggest_deck
from runs.engines import Engine, InTurn, open_engine
from runs.store.files import check_free, write_atomically
from runs.store.provenance import describe_software


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
        "free-stream", "deviation from uniform flow on a randomly moving grid, 100 steps",
        "deviation", (24,), 12, 1e-13, bar=1e-13, converges=False,
    ),
    Case(
        "vortex", "mean density error at t = 10, oscillating grid", "error_rho",
        (32, 64, 128), 16, 0.021, order=1.9,
        others="fixed grid, computed independently: 6.7e-3, 1.6e-3, 3.7e-4",
    ),
    Case(
        "riemann", "Sod, L1 of density at t = 0.2", "l1_rho", (100, 200, 400), 50, 0.006,
        bar=0.0044, judged=0, others="plain MUSCL on a fixed grid: 4.4e-3, 2.8e-3, 1.5e-3",
    ),
    *(
        Case(
            "saltzmann", f"density behind {shock} (exact: {density}), {words}", f"{kind}_error_{n}",
            (100, 200), 50, short_bar, bar=0.02, judged=0, converges=False, refine=_saltzmann,
        )
        for n, density, shock, short_bars in (
            (1, 4, "the first shock", (0.0085, 0.0205, 0.0445)),
            (2, 10, "the shock from the wall", (0.0043, 0.0157, 0.027)),
            (3, 20, "the shock from the piston", (0.0025, 0.0152, 0.0322)),
        )
        for kind, words, short_bar in zip(
            ("mean", "rms", "worst"), ("mean", "rms", "worst cell"), short_bars, strict=True
        )
    ),
    Case(
        "saltzmann", "largest transverse speed at t = 0.93 (piston speed 1)", "transverse_speed",
        (100, 200), 50, 0.055, refine=_saltzmann,
    ),
    Case(
        "kidder", "outer radius at h = 1/2", "outer_error", (20, 40, 80), 10, 0.00072, order=1.9,
        refine=_kidder,
    ),
    Case(
        "kidder", "inner radius at h = 1/2", "inner_error", (20, 40, 80), 10, 0.0055,
        converges=False, refine=_kidder,
        others="the error passes through zero, so orders mean little",
    ),
    Case("kidder", "mean density at h = 1/2", "error_rho", (20, 40, 80), 10, 0.045,
         order=1.9, refine=_kidder),
    Case(
        "noh", "cylinder, density in r < 0.4", "error_rho", (50, 100, 200), 50, 0.052, bar=0.035,
        judged=1, others="at 100: Athena++ 0.036, pyro2 0.051, BookLeaf (polar grid) 0.033",
    ),
    Case(
        "noh", "sphere in axisymmetric flow, density in r < 0.4", "error_rho", (50, 100, 200), 50,
        0.09, bar=0.10, judged=1, settings=("geometry=spherical",), others="at 100: PENNANT 0.14",
    ),
    Case("noh", "plane, density in r < 0.4", "error_rho", (50, 100, 200), 50, 0.029,
         settings=("geometry=plane",)),
    Case(
        "sedov", "cylinder, density", "error_rho", (50, 100, 200), 50, 0.018, bar=0.018, judged=1,
        others="at 100: BookLeaf 0.018",
    ),
    Case(
        "sedov", "sphere in axisymmetric flow, density", "error_rho", (50, 100), 50, 0.058,
        settings=("geometry=spherical",),
    ),
    Case(
        "sedov", "sphere in axisymmetric flow, error of the total energy", "energy", (50, 100), 50,
        1e-12, bar=1e-12, converges=False, settings=("geometry=spherical",), others="PENNANT 0.11",
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
        "taylor-green", "mean velocity error at t = 0.75, grid moving with the exact flow",
        "error_velocity", (16, 32, 64), 16, 0.08, order=1.9, settings=("mesh=follow",),
        others="grids moved with computed velocities tangle by then",
    ),
    Case(
        "taylor-green", "mean velocity error at t = 0.75, oscillating grid", "error_velocity",
        (16, 32, 64), 16, 0.007, order=1.9,
    ),
    Case(
        "rayleigh-taylor", "growth rate, 2:1", "rate", (32, 64), 32, 0.025, bar=0.02,
        others="1.447197, incompressible",
    ),
    Case(
        "rayleigh-taylor", "frequency of a standing wave", "rate", (32, 64), 32, 0.0088, bar=0.01,
        settings=("above=nothing",), others="2.506620, incompressible",
    ),
    Case("oblique-shock", "angle of the shock, Mach 2.5 on 15 degrees", "angle", (50, 100), 50,
         0.0009, bar=0.005),
    Case("oblique-shock", "pressure on the wedge", "pressure", (50, 100), 50, 0.0007,
         bar=0.005),
    Case(
        "triple-point", "pressure and velocity beside the first contacts, largest error", "star",
        (20, 40), 20, 0.024, bar=0.02, settings=("run.t_end=0.26",),
    ),
    Case(
        "triple-point", "mass of each gas to t = 5", "mass", (10,), None, bar=1e-12,
        converges=False,
    ),
    *(
        Case(
            "shock-bubble", f"helium, {words}", words, (8,), 8, short_bar, bar=0.10,
            converges=False, settings=BUBBLE, others=f"experiment {speed} m/s, accurate to 10 %",
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
            ("refracted shock", "refracted shock", 0.10, "experiment 240 m/s (unchecked)"),
            ("upwind end until the refracted shock leaves", "upwind end", 0.10,
             "experiment 73 m/s (unchecked)"),
            ("upwind end to 400 us", "upwind end to 400 us", 0.02, "fixed grid 65.0 m/s"),
            ("time at which the downwind end turns back", "focus", 0.02, "fixed grid 200.8 us"),
            ("downwind end (no threshold: it moves farther on finer grids)", "downwind end", None,
             "experiment 78 m/s (unchecked), fixed grids 72, 78, 92 m/s"),
        )
    ),
    Case(
        "detonation", "TNT, speed of a self-sustaining front", "cj_speed", (100, 200, 400), 100,
        0.011, bar=0.005, converges=False,
        settings=("behind=wall", "clock=0.1"), others="6929 m/s from the JWL equation of state",
    ),
    Case(
        "detonation", "TNT, Taylor's wave", "taylor", (100, 200, 400), 100, 0.085, order=0.9,
        settings=("behind=wall",), others="quadrature on the JWL isentrope",
    ),
    Case(
        "detonation", "TNT, peak pressure, from below", "cj_pressure",
        (100, 200, 400), 100, 0.12, bar=0.05, settings=("behind=wall",), others="21.00 GPa",
    ),
    Case(
        "detonation", "Comp B, speed of a self-sustaining front", "cj_speed", (100, 200, 400), 100,
        0.0075, bar=0.005, converges=False,
        settings=("explosive=Comp-B", "behind=wall", "clock=0.1"),
        others="7980 m/s from the JWL equation of state",
    ),
    Case(
        "detonation", "Comp B, Taylor's wave", "taylor", (100, 200, 400), 100, 0.085, order=0.9,
        settings=("explosive=Comp-B", "behind=wall"), others="quadrature on the JWL isentrope",
    ),
    Case(
        "detonation", "Comp B, peak pressure, from below", "cj_pressure", (100, 200, 400), 100,
        0.12, bar=0.05, settings=("explosive=Comp-B", "behind=wall"), others="29.50 GPa",
    ),
    Case(
        "detonation", "TNT, pressure ahead of a piston", "cj_pressure", (100, 400), 100, 0.001,
        bar=0.03, converges=False, others="21.00 GPa",
    ),
)  # fmt: skip


RunName = tuple[str, tuple[str, ...]]  # deck and settings

HEADS = ("problem", "what", "size", "error", "order", "threshold", "met", "CPU s", "other results")


def format_record(record: Mapping[str, Any]) -> tuple[str, ...]:
    """A record in words, in the order of HEADS."""
    error, order, bar = record["error"], record["order"], record["bar"]
    words = record["failure"] or ("" if error is None else f"{error:.3g}")
    return (
        record["problem"],
        record["what"],
        str(record["size"]),
        words,
        "" if order is None else f"{order:.2f}",
        f"{bar:.3g}" if isinstance(bar, float) else bar or "",
        {None: "", True: "yes", False: "NO"}[record["met"]],
        f"{record['cpu_seconds']:.1f}",
        record["others"],
    )


def choose_cases(names: tuple[str, ...]) -> list[Case]:
    """The cases of the named problems, all where none is named; BadInput for an unknown one."""
    known = list(dict.fromkeys(case.deck for case in CASES))
    for name in names:
        if name not in known:
            raise BadInput(f"verify knows no problem {name!r}{suggest_deck(name, known)}")
    return [case for case in CASES if not names or case.deck in names]


def march(name: RunName) -> tuple[dict[str, np.ndarray], dict, float]:
    """History, errors and CPU seconds of a run in memory."""
    problem = read_deck(*name).make_problem()
    start = time.process_time()
    evolution = problem.build()
    rows = [{"t": 0.0, **evolution.start_row(), **problem.measure(evolution)}]
    most = problem.deck.run.max_steps or math.inf
    while evolution.finished is None and len(rows) <= most:
        rows.append({**evolution.advance(), **problem.measure(evolution)})
    names = [name for name, value in rows[-1].items() if isinstance(value, int | float)]
    history = {
        name: np.array([row.get(name, math.nan) for row in rows], dtype=float) for name in names
    }
    return history, problem.errors(history), time.process_time() - start


def compute_records(
    cases: list[Case], short: bool, engine: Engine | None = None
) -> Iterator[dict[str, Any]]:
    """A record of each size of each case, in order, as soon as its run is there; `engine` makes
    the runs.

    As JSON holds it: None for what there is not, the threshold (`bar`) where one is judged, and
    the `failure` of a run that has no error.
    """
    sizes = {case: (case.short,) if short else case.sizes for case in cases}
    wanted = [(case, size) for case in cases for size in sizes[case] if size is not None]
    names = [(case.deck, (*case.settings, *case.refine(size))) for case, size in wanted]
    keys = list(dict.fromkeys(names))
    computed = (engine or InTurn()).compute(march, keys)
    runs: dict[RunName, Any] = {}
    before: tuple[Case, int, float] | None = None
    for (case, size), name in zip(wanted, names, strict=True):
        while name not in runs:
            place, run = next(computed)
            if isinstance(run, Exception) and not isinstance(run, RunFailure):
                raise run
            runs[keys[place]] = run
        error, seconds, failure = _find_error(case, runs[name])
        order = math.nan
        if case.converges and before and before[0] is case and before[2] > 0.0 and error > 0.0:
            order = math.log(before[2] / error) / math.log(size / before[1])
        met, bar = _judge(case, size, error, order, short)
        before = case, size, error
        yield {
            "problem": case.deck,
            "what": case.what,
            "size": size,
            "settings": list(name[1]),
            "error": None if math.isnan(error) else error,
            "order": None if math.isnan(order) else order,
            "bar": bar,
            "met": False if failure else met,
            "cpu_seconds": round(seconds, 1),
            "others": case.others,
            "failure": failure,
        }


def _find_error(case: Case, run: Any) -> tuple[float, float, str]:
    """Error and CPU seconds of a run; NaN and why where it has none."""
    if isinstance(run, RunFailure):
        return math.nan, 0.0, f"failed: {run}"
    history, errors, seconds = run
    known = np.atleast_1d(errors.get(case.quantity, history.get(case.quantity)))
    known = known[np.isfinite(known)]
    if not known.size:
        return math.nan, seconds, "failed: it was not measured"
    return float(known[-1]), seconds, ""


def _judge(
    case: Case, size: int, error: float, order: float, short: bool
) -> tuple[bool | None, float | str | None]:
    """Is the threshold, if there is one at this size, met, and what is it?"""
    limit = case.short_bar if short else case.bar
    if limit is not None and (short or size == case.sizes[case.judged]):
        return error <= limit, limit
    if case.order is not None and not short and size == case.sizes[-1] and not math.isnan(order):
        return order >= case.order, f"order {case.order:g}"
    return None, None


def describe_bars(records: list[Mapping[str, Any]]) -> str:
    """`44 of 44 thresholds met`."""
    met = [record["met"] for record in records if record["met"] is not None]
    return f"{sum(met)} of {len(met)} thresholds met"


def verify(
    problems: tuple[str, ...],
    short: bool,
    output: str | None,
    say: Callable[[str], None],
    jobs: int = 1,
) -> int:
    """Run, print line by line, write the records as JSON; 1 where a bar is missed, else 0.

    `output`: the JSON file; `jobs`: runs at once.
    """
    cases = choose_cases(problems)
    if output is not None:
        check_free(Path(output))
    widths = [15, 59, 4, 9, 5, 9, 3, 6]
    say("  ".join(f"{head:{width}}" for head, width in zip(HEADS, widths, strict=False)).rstrip())
    records = []
    with open_engine("processes", jobs) as engine:
        for record in compute_records(cases, short, engine):
            records.append(record)
            cells = format_record(record)
            line = "  ".join(f"{cell:{width}}" for cell, width in zip(cells, widths, strict=False))
            say(f"{line}  {cells[-1]}".rstrip())
    if output is not None:
        words = ["shockgrid verify", *problems, *(["--short"] if short else []), "-o", output]
        made = {"command": " ".join(words), "made_by": describe_software(), "rows": records}
        text = json.dumps(made, indent=1, allow_nan=False) + "\n"
        write_atomically(Path(output), text)
        say(f"written: {output}")
    return 1 if any(record["met"] is False for record in records) else 0
