"""Summary and pictures of `plate-on-wedge`: the collision point A against shock polars.

The pressure behind A is a plateau found in the data, or none.  Nothing but A's path sets a length
in the flow around A, so pressures at equal parts of the path behind A are compared: in every step
on a fixed set of parts, then over all steps.  The numerical rise and its ringing, as many faces
long in any cells, are left out of every step.  Near the critical angle there is no plateau: the
pressure falls from A on, and the line of the fall is continued to A.  Note: the scheme's own crest
and dip are a few faces long each, and a mean over so few faces may pass for a plateau.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from shockgrid.problems.pictures import (
    Colours,
    choose_even_dumps,
    compute_rates,
    draw_field,
    make_panels,
)
from shockgrid.problems.references.hugoniot import caution_fit
from shockgrid.problems.references.shock_polars import compute_jet_speed
from shockgrid.problems.report import Report, Row
from shockgrid.problems.solids import list_fluids
from shockgrid.regrid.sides import trace_outline

# thousandths of A's path behind A between which pressures are averaged
EDGES = (*range(10, 100, 10), 100, 125, 150, 175, 200, 250, 300, 350, 400, 450, 500)
COLUMNS = tuple(f"behind_{edge}" for edge in EDGES[:-1])
JET_SPEED_RATIO = 1.3  # material faster than this many times the plate's speed V belongs to a jet
WIDE_ZONE = 0.15  # of A's path: the length of that zone from which no finer cells are needed
PHASES = {
    "attached": "collision point runs",
    "arrived": "arrives at the face's end B",
    "jet": "jet",
    "closed": "closed",
}
RISEN_PRESSURE_PART = 0.9  # of the faces behind it: there the numerical rise is over
FACES_OF_RISE = 8  # faces behind a face that say what it rises to
RINGING_FACES = 4  # faces from there on that belong to its crest and dip
REFINED_RINGING = 5  # the same where cells at A are refined: rows are so by less than the faces
SEEN_STEP_PART = 0.1  # of all steps: a part seen in fewer is left out
LEAST_RATIO = 2.5  # of a plateau's two ends' distances from A: a shorter one is chance
SUBSONIC_MACH_MARGIN = 0.12  # below Mach 1 from which on the pressure is taken to fall from A on
LEAST_MISFIT = 1e-7  # relative to p², so that two good fits count alike
FALLEN_PRESSURE_PART = 0.88  # of the highest pressure: so far the line of the fall is followed
LEAST_PARTS = 3  # that a fit needs
FARTHEST_PROFILE_START = 0.15  # of A's path: where the profile has to begin at the latest
TRIED_BENDS = 40  # places of the bend that are tried


class Plateau(NamedTuple):
    """What was found behind A.

    - `p`: pressure behind A, Pa: mean of the plateau, or the fall continued to A; NaN where
      hardly a part lies behind the numerical rise;
    - `scatter`: root mean square of the pressures about the plateau or the fall, over p;
    - `start`, `end`: parts of A's path behind A of the plateau, or of the fall used;
    - `flat`: is it a plateau?
    - `fall`: by how much the pressure is less at `end` than at A, over p; 0 of a plateau.
    """

    p: float = math.nan
    scatter: float = math.nan
    start: float = math.nan
    end: float = math.nan
    flat: bool = False
    fall: float = math.nan


def measure_profile(
    arc: np.ndarray, p: np.ndarray, path: float, ringing: int = RINGING_FACES
) -> np.ndarray:
    """Mean pressures (len(COLUMNS),) between the parts EDGES of A's `path` behind A.

    `arc` (n + 1,): distances of the contact's nodes from A; `p` (n,): pressures of the faces
    between them; `ringing`: faces behind the rise that are left out.  NaN where the numerical rise
    and its ringing reach or the contact ends.
    """
    means = np.full(len(COLUMNS), math.nan)
    for k in range(p.size - FACES_OF_RISE):
        if p[k] >= RISEN_PRESSURE_PART * np.median(p[k + 1 : k + 1 + FACES_OF_RISE]):
            break
    else:
        return means
    first = k + ringing
    if first >= p.size or not path > 0.0:
        return means
    edges = 1e-3 * np.array(EDGES) * path
    integral = np.concatenate(([0.0], np.cumsum(p * np.diff(arc))))
    known = (edges[:-1] >= arc[first]) & (edges[1:] <= arc[-1])
    means[known] = (np.diff(np.interp(edges, arc, integral)) / np.diff(edges))[known]
    return means


def find_plateau(profiles: np.ndarray, mach: float = 1.0) -> Plateau:
    """The plateau in the rows (steps, len(COLUMNS)) of `measure_profile`.

    `mach`: of the flow that leaves A, the lower one of both bodies, by theory.  Without a plateau
    it says which curve goes on to A: at 1 and above the pressure is level there, below it falls
    from A on.
    """
    seen = np.isfinite(profiles)
    known = np.flatnonzero(seen.sum(axis=0) > SEEN_STEP_PART * max(len(profiles), 1))
    edges = 1e-3 * np.array(EDGES)
    if (
        known.size < LEAST_PARTS
        or (np.diff(known) > 1).any()
        or edges[known[0]] > FARTHEST_PROFILE_START
    ):
        return Plateau()
    low, high = edges[:-1][known], edges[1:][known]
    profiles = profiles[:, known]
    p = np.nanmean(profiles, axis=0)
    fallen = np.flatnonzero((p < FALLEN_PRESSURE_PART * p.max()) & (np.arange(p.size) > p.argmax()))
    count = max(int(fallen[0]) if fallen.size else p.size, LEAST_PARTS)
    x = 0.5 * (low + high)[:count]
    width = (high - low)[:count]
    broken, bend = _fit_broken_line(x, p[:count], width)
    curved = _fit_parabola(x, p[:count], width)
    flat = int(np.searchsorted(x, bend))
    if broken.misfit < curved.misfit and bend > LEAST_RATIO * low[0]:
        weight = width[:flat]
        level = float(p[:flat] @ weight / weight.sum())
        miss = profiles[:, :flat] / level - 1.0
        scatter = float(np.sqrt(np.nanmean(miss**2)))
        return Plateau(level, scatter, float(low[0]), float(high[flat - 1]), True, 0.0)
    share = min(max((1.0 - mach) / SUBSONIC_MACH_MARGIN, 0.0), 1.0)
    level = (1.0 - share) * broken.level + share * curved.level
    fit = (1.0 - share) * broken.values + share * curved.values
    miss = (profiles[:, :count] - fit) / level
    end = float(high[count - 1])
    fall = 1.0 - float(fit[-1]) / level
    return Plateau(level, float(np.sqrt(np.nanmean(miss**2))), float(low[0]), end, False, fall)


class _Fit(NamedTuple):
    """A curve through the parts: its value at A, its values at them, its weighted misfit."""

    level: float
    values: np.ndarray
    misfit: float


def _fit(p: np.ndarray, width: np.ndarray, *basis: np.ndarray) -> _Fit | None:
    """The nearest sum of a constant and the rows of `basis`; None where it rises from A on."""
    columns = np.vstack((np.ones_like(p), *basis))
    root = np.sqrt(width / width.sum())
    factors, *_ = np.linalg.lstsq((columns * root).T, p * root)
    if (factors[1:2] > 0.0).any():
        return None
    values = factors @ columns
    misfit = float(((p - values) * root) @ ((p - values) * root))
    return _Fit(float(factors[0]), values, misfit + LEAST_MISFIT * float(p.max()) ** 2)


def _fit_broken_line(x, p, width) -> tuple[_Fit, float]:
    """Flat as far as a bend, straight from there; also the bend, of all that are tried the best."""
    best = _fit(p, width)
    place = math.inf
    for bend in np.linspace(x[1], x[-1], TRIED_BENDS + 1)[:-1]:  # nearer to A none can be seen
        found = _fit(p, width, np.maximum(0.0, x - bend))
        if found is not None and found.misfit < best.misfit:
            best = found
            place = float(bend)
    return best, place


def _fit_parabola(x, p, width) -> _Fit:
    """A parabola that falls from A on and ever steeper; else a straight line, or a level one.

    Steeper towards A would be the crest of the numerical rise, continued.
    """
    found = _fit(p, width, x, x * x) if x.size > LEAST_PARTS else None
    if found is not None and np.interp(0.5 * (x[0] + x[-1]), x, found.values) > 0.5 * (
        found.values[0] + found.values[-1]
    ):
        return found
    steep = _fit(p, width, x)
    level = _fit(p, width, x * x)
    if steep is None or level is None:
        return _fit(p, width)
    return min(steep, level, key=lambda fit: fit.misfit)


FITTED = (0.25, 0.95)  # part of the face over which the collision point's speed is fitted
PATH_PARTS = 5  # parts of that path whose own speeds say how constant it is
STEADY = (0.6, 0.95)  # part of the face over which states behind A are averaged
COARSE_CELLS = 80  # along the plate: what was compared with theory at the least
FINE_CELLS = 160  # along the plate: from there on the pressure behind A is right near critical, too
NEAR_CRITICAL = 0.6  # degrees below the critical angle within which fewer refined cells do not do
SHORT_ZONE = 0.05  # of A's path: a zone of constant states that only finer cells at A resolve
LEAST_LEAD = 0.5  # spacings of the plate by which a jet is ahead of A
MM = 1e3


def choose_rows(problem, history, parts) -> np.ndarray:
    """Rows of the history in which A is on the given part of the face and has not arrived."""
    path = np.nan_to_num(history["contact_path"], nan=-1.0)
    face = problem.deck.face
    return (path > parts[0] * face) & (path < parts[1] * face)


def measure_contact_speed(problem, history) -> tuple[float, float]:
    """Speed of A along the face [m/s] and the largest relative deviation of its parts; NaN if none.

    From a straight line through path and time over the part FITTED of the face.
    """
    rows = choose_rows(problem, history, FITTED)
    if rows.sum() < 3 * PATH_PARTS:
        return math.nan, math.nan
    t = history["t"][rows]
    path = history["contact_path"][rows]
    speed = float(np.polyfit(t, path, 1)[0])
    edges = np.linspace(path[0], path[-1], PATH_PARTS + 1)
    times = np.interp(edges, path, t)
    own = np.diff(edges) / np.diff(times)
    return speed, float(np.abs(own / speed - 1.0).max())


def measure_plateau(problem, history) -> Plateau:
    """The pressure plateau behind A on the face's last part, or what stands for it."""
    rows = choose_rows(problem, history, STEADY)
    if not rows.any():
        return Plateau()
    columns = [history[name][rows] for name in COLUMNS]
    theory = problem.collision
    machs = [wave.mach_behind for wave in (theory.plate, theory.wedge) if wave is not None]
    return find_plateau(np.stack(columns, axis=1), min(machs, default=1.0))


def reduce_known(reduce: Callable[[np.ndarray], np.floating], values: np.ndarray) -> float:
    """Reduce those values that are known to one; nan where none is, as in a short run."""
    return float(reduce(values)) if not np.isnan(values).all() else math.nan


def measure_behind(problem, history) -> dict[str, float]:
    """Both deflections and shock angles behind A [rad] on the face's last part."""
    rows = choose_rows(problem, history, STEADY)
    turn, plate, wedge = (
        math.radians(reduce_known(np.nanmean, history[name][rows]))
        for name in ("interface_angle", "shock_angle_plate", "shock_angle_wedge")
    )
    return {
        "theta_plate": turn,
        "theta_wedge": problem.angle - turn,
        "shock_plate": plate,
        "shock_wedge": wedge,
    }


def measure_lead(problem, history) -> float:
    """Greatest length [m] of plate ahead of the collision point of theory on the face; NaN if none.

    See `PlateRun.measure_lead`; the first tenth of the face, where the flow is not yet the steady
    one, does not count.
    """
    rows = choose_rows(problem, history, (0.1, STEADY[1]))
    return reduce_known(np.nanmax, history["lead"][rows])


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


def describe_jet(problem, history) -> str:
    """One sentence: is there a jet ahead of A, and does theory have one?"""
    lead = measure_lead(problem, history)
    attached = problem.collision.attached
    spacing = problem.length / problem.deck.cells[0]
    if not math.isfinite(lead):
        return "jet: A has not run far enough to tell whether one runs ahead of it"
    if lead > LEAST_LEAD * spacing:
        jet = "one ahead of A, " + ("theory predicts none" if attached else "as predicted")
    elif attached:
        jet = "none ahead of A, as predicted"
    else:
        jet = "predicted ahead of A, but too thin to be resolved by these cells"
    ahead = f"at most {MM * lead:.2f} mm ({lead / spacing:.1f} cells)" if lead > 0.0 else "none"
    return f"jet: {jet}; {ahead} of the plate is ahead before {STEADY[1]:.0%} of the face"


SHOWN_PLATE_TIMES = 6  # times in a picture
SHADES = ("#c9d4e2", "#8c99a8", "#e2cfa9")


def _make_panels(figure, run) -> list[tuple]:
    """Panels of one frame in rows of three, each with a dump, evenly over the run."""
    dumps = choose_even_dumps(run, SHOWN_PLATE_TIMES)
    columns = min(3, len(dumps))
    shape = -(-len(dumps) // columns), columns
    frames = make_panels(
        figure, 15.0, 4.0 * shape[0], *shape, sharex=True, sharey=True, squeeze=False
    )
    for panel, dump in zip(frames.flat, dumps, strict=False):
        panel.set_title(f"t = {1e6 * dump.t:.2f} µs", fontsize="medium")
        panel.set_aspect("equal")
    return list(zip(frames.flat, dumps, strict=False))


class Results:
    """What the problem says of a run, a part of its class: report, cautions, pictures."""

    def report(self, run) -> Report:
        """What was computed and how far it is from theory."""
        history = run.history
        if not run.begun:
            return Report()
        deck = self.deck
        theory = self.collision
        rows = []
        notes = [describe_jet(self, history)]
        chosen = choose_rows(self, history, (0.2, 0.8))
        if deck.drive.kind != "moving" and chosen.any():
            speed = float(np.median(history["surface_speed"][chosen]))
            label = "speed of the free surface [km/s]"
            rows.append(Row("plate_speed", speed, self.plate_speed, label, 1e3, 5))
        speed, spread = measure_contact_speed(self, history)
        label = "speed of A on the face [km/s]"
        source = ""
        if math.isfinite(spread):
            source = f"constant within {100.0 * spread:.2f} % over fifths of its path"
        if not theory.attached:
            label = "speed of A, the jet's tip [km/s]"
            source = "where the plate would meet the face"
        rows.append(Row("contact_speed", speed, theory.contact_speed, label, 1e3, 5, source=source))
        if theory.attached:
            found = measure_behind(self, history)
            degree = math.pi / 180.0
            plateau = measure_plateau(self, history)
            label = "pressure behind A [GPa]"
            source = describe_plateau(plateau)
            rows.append(Row("pressure", plateau.p, theory.p, label, 1e9, 5, source=source))
            for name, wave in (("plate", theory.plate), ("wedge", theory.wedge)):
                for kind, label, exact in (
                    ("theta", f"deflection of the {name} [deg]", wave.deflection),
                    ("shock", f"shock angle in the {name} [deg]", wave.wave_angle),
                ):
                    name_of_row = f"{kind}_{name}"
                    rows.append(Row(name_of_row, found[name_of_row], exact, label, degree, 5))
        # fastest material; single cells that are nearly empty are faster for a few steps
        speed = history["jet_speed"]
        t = history["t"]
        if (there := speed > 0.0).any():
            order = np.argsort(speed[there])
            weight = np.cumsum(np.gradient(t)[there][order]) if t.size > 1 else np.ones(1)
            jet = float(speed[there][order][np.searchsorted(weight, 0.5 * weight[-1])])
            fastest = f"{jet / 1e3:.3g} km/s (median in time), {history['jet_mass'][-1]:.3g} kg/m"
            if theory.attached:
                notes.append(f"behind B: fastest material {fastest} at the end")
            else:
                ideal = compute_jet_speed(self.plate_speed, self.angle)
                notes.append(
                    f"jet: fastest material {fastest} at the end (incompressible theory on a rigid "
                    f"wedge: {ideal / 1e3:.3g} km/s)"
                )
                notes.append(
                    "the jet ahead of A is thinner than a cell: its speed and mass are estimates"
                )
        else:
            notes.append(f"no material faster than {JET_SPEED_RATIO:g} V")
        times = run.final.times if run.final is not None else {}
        known = [f"{PHASES[n]} {1e6 * t:.3f} µs" for n, t in times.items() if math.isfinite(t)]
        notes += ["phases: " + "; ".join(known)] if known else []
        return Report(self.describe, rows, notes)

    def describe(self) -> str:
        """What collides, how far it is from the critical angle, and what it costs to be near."""
        deck = self.deck
        theory = self.collision
        zone = self.zone
        finer = self.refinement
        critical = math.degrees(self.critical)
        state = "below it: the shocks are attached" if theory.attached else "above it: a jet"
        lines = [
            f"{deck.plate} plate on {deck.wedge} wedge at {deck.angle:g} degrees; drive: "
            f"{deck.drive.kind}; {deck.cells[0]} x {deck.cells[1]} cells in the plate",
            f"  theory for V = {self.plate_speed / 1e3:.4g} km/s: critical angle {critical:.2f} "
            f"degrees, this one is {abs(critical - deck.angle):.2f} {state}",
        ]
        if theory.attached and zone < WIDE_ZONE:
            part = max(100.0 * zone, 0.0)
            lines.append(
                f"  near critical: the flow leaves A at Mach {theory.plate.mach_behind:.2f} in the "
                f"plate, {theory.wedge.mach_behind:.2f} in the wedge; "
                f"the zone of constant states behind A is {part:.1f} % of A's path long"
            )
            advice = "refinement=2 or 3 makes the cells at A finer, at as many times the steps"
            if finer > 1.0:
                advice = (
                    f"so the cells at A are {finer:.3g} times finer, at as many times the steps "
                    "(refinement=1: none of it)"
                )
            ending = "; such a run ends at B" if deck.until == "auto" else ""
            lines.append(f"    {advice}{ending}")
        return "\n".join(lines)

    def cautions(self, run) -> list[str]:
        """Where the pressure behind A is low: too few cells close to the critical angle; and where
        it is beyond the Hugoniots."""
        p = self.collision.p or 0.0
        beyond = [
            caution
            for name, body in self.materials.items()
            for caution in caution_fit(f"the {name}", body.eos, p)
        ]
        return beyond + self.caution_cells() + list_fluids(self.laws)

    def caution_cells(self) -> list[str]:
        """Too few cells close to the critical angle."""
        deck = self.deck
        cells = self.deck.cells[0]
        if not self.collision.attached or self.zone >= WIDE_ZONE or cells >= FINE_CELLS:
            return []
        away = math.degrees(self.critical) - deck.angle
        near = f"{away:.2g} degrees below the critical angle the pressure behind A"
        finer = f"cells=[{FINE_CELLS}, {math.ceil(FINE_CELLS * deck.cells[1] / cells)}]"
        finding = f"was found up to 5 % low with {COARSE_CELLS} cells" * (away < NEAR_CRITICAL)
        if cells < COARSE_CELLS:
            finding = f"was never compared with theory at fewer than {COARSE_CELLS} cells along it"
        elif self.refinement <= 1.0 and self.zone < SHORT_ZONE:
            finer = "refinement=3" if deck.drive.kind == "moving" else "refinement=2, until=arrival"
            finding = f"was found 5 to 8 % low with {COARSE_CELLS} unrefined cells"
        return [f"{near} {finding}; take {finer}"] if finding else []

    def draw_phases(self, figure, run) -> None:
        """Pressure with the grid at several times, all in one frame."""
        panels = _make_panels(figure, run)
        last = run.dumps[-1].blocks
        top = max(float(np.percentile(block.p, 99.5)) for block in last)
        top = 1.1 * self.collision.p if self.collision.attached else top
        colours = Colours(unit=1e9, low=0.0, high=top / 1e9, map="turbo")
        for axes, dump in panels:
            image = draw_field(axes, dump, "p", colours, every=1, mm=True)
            axes.label_outer()
        axes = [panel for panel, _ in panels]
        figure.colorbar(image, ax=axes, label="pressure [GPa]", extend="max", pad=0.01)

    def draw_contact(self, figure, run) -> None:
        """Path and speed of the collision point against theory."""
        history = run.history
        theory = self.collision.contact_speed
        paths, speeds = make_panels(figure, 12.0, 4.5, 1, 2)
        t = history["t"]
        path = history["contact_path"]
        paths.plot(1e6 * t, MM * path, label="computed")
        rows = choose_rows(self, history, (0.02, 1.0))
        if rows.any():
            line = (t - t[rows][0]) * theory + path[rows][0]
            inside = (line > 0.0) & (line < self.deck.face)
            paths.plot(1e6 * t[inside], MM * line[inside], "k--", label="V / sin(angle)")
            times, speed = compute_rates(t[rows], path[rows])
            there = np.interp(times, t[rows], path[rows])
            speeds.plot(MM * there, speed / 1e3, lw=0.7, alpha=0.5, label="computed")
            ends = np.linspace(path[rows][0], path[rows][-1], 16)
            mean = np.diff(ends) / np.diff(np.interp(ends, path[rows], t[rows])) / 1e3
            middles = 0.5 * MM * (ends[1:] + ends[:-1])
            speeds.plot(middles, mean, "o-", ms=3, label="mean over a fifteenth of the path")
            speeds.axhline(theory / 1e3, color="k", ls="--", label="theory")
            speeds.set_ylim(0.8 * speed.min(), 1.1 * np.percentile(speed, 98.0))
        paths.set(xlabel="t [µs]", ylabel="path of A along the face [mm]")
        speeds.set(xlabel="path of A along the face [mm]", ylabel="speed of A [km/s]")

    def draw_configuration(self, figure, run) -> None:
        """Outlines of all bodies at several times, as the paper draws them (its Fig 6)."""
        deck = self.deck
        fills = {}
        materials = {"plate": deck.plate, "wedge": deck.wedge, "flyer": deck.drive.material}
        for axes, dump in _make_panels(figure, run):
            for block, shade in zip(dump.blocks, SHADES, strict=False):
                outline = MM * trace_outline(block.nodes)
                fills[block.name] = axes.fill(*outline, facecolor=shade, edgecolor="k", lw=0.9)[0]
            axes.set(xlabel="x [mm]", ylabel="y [mm]")
            axes.label_outer()
        figure.legend(
            fills.values(),
            [f"{name} ({materials[name]})" for name in fills],
            frameon=False,
            ncols=3,
            loc="outside lower center",
        )
