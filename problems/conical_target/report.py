"""Report and pictures of `conical-target`: pressures, the shock, the cone's side, ripples.

Each wave of a ripple has its own clock, which starts when the shock along the side is at its
middle.  Theory is that of ripples of small slope behind shocks that cross a line; the speed of the
shocks along the line is the one that was seen.  Note: lead beside a rigid wall is pressed twice, by
the shock and by what comes back.
"""

import contextlib
import math
from dataclasses import dataclass

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.problems.pictures import (
    Colours,
    choose_even_dumps,
    draw_field,
    draw_grid,
    draw_lines,
    make_panels,
)
from shockgrid.problems.references.hugoniot import caution_fit, shock_to_pressure
from shockgrid.problems.references.shock_polars import CrossedLine
from shockgrid.problems.report import Report, Row
from shockgrid.problems.signals import fit_slope, reduce_between
from shockgrid.problems.solids import list_fluids
from shockgrid.regrid.curves import compute_arc_lengths
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.sides import trace_outline

PARTS = ("impactor", "shell", "target", "filling")
MM = 1e3
GPA = 1e-9
US = 1e6


def measure_peak(block: Block) -> tuple[float, float, float, float]:
    """Of a block: greatest pressure [Pa], the centre x, y [m] of that cell, the part of the mass in
    its second phase (NaN but for the cone)."""
    rho, _, _, p = block.state[:, 1:-1, 1:-1]
    cell = np.unravel_index(p.argmax(), p.shape)
    x, y = block.centres[(slice(None), *cell)]
    part = math.nan
    if block.name == "cone":
        mass = rho * block.volume
        part = float((mass * block.eos.compute_second_part(rho)).sum() / mass.sum())
    return float(p.max()), float(x), float(y), part


def find_peak(history, part: str) -> tuple[float, float, float, float]:
    """Greatest pressure [Pa] of a material in the whole run, its time [s] and place x, y [m]."""
    k = int(np.nanargmax(history[f"peak_pressure_{part}"]))
    names = (f"peak_pressure_{part}", "t", f"peak_x_{part}", f"peak_y_{part}")
    return tuple(float(history[name][k]) for name in names)


PLATEAU = (0.5, 0.95)  # of the time until a wave is back: the impact face's pressure is its mean
GAUGES = (0.1, 0.5, 0.9)  # of the length of the graphite's axis, as it is at the time
STATIONS = (0.25, 0.5, 0.75)  # of the cone's length at first: where the shock's speed is told
# of that length, to either side: the stretch over which a speed is fitted
FITTED_STRETCH_PART = 0.1
MIDDLE = (0.1, 0.9)  # of the cone's side by its length: its ends are drawn into roll-ups
LATEST_STAGE_PART = 0.5  # of the time from the first bend to the end: the latest stage


def get_shock_path(history, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times [s], places x [m] and pressures [Pa] of the shock on the cone's "axis" or "side"."""
    x = history[f"shock_x_{name}"]
    p = history[f"shock_pressure_{name}"]
    known = np.isfinite(x)
    return history["t"][known], x[known], p[known]


def measure_passage(problem, history, name: str) -> list[tuple[float, float, float]]:
    """Time [s], speed [m/s] and pressure behind [Pa] of the shock at STATIONS; NaN where unknown.

    Speed: slope of the straight line through the path within FITTED_STRETCH_PART of the station.
    """
    deck = problem.deck
    t, x, p = get_shock_path(history, name)
    found = []
    for station in STATIONS:
        position = deck.front + station * deck.cone
        near = np.abs(x - position) < FITTED_STRETCH_PART * deck.cone
        if near.sum() < 4 or not x[near].min() < position < x[near].max():
            found.append((math.nan,) * 3)
            continue
        slope, start = np.polyfit(t[near], x[near], 1)
        found.append(((position - start) / slope, float(slope), float(p[near].mean())))
    return found


def measure_departure(line: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Departure (n,) [m] of the nodes of a line (2, n) from its own straight line, and where.

    That line is the one of least squares along the arc; departures are normal to it.  Second: the
    nodes' places along the arc as parts of its length.
    """
    arc = compute_arc_lengths(line)
    weight = np.convolve(np.diff(arc), (0.5, 0.5))
    (xx, xy), (_, yy) = np.cov(line, aweights=weight)
    away = line - np.average(line, axis=1, weights=weight)[:, None]
    angle = 0.5 * math.atan2(2.0 * xy, xx - yy)
    return math.cos(angle) * away[1] - math.sin(angle) * away[0], arc / arc[-1]


def measure_growth(history) -> tuple[float, float, float]:
    """When the cone's side begins to bend [s], how fast at first and in the latest stage [m/s].

    It begins when the amplitude is a twentieth of its last; at first: to a quarter of it.
    """
    t = history["t"]
    amplitude = history["line_amplitude"]
    top = float(np.nanmax(amplitude))
    if not top > 0.0 or t.size < 10:
        return (math.nan,) * 3
    begin, quarter = (int(np.argmax(amplitude > part * top)) for part in (0.05, 0.25))
    late = t > t[-1] - LATEST_STAGE_PART * (t[-1] - t[begin])
    first = slice(begin, max(quarter + 1, begin + 3))
    return float(t[begin]), fit_slope(t, amplitude, first), fit_slope(t, amplitude, late)


AGES = (0.5e-6, 1.2e-6)  # after the passage: between them the rate of growth is told [s]
# cells per wave: amplitudes are within 10 % of theory from there on
COMPARABLE_CELLS_PER_WAVE = 16.0


@dataclass(frozen=True)
class WaveGrowth:
    """One wave: its middle along the side at first [m], passage [s], ages [s], amplitudes [m]."""

    position: float
    passed: float
    age: np.ndarray
    amplitude: np.ndarray

    def get_amplitude(self, age: float) -> float:
        """Amplitude [m] so long after the passage; NaN beyond the run or the line."""
        known = np.isfinite(self.amplitude)
        if known.sum() < 2 or not self.age[known][0] <= age <= self.age[known][-1]:
            return math.nan
        return float(np.interp(age, self.age[known], self.amplitude[known]))

    def measure_rate(self) -> float:
        """Mean of d(ln a)/dt [1/s] between AGES, when the kink of the shock has left the wave."""
        first, last = (self.get_amplitude(age) for age in AGES)
        return math.log(last / first) / (AGES[1] - AGES[0])


def measure_waves(problem, history) -> tuple[CrossedLine | None, list[WaveGrowth]]:
    """Theory for the shock that was seen, and the growth of every wave; (None, []) too early.

    That shock's path along the side is the straight line of least squares through its places.
    """
    t = history["t"]
    frame = problem.ripple.frame
    middles = problem.ripple.waves
    position = (history["shock_x_side"] - problem.deck.front) / frame.along[0]
    known = np.isfinite(position) & (position > middles[0]) & (position < middles[-1] + 1e-3)
    if known.sum() < 4:
        return None, []
    speed, start = (float(x) for x in np.polyfit(t[known], position[known], 1))
    waves = []
    for number, middle in enumerate(middles):
        passed = -start / speed + middle / speed
        amplitude = history[f"ripple_{number}"]
        waves.append(WaveGrowth(float(middle), float(passed), t - passed, amplitude))
    return problem.ripple.cross(speed), waves


def compare_waves(problem, history) -> tuple[list[Row], list[str]]:
    """The growth of every wave of the ripple beside theory, and what it rests on."""
    ripple = problem.ripple
    rows = []
    k, crossed, waves = ripple.wavenumber, *measure_waves(problem, history)
    notes = [
        f"ripple of {ripple.amplitude * MM:.3g} mm on waves of {ripple.wavelength * MM:.3g} mm on "
        f"the cone's side, k a = {k * ripple.amplitude:.3g}"
    ]
    if ripple.cells_a_wave < COMPARABLE_CELLS_PER_WAVE:
        wanted = math.ceil(problem.deck.cells * COMPARABLE_CELLS_PER_WAVE / ripple.cells_a_wave)
        notes.append(
            f"{ripple.cells_a_wave:.3g} cells per wave are too few to compare growth with theory: "
            f"the smoothing length of the interface slows it; take cells = {wanted} or more"
        )
    theory = math.nan  # of `WaveGrowth.measure_rate`
    if crossed is not None:
        first, last = crossed.compute_growth(k, np.array(AGES))
        theory = float(np.log(last / first)) / (AGES[1] - AGES[0])
        impulse, slip = crossed.compute_rates(k)
        notes += [
            f"shocks cross the side at {crossed.speed / 1e3:.3g} km/s; polars: "
            f"{crossed.p * GPA:.3g} GPa behind, the line turned by "
            f"{math.degrees(crossed.deflection):.3g} degrees and moved across itself at "
            f"{crossed.normal_speed:.3g} m/s",
            f"slip {crossed.slip:.3g} m/s, Atwood number {crossed.atwood:.3g}; rates of the "
            f"impulse {impulse / US:.3g} and of the slip {slip / US:.3g} a µs",
        ]
    for number, wave in enumerate(waves):
        if not np.isfinite(wave.amplitude).any():
            continue
        comparison = []
        top = int(np.nanargmax(wave.amplitude))
        rate = wave.measure_rate()
        grown = wave.get_amplitude(AGES[1]) / wave.amplitude[0]
        if math.isfinite(rate):
            comparison = ["theory of small slopes", f"a/a0 = {grown:.3g} at {AGES[1] * US:.2g} µs"]
        most = wave.amplitude[top]
        when = f"at {history['t'][top] * US:.2f} µs"
        comparison.append(f"at most {most * MM:.3g} mm, k a = {k * most:.2g}, {when}")
        label = f"wave {number + 1}, passed at {wave.passed * US:.2f} µs: growth [1/µs]"
        rows.append(
            Row(f"growth_{number}", rate, theory, label, US, 3, source="; ".join(comparison))
        )
    return rows, notes


COLOURS = {"impactor": "tab:blue", "shell": "0.45", "target": "tab:purple", "filling": "k"}
FACES = {"impactor": "#cfe2f3", "shell": "0.88", "target": "#e6dcf0", "filling": "#f6e3b4"}
LABELS = {"impactor": "impactor", "side": "shell", "behind": "target", "cone": "filling"}
PAINTED = ("impactor", "front", "side", "cone", "ring", "beside", "behind")
MOST_SHOWN_DUMPS = 6  # dumps in a picture that shows several times


def _draw_materials(axis, dump, names: dict[str, str], grid: bool) -> None:
    """Blocks filled with their materials' colours, with names or the grid.

    Blocks that follow come first: where their chords leave the line, others cover them.
    """
    for block in sorted(dump.blocks, key=lambda block: PAINTED.index(block.name)):
        x, y = nodes = MM * block.nodes
        face = FACES[block.material]
        axis.fill(*trace_outline(nodes), facecolor=face, edgecolor=face, lw=0.5)
        if grid:
            draw_grid(axis, nodes, color=COLOURS[block.material], lw=0.25)
        if block.name in names:
            position = x.mean(), y.mean() if y.min() > 0.0 else 0.3 * y.max()
            axis.text(*position, names[block.name], ha="center", va="center", fontsize="small")
    axis.set(aspect="equal", xlabel="x [mm]", ylabel="r [mm]")


class Results:
    """What the problem says of a run, a part of its class: its report and its pictures, in which
    each material has one colour."""

    def report(self, run) -> Report:
        """What was computed, beside theory where there is one."""
        history = run.history
        if not run.begun:
            return Report(rows=[Row("impact", theory=self.impact[0])])
        deck = self.deck
        t = history["t"]
        first, last = (part * self.impact[2] for part in PLATEAU)
        impact = reduce_between(np.mean, t, history["pressure_impact"], first, last)
        remark = f"mean from {US * first:.2f} to {US * last:.2f} µs; impedances match"
        label = "pressure on the impact face [GPa]"
        rows = [Row("impact", impact, self.impact[0], label, 1e9, 5, "impact", source=remark)]

        def tell(name, computed, label, unit=1.0, source=""):
            rows.append(Row(name, float(computed), label=label, unit=unit, digits=3, source=source))

        for part in PARTS:
            p, t, x, y = find_peak(history, part)
            remark = f"at {t * US:.3g} µs, x = {x * MM:.3g}, r = {y * MM:.2g} mm"
            label = f"greatest pressure in the {part}, {getattr(deck, part)} [GPa]"
            tell(f"peak_{part}", p, label, 1e9, remark)
        for number, part in enumerate(GAUGES):
            p = np.nanmax(history[f"pressure_gauge_{number}"])
            tell(f"gauge_{number}", p, f"the same on the axis at {part:g} of the cone [GPa]", 1e9)
        remark = f"{100.0 * history['transformed'][-1]:.2g} % at the end"
        most = np.nanmax(history["transformed"])
        tell("transformed", most, "most of the cone in the second phase [%]", 0.01, remark)
        for name, where in (("axis", "on the axis"), ("side", "along the side")):
            passages = measure_passage(self, history, name)
            for station, (t, speed, p) in zip(STATIONS, passages, strict=True):
                if math.isfinite(t):
                    x = MM * (deck.front + station * deck.cone)
                    label = f"shock {where} at x = {x:.4g} mm [km/s]"
                    tell(
                        f"shock_{name}_{station:g}",
                        speed,
                        label,
                        1e3,
                        f"at {t * US:.3f} µs, {p * GPA:.3g} GPa behind it",
                    )
        head = (
            f"conical-target: {deck.impactor} at {deck.speed:g} m/s on {deck.shell}, "
            f"{deck.filling} in {deck.target}, {deck.cells} cells to the shell"
        )
        if self.ripple:
            waves, notes = compare_waves(self, history)
            return Report(head, rows + waves, notes)
        begin, initial_growth, late = measure_growth(history)
        widest = int(np.nanargmax(history["line_amplitude"]))
        top, when = (history[name][widest] for name in ("line_amplitude", "t"))
        remark = f"half of peak to peak at the end; at most {top * MM:.2g} mm at {when * US:.2f} µs"
        label = "side: deviation from its own line [mm]"
        tell("line_amplitude", history["line_amplitude"][-1], label, 1e-3, remark)
        bend = history["line_bend"][-1]
        length = history["line_length"]
        remark = f"{length[-1] / length[0]:.3f} times its initial length"
        label = "side: deviation from its chord [mm]"
        tell("line_bend", bend, label, 1e-3, remark)
        if math.isfinite(initial_growth):
            tell(
                "line_growth",
                initial_growth,
                "initial growth of the side's amplitude [m/s]",
                1.0,
                f"from {begin * US:.2f} µs on; {late:.3g} m/s in the latest half",
            )
        return Report(head, rows)

    def cautions(self, run) -> list[str]:
        """Materials beyond their Hugoniots at the impact, fluids among solids."""
        deck = self.deck
        beyond = [
            caution
            for part in ("impactor", "shell")
            if part in self.materials
            for caution in caution_fit(
                getattr(deck, part), self.materials[part].eos, self.impact[0]
            )
        ]
        return beyond + list_fluids(self.laws)

    def figures(self):
        return {n: draw for n, draw in super().figures().items() if n != "ripple" or self.ripple}

    def draw_ripple(self, figure, run) -> None:
        """The rippled side at several times; amplitude over time, growth over age, with theory."""
        from matplotlib import colormaps

        figure.set_size_inches(11.0, 7.2)
        grid = figure.add_gridspec(2, 2, height_ratios=(1.25, 1.0))
        shape = figure.add_subplot(grid[0, :])
        amplitude, growth = (figure.add_subplot(grid[1, column]) for column in (0, 1))
        dumps = choose_even_dumps(run, MOST_SHOWN_DUMPS)
        k = self.ripple.wavenumber
        for shade, dump in zip(np.linspace(0.0, 0.9, len(dumps)), dumps, strict=True):
            line = MM * dump.block("cone").nodes[:, :, -1]
            colour = colormaps["viridis"](shade)
            shape.plot(*line, lw=1.4, label=f"{US * dump.t:.2g} µs", color=colour)
        shape.set(aspect="equal", xlabel="x [mm]", ylabel="r [mm]")
        shape.set_title("line between graphite and lead", fontsize="medium")
        crossed, waves = measure_waves(self, run.history)
        t = run.history["t"]
        top = max((np.nanmax(wave.amplitude) for wave in waves), default=math.nan)
        for number, wave in enumerate(waves):
            style = {"color": f"C{number}"}
            grown = wave.age > 0.0
            label = f"wave {number + 1}"
            first = wave.amplitude[0]
            amplitude.plot(US * t, MM * wave.amplitude, label=label, **style)
            growth.plot(US * wave.age[grown], wave.amplitude[grown] / first, label=label, **style)
            theory = first * crossed.compute_growth(k, wave.age) if crossed else np.zeros(0)
            gentle = theory < 1.5 * top
            amplitude.plot(US * t[gentle], MM * theory[gentle], "--", lw=0.9, **style)
        amplitude.axhline(MM / k, color="0.6", lw=0.7, label="k a = 1")
        if crossed is not None:
            age = np.linspace(0.0, max(wave.age[-1] for wave in waves), 200)
            impulse, shear = crossed.compute_rates(k)
            plus = crossed.compression
            for values, style, label in (
                (crossed.compute_growth(k, age), "k--", "theory"),
                (plus * (1.0 + impulse * age), "k-.", "impulse alone"),
                (plus * np.cosh(shear * age), "k:", "slip alone"),
            ):
                growth.plot(US * age, values, style, lw=0.9, label=label)
            growth.set_ylim(0.75, 2.0 * top / np.nanmean([wave.amplitude[0] for wave in waves]))
        amplitude.set(xlabel="t [µs]", ylabel="amplitude [mm]")
        amplitude.set_title("dashed: theory of small slopes", fontsize="medium")
        growth.set(xlabel="time since the shock was at the wave [µs]", ylabel="a / a0")

    def draw_conical_target(self, figure, run) -> None:
        """Materials at the start and the end, pressure at the end; graphite and its corner near."""
        figure.set_size_inches(12.0, 7.4)
        grid = figure.add_gridspec(2, 6, height_ratios=(1.0, 1.25))
        top = [figure.add_subplot(grid[0, 2 * n : 2 * n + 2]) for n in range(3)]
        near = figure.add_subplot(grid[1, :3])
        corner = figure.add_subplot(grid[1, 3:])
        first = run.dumps[0]
        last = run.dumps[-1]
        names = {block: getattr(self.deck, part).split("-")[0] for block, part in LABELS.items()}
        for axis, dump in zip(top, (first, last), strict=False):
            _draw_materials(axis, dump, names, grid=False)
            axis.set_title(f"t = {dump.t * US:.3g} µs", fontsize="medium")
        title = f"t = {last.t * US:.3g} µs"
        pressures = Colours(unit=1e9)
        draw_field(top[2], last, "p", pressures, bar="pressure [GPa]", title=title, mm=True)
        draw_lines(top[2], [MM * trace_outline(block.nodes) for block in last.blocks])
        for axis in (near, corner):
            axis.set_facecolor(FACES["shell"])  # what shows between chords and the line
            _draw_materials(axis, last, {}, grid=True)
        cone = MM * last.block("cone").nodes
        left, _ = cone.min(axis=(1, 2))
        right, high = cone.max(axis=(1, 2))
        near.set(xlim=(left - 1.5, right + 1.5), ylim=(0.0, high + 1.5))
        near.set_title(f"the graphite at {last.t * US:.3g} µs", fontsize="medium")
        x, y = cone[:, 0, -1]
        corner.set(xlim=(x - 1.6, x + 3.2), ylim=(y - 1.9, y + 1.3))
        corner.set_title("where graphite, steel and lead meet", fontsize="medium")

    def draw_graphite(self, figure, run) -> None:
        """Part in the second phase over time; states beside the Hugoniot; where the phase is."""
        part, states, map_axes = make_panels(figure, 12.0, 4.2, 1, 3, width_ratios=(1.0, 1.0, 1.3))
        material = self.materials["filling"]
        eos = material.eos
        t = run.history["t"]
        share = run.history["transformed"]
        part.plot(US * t, 100.0 * share, color="k")
        part.set(xlim=(0.0, US * t[-1]), ylim=(0.0, None))
        part.set(xlabel="t [µs]", ylabel="in the second phase [% of the cone's mass]")
        tops = [float(dump["cone"].p.max()) for dump in run.dumps]
        shares = [float(np.interp(dump.t, t, share)) for dump in run.dumps]
        most = run.dumps[int(np.argmax(shares if max(shares) > 0.0 else tops))]
        for dump in choose_even_dumps(run, MOST_SHOWN_DUMPS)[1:]:
            rho = dump["cone"].rho.ravel()
            p = GPA * dump["cone"].p.ravel()
            states.plot(rho, p, ".", ms=1.5, zorder=2, label=f"{US * dump.t:.3g} µs")
        shocks = [(material.rho0, 0.0)]
        with contextlib.suppress(BadInput):  # beyond its table
            for p in np.linspace(0.0, 1.05 * max(tops), 60)[1:]:
                shocks.append((shock_to_pressure(eos, material.rho0, 0.0, p).rho, p))
        rho, p = np.array(shocks).T
        states.plot(rho, GPA * p, color="k", lw=0.9, zorder=3, label="Hugoniot")
        states.set(xlim=(0.9 * rho[0], 1.15 * rho[-1]), ylim=(None, 1.1 * GPA * max(tops)))
        if eos.mixed_region is not None:
            edges = [eos.rho0 / (1.0 - eta) for eta in eos.mixed_region]
            states.axvspan(*edges, color="0.9", zorder=0, label="both phases")
        states.set(xlabel="density [kg/m3]", ylabel="pressure [GPa]")
        states.legend(fontsize="x-small", markerscale=4.0, loc="upper left")
        cone = most["cone"]
        style = {"cmap": "magma_r", "vmin": 0.0, "rasterized": True}
        values = 100.0 * eos.compute_second_part(cone.rho)
        picture = map_axes.pcolormesh(*(MM * cone.nodes), values, **style)
        map_axes.plot(*(MM * trace_outline(cone.nodes)), "k", lw=0.8)
        map_axes.set(aspect="equal", xlabel="x [mm]", ylabel="r [mm]")
        map_axes.set_title(f"t = {US * most.t:.3g} µs", fontsize="medium")
        figure.colorbar(picture, ax=map_axes, shrink=0.7, label="second phase [%]")

    def draw_converging_shock(self, figure, run) -> None:
        """Place of the shock in the cone over time, pressure behind it and speed over the place."""
        path, pressure, speed = make_panels(figure, 11.0, 3.8, 1, 3)
        reach = FITTED_STRETCH_PART * self.deck.cone
        for name, label in (("axis", "on the axis"), ("side", "along the side")):
            t, x, p = get_shock_path(run.history, name)
            path.plot(US * t, MM * x, label=label)
            pressure.plot(MM * x, GPA * p, label=label)
            positions = np.linspace(*x[[0, -1]], 40)[1:-1] if x.size > 8 else np.empty(0)
            speeds = [fit_slope(t, x, np.abs(x - place) < reach, 4) for place in positions]
            speed.plot(MM * positions, 1e-3 * np.array(speeds), label=label)
        pressure.set(xlabel="x of the shock [mm]", ylabel="greatest pressure just behind [GPa]")
        speed.set(xlabel="x of the shock [mm]", ylabel="speed [km/s]")
        path.set(xlabel="t [µs]", ylabel="x of the shock [mm]")

    def draw_cone_side(self, figure, run) -> None:
        """The line between graphite and lead, and its departure from its own straight line."""
        shape, away = make_panels(figure, 9.5, 4.0, 1, 2)
        for dump in choose_even_dumps(run, MOST_SHOWN_DUMPS):
            line = dump.block("cone").nodes[:, :, -1]
            label = f"{US * dump.t:.2g} µs"
            departure, part = measure_departure(line)
            shape.plot(*(MM * line), lw=1.0, label=label)
            away.plot(part, MM * departure, lw=1.0, label=label)
        shape.set(aspect="equal", xlabel="x [mm]", ylabel="r [mm]")
        away.set(
            xlabel="fraction of the side's length from the base",
            ylabel="deviation from its straight line [mm]",
        )
        for end in MIDDLE:
            away.axvline(end, color="0.7", lw=0.6)
