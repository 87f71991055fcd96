"""Closing screen of `plate-on-wedge`: the contact point against shock polars."""

from __future__ import annotations

import math
from collections.abc import Callable

import msgspec
import numpy as np

from problems.plate_on_wedge.plateau import COLUMNS, NOTHING, Plateau, find_plateau
from problems.plate_on_wedge.set_up import JET, WIDE_ZONE
from problems.references.shock_polars import compute_birkhoff_jet

FITTED = (0.25, 0.95)  # part of the face over which the contact point's speed is fitted
PARTS = 5  # parts of that path whose own speeds say how constant it is
STEADY = (0.6, 0.95)  # part of the face over which states behind A are averaged
COARSE_CELLS = 80  # along the plate: what was compared with theory at the least
FINE_CELLS = 160  # along the plate: from there on the pressure behind A is right near critical, too
NEAR_CRITICAL = 0.6  # degrees below the critical angle within which fewer refined cells do not do
SHORT_ZONE = 0.05  # of A's path: a zone of constant states that only finer cells at A resolve
LEAST_LEAD = 0.5  # spacings of the plate by which a jet is ahead of A
NAMES = {
    "attached": "contact point runs",
    "arrived": "arrives at the face's end B",
    "jet": "jet",
    "closed": "closed",
}
ANGLES = ("interface_angle", "shock_angle_plate", "shock_angle_wedge")
MM = 1e3


def choose_rows(problem, history, parts) -> np.ndarray:
    """Rows of the history in which A is on the given part of the face and has not arrived."""
    path = np.nan_to_num(np.asarray(history["contact_path"], dtype=float), nan=-1.0)
    face = problem.deck.face
    return (path > parts[0] * face) & (path < parts[1] * face)


def measure_contact_speed(problem, history) -> tuple[float, float]:
    """Speed of A along the face [m/s] and the largest relative deviation of its parts; NaN if none.

    From a straight line through path and time over the part FITTED of the face.
    """
    rows = choose_rows(problem, history, FITTED)
    if rows.sum() < 3 * PARTS:
        return math.nan, math.nan
    t, path = history["t"][rows], history["contact_path"][rows]
    speed = float(np.polyfit(t, path, 1)[0])
    edges = np.linspace(path[0], path[-1], PARTS + 1)
    times = np.interp(edges, path, t)
    own = np.diff(edges) / np.diff(times)
    return speed, float(np.abs(own / speed - 1.0).max())


def measure_plateau(problem, history) -> Plateau:
    """The pressure plateau behind A on the face's last part, or what stands for it."""
    rows = choose_rows(problem, history, STEADY)
    if not rows.any():
        return NOTHING
    columns = [np.asarray(history[name], dtype=float)[rows] for name in COLUMNS]
    theory = problem.collision
    machs = [wave.mach_behind for wave in (theory.plate, theory.wedge) if wave is not None]
    return find_plateau(np.stack(columns, axis=1), min(machs, default=1.0))


def reduce_known(reduce: Callable[[np.ndarray], np.floating], values: np.ndarray) -> float:
    """Reduce those values that are known to one; nan where none is, as in a short run."""
    return float(reduce(values)) if not np.isnan(values).all() else math.nan


def measure_behind(problem, history) -> dict[str, float]:
    """Pressure behind A, both deflections and shock angles [rad] on the face's last part."""
    rows = choose_rows(problem, history, STEADY)
    if not rows.any():
        names = ("p", "theta_plate", "theta_wedge", "shock_plate", "shock_wedge")
        return dict.fromkeys(names, math.nan)
    means = {name: reduce_known(np.nanmean, history[name][rows]) for name in ANGLES}
    return {
        "p": measure_plateau(problem, history).p,
        "theta_plate": math.radians(means["interface_angle"]),
        "theta_wedge": problem.angle - math.radians(means["interface_angle"]),
        "shock_plate": math.radians(means["shock_angle_plate"]),
        "shock_wedge": math.radians(means["shock_angle_wedge"]),
    }


def measure_jet_speed(history) -> float:
    """Median in time of the fastest material's speed [m/s] while there is a jet; 0 without one.

    Single cells that are nearly empty are faster for a few steps: a maximum would be theirs.
    """
    speed, t = (np.asarray(history[name], dtype=float) for name in ("jet_speed", "t"))
    there = speed > 0.0
    if not there.any():
        return 0.0
    order = np.argsort(speed[there])
    weight = np.cumsum(np.gradient(t)[there][order]) if t.size > 1 else np.ones(1)
    return float(speed[there][order][np.searchsorted(weight, 0.5 * weight[-1])])


def measure_lead(problem, history) -> float:
    """Greatest length [m] of plate ahead of the contact point of theory on the face; NaN if none.

    See `PlateRun.measure_lead`; the first tenth of the face, where the flow is not yet the steady
    one, does not count.
    """
    rows = choose_rows(problem, history, (0.1, STEADY[1]))
    return reduce_known(np.nanmax, history["lead"][rows])


def make_summary(problem, history, final) -> str:
    """What was computed and how far it is from theory, as lines of text."""
    deck, theory = problem.deck, problem.collision
    lines = [
        f"{deck.plate} plate on {deck.wedge} wedge at {deck.angle:g} degrees; drive: "
        f"{deck.drive.kind}; {deck.cells[0]} x {deck.cells[1]} cells in the plate",
        f"  theory for V = {problem.plate_speed / 1e3:.4g} km/s: {describe_margin(problem)}",
        *describe_nearness(problem),
        "                                     computed     theory   difference",
    ]
    if deck.drive.kind != "moving":
        rows = choose_rows(problem, history, (0.2, 0.8))
        if rows.any():
            speed = float(np.median(history["surface_speed"][rows]))
            lines.append(_line("speed of the free surface [km/s]", speed, problem.plate_speed, 1e3))
    speed, spread = measure_contact_speed(problem, history)
    label = "speed of A on the face [km/s]"
    if not theory.attached:
        label = "speed of A, the jet's tip [km/s]"
    lines.append(_line(label, speed, theory.contact_speed, 1e3))
    if not theory.attached:
        lines.append("    (theory: the point where the undisturbed plate would meet the face)")
    if math.isfinite(spread):
        lines.append(f"    constant within {100.0 * spread:.2f} % over fifths of its path")
    behind = measure_behind(problem, history)
    if theory.attached:
        lines.append(_line("pressure behind A [GPa]", behind["p"], theory.p, 1e9))
        lines.append(f"    {describe_plateau(measure_plateau(problem, history))}")
        for words, name, reference in (
            ("deflection of the plate [deg]", "theta_plate", theory.plate.deflection),
            ("deflection of the wedge [deg]", "theta_wedge", theory.wedge.deflection),
            ("shock angle in the plate [deg]", "shock_plate", theory.plate.wave_angle),
            ("shock angle in the wedge [deg]", "shock_wedge", theory.wedge.wave_angle),
        ):
            lines.append(_line(words, behind[name], reference, math.pi / 180.0))
    lines.append(f"  {describe_verdict(problem, measure_lead(problem, history))}")
    jet = measure_jet_speed(history)
    if jet > 0.0:
        mass = float(np.asarray(history["jet_mass"], dtype=float)[-1])
        birkhoff = compute_birkhoff_jet(problem.flying.rho, problem.plate_speed, problem.angle)
        lines.append(
            f"  {'behind B' if theory.attached else 'jet'}: fastest material {jet / 1e3:.3g} km/s "
            f"(median in time), {mass:.3g} kg/m at the end (incompressible theory on a rigid "
            f"wedge: {birkhoff.jet_speed / 1e3:.3g} km/s)"
        )
        if not theory.attached:
            lines.append(
                "  the jet ahead of A is thinner than a cell at first: its speed and mass are rough"
            )
    else:
        lines.append(f"  no material faster than {JET:g} V")
    if final is not None:
        words = [
            f"{NAMES[phase]} {1e6 * time:.3f} us"
            for phase, time in final.times.items()
            if math.isfinite(time)
        ]
        lines.append("  phases: " + "; ".join(words))
    return "\n".join(lines)


def describe_margin(problem) -> str:
    """The critical angle, how far this one is from it, and what theory says of it."""
    critical = math.degrees(problem.critical.angle)
    away = critical - problem.deck.angle
    attached = problem.collision.attached
    return f"critical angle {critical:.2f} degrees, this one is {abs(away):.2f} " + (
        "below it: the shocks are attached" if attached else "above it: a jet"
    )


def find_cautions(problem) -> list[str]:
    """Sentences where the pressure behind A is low: too few cells close to the critical angle."""
    deck, zone = problem.deck, problem.zone
    cells = deck.cells[0]
    if not problem.collision.attached or zone >= WIDE_ZONE or cells >= FINE_CELLS:
        return []
    away = math.degrees(problem.critical.angle) - deck.angle
    near = f"{away:.2g} degrees below the critical angle the pressure behind A"
    finer = f"cells=[{FINE_CELLS}, {math.ceil(FINE_CELLS * deck.cells[1] / cells)}]"
    if cells < COARSE_CELLS:
        return [
            f"{near} was never compared with theory at fewer than {COARSE_CELLS} cells along the "
            f"plate; take {finer}"
        ]
    if problem.refinement <= 1.0 and zone < SHORT_ZONE:
        refined = "refinement=3" if deck.drive.kind == "moving" else "refinement=2, until=arrival"
        return [
            f"{near} was found 5 to 8 % low with {COARSE_CELLS} unrefined cells; take {refined}"
        ]
    if away < NEAR_CRITICAL:
        return [f"{near} was found up to 5 % low with {COARSE_CELLS} cells; take {finer}"]
    return []


def describe_nearness(problem) -> list[str]:
    """How near the critical angle is felt, and what it costs; nothing far from it."""
    theory, zone = problem.collision, problem.zone
    if not theory.attached or zone >= WIDE_ZONE:
        return []
    if zone > 0.0:
        words = f"the zone of constant states behind A is {100.0 * zone:.1f} % of A's path long"
    else:
        words = "no zone of constant states behind A"
    lines = [
        f"  near critical: the flow leaves A at Mach {theory.plate.mach_behind:.2f} in the plate, "
        f"{theory.wedge.mach_behind:.2f} in the wedge; {words}"
    ]
    finer, (_, plans) = problem.refinement, problem.plan()
    ending = "; such a run ends at B" if problem.deck.until == "auto" else ""
    if finer > 1.0:
        cells = sum(ni * nj for ni, nj in (plan.cells for plan in plans))
        plain = msgspec.structs.replace(problem.deck, refinement=1.0)
        _, coarse = type(problem)(plain).plan()
        more = cells / sum(ni * nj for ni, nj in (plan.cells for plan in coarse)) - 1.0
        lines.append(
            f"    so the cells at A are {finer:.3g} times finer: {100.0 * more:.0f} % more cells, "
            f"about {finer:.2g} times the steps (refinement=1: none of it){ending}"
        )
    else:
        lines.append(
            "    refinement=2 or 3 makes the cells at A finer, at as many times the steps" + ending
        )
    return lines


def describe_plateau(plateau: Plateau) -> str:
    """Where the pressure behind A comes from, in words."""
    if not math.isfinite(plateau.p):
        return "no plateau seen: too few cells between A and the edge; take more `cells`"
    start, end = (f"{100.0 * part:.0f}" for part in (plateau.start, plateau.end))
    scatter = f"scatter {100.0 * plateau.scatter:.2f} %"
    if plateau.flat:
        return f"plateau from {start} to {end} % of A's path behind A, {scatter}"
    return (
        f"no plateau seen: falls by {100.0 * plateau.fall:.0f} % within {end} % of A's path; "
        f"continued to A from {start} % on, {scatter}"
    )


def describe_verdict(problem, lead: float) -> str:
    """One sentence: is there a jet ahead of A, and does theory have one?"""
    attached, spacing = problem.collision.attached, problem.length / problem.deck.cells[0]
    if not math.isfinite(lead):
        return "verdict: A has not run far enough to tell whether a jet runs ahead of it"
    if lead > LEAST_LEAD * spacing:
        words = "a jet ahead of A, " + ("against theory" if attached else "as by theory")
    elif attached:
        words = "no jet ahead of A, as by theory"
    else:
        words = "by theory a jet ahead of A, too thin to be seen in these cells"
    ahead = f"at most {MM * lead:.2f} mm, {lead / spacing:.1f} cells," if lead > 0.0 else "nothing"
    return f"verdict: {words}; {ahead} of plate ahead before {STEADY[1]:.0%} of the face"


def _line(words: str, computed: float, reference: float, unit: float) -> str:
    if not math.isfinite(computed):
        return f"  {words:34s} {'-':>9s}  {reference / unit:9.5g}"
    difference = 100.0 * (computed / reference - 1.0)
    return f"  {words:34s} {computed / unit:9.5g}  {reference / unit:9.5g}  {difference:+8.2f} %"
