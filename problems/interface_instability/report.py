"""Summary and pictures of `interface-instability`: measured growth compared with theory."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from shockgrid.problems.interface_instability.line import Harmonic
from shockgrid.problems.interface_instability.reshock import (
    TURBULENT_GROWTH,
    compare_growth,
    describe_reshock,
    find_reshock,
    scale_since,
)
from shockgrid.problems.interface_instability.shocked import Shocked
from shockgrid.problems.interface_instability.theories import (
    LEAST_WINDOW,
    MOST_COUPLED_KA,
    WINDOW,
    Growth,
    get_kct,
    is_still,
    predict_amplitude,
)
from shockgrid.problems.interface_instability.zone import find_lines
from shockgrid.problems.pictures import (
    Colours,
    choose_even_dumps,
    compute_rates,
    draw_field,
    draw_lines,
    find_dump,
    name_axis,
)
from shockgrid.problems.report import Report, Row
from shockgrid.problems.signals import fit_slope
from shockgrid.regrid.measure.corners import compute_centres

# times the height of the domain, beyond which panels of the interface lie one above the other
FLAT_ZONE_HEIGHTS = 3.0
SHOWN_TIMES = 3  # times drawn beside the growth
MOST_CURVES = 6  # modes that a screen and a picture of growth show one by one, the strongest
FIRST_DRAWN_KCT = 1.0  # k c t from which on computed rates are drawn
MOST_NAMED = 3  # curves of rates with names of their own: more have the colours of amplitudes
SAID_THEORY_ERROR = 2e-4  # error of the theory's numbers from which on it is said
NO_WAVE = 1e-6  # of the shock's pressure: a weaker reflected wave is none


def _columns(
    followed: Sequence[Harmonic], history: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """The columns used here, without rows that have no amplitude."""
    names = ["t", "amplitude", "interface_mean", "interface_min", "interface_max",
             "far_transverse_speed", *(mode.column for mode in followed)]  # fmt: skip
    column = {name: np.asarray(history[name], dtype=float) for name in names if name in history}
    known = np.isfinite(column["amplitude"]) & np.isfinite(column["t"])
    return {name: values[known] for name, values in column.items()}


def _describe_handover(shocked: Shocked, history: Mapping[str, np.ndarray]) -> list[str]:
    """From when on both materials are on one grid, and what was measured before and after."""
    mixed = np.flatnonzero(np.asarray(history.get("mixed_mass", ())) > 0.0)
    if not mixed.size or mixed[0] == 0:
        return []
    row = int(mixed[0])
    kct = float(get_kct(shocked, history["t"][row]))
    measured = []
    for name in ("amplitude", "integral_width", "circulation"):
        before, after = (float(history[name][at]) for at in (row - 1, row))
        change = f" ({100.0 * (after / before - 1.0):+.2f} %)" if before else ""
        measured.append(f"{name.replace('_', ' ')} {before:.4g} -> {after:.4g}{change}")
    return [f"both materials on one grid from k c t = {kct:.3g} on: {', '.join(measured)}"]


def _describe_ends(shocked: Shocked) -> list[str]:
    """When waves are back from the ends of a tube that a run is to go on in."""
    if not shocked.is_tube:
        return []
    ends = {"first": "the piston's end", "second": "the end wall"}
    returned = [
        f"from {ends[name]} at k c t = {float(get_kct(shocked, t)):.3g}"
        for name, (t, _) in shocked.echoes.items()
        if t < shocked.t_end
    ]
    return [f"waves come back {' and '.join(returned)}; no theory goes on"] if returned else []


def _predict(shocked: Shocked) -> list[Row]:
    """Theory alone; growth_rate is the mean over the part of WINDOW that the run reaches."""
    theory = shocked.linear_growth
    if shocked.deck.second_shock is not None:
        return []
    known = {"interface_speed": theory.base.u, "atwood_number": theory.atwood}
    rows = [Row(name, theory=value) for name, value in known.items()]
    if shocked.harmonics:
        reach = min(shocked.t_end, Growth(shocked).open_time)
        last = min(WINDOW[1], float(get_kct(shocked, reach)))
        if last > WINDOW[0] + LEAST_WINDOW:
            rows.append(Row("growth_rate", theory=theory.get_mean_rate(WINDOW[0], last)))
        rows.append(Row("impulsive_rate", theory=theory.impulsive))
    return rows


def find_strongest(modes: Sequence[Harmonic]) -> list[Harmonic]:
    """The MOST_CURVES steepest of the modes, by number."""
    steepest = sorted(modes, key=lambda mode: -abs(mode.number * mode.amplitude))[:MOST_CURVES]
    return sorted(steepest, key=lambda mode: mode.number)


def _describe_modes(shocked: Shocked) -> str:
    modes = shocked.harmonics
    if not modes:
        return "no wave"
    if len(modes) > MOST_CURVES:
        rms = shocked.k * math.sqrt(sum(0.5 * mode.amplitude**2 for mode in modes))
        return f"{len(modes)} modes, {modes[0].number} to {modes[-1].number}, k a rms = {rms:.4g}"
    sizes = ", ".join(f"{shocked.k * abs(mode.amplitude):g}" for mode in modes)
    numbers = ", ".join(str(mode.number) for mode in modes)
    return f"k a0 = {sizes}" + (f" of modes {numbers}" if numbers != "1" else "")


def _compare(shocked: Shocked, column, kct: float) -> tuple[list[Row], list[str]]:
    """Rows of the modes, the speed and the models, and what else is to be said of the growth."""
    theory = shocked.linear_growth
    growth = Growth(shocked)
    notes = []
    t = column["t"]
    exact = float(theory.base.u)
    until = min(t[-1], growth.open_time)
    after = (t > shocked.arrival + 0.3 * (until - shocked.arrival)) & (t <= until)
    speed = fit_slope(t, column["interface_mean"], after)
    label = "interface speed [m/s]" if math.isfinite(speed) else ""
    source = "exact Riemann solution"
    last = Row("interface_speed", speed, exact, label, digits=5, studied=True, source=source)
    modes = shocked.harmonics
    several = len(shocked.harmonics) > 1
    if not modes:
        return [last], ["growth: the interface is flat"]
    shown = several or growth.linear_reach > 0.0 or bool(growth.model_fails)
    strongest = find_strongest(modes)
    rows = []
    for mode in modes:
        rows += _compare_mode(growth, mode, column, kct, several, shown and mode in strongest)
    if len(strongest) < len(modes):
        notes.append(
            f"these are the {len(strongest)} steepest of {len(modes)} modes; all of them: "
            "shockgrid plot DIR --what spectrum"
        )
    known = [row for row in rows if row.label and row.source.startswith("linear")]
    rows.append(last)
    if any(not is_still(theory, row.theory) for row in known):
        label = f"impulsive model ({theory.impulse}) [m/s]"
        source = "for comparison"
        rows.append(Row("impulsive", math.nan, theory.impulsive, label, digits=5, source=source))
    if growth.linear_reach < kct:
        if several:
            start = growth.first_slope
            reach = growth.linear_reach
            since = f"from k c t = {reach:.3g} on" if reach else "from the start"
            notes.append(
                f"the modes couple {since}: the sum of their k a, initially {start:.3g}, exceeds "
                f"{MOST_COUPLED_KA:g}; linear theory treats each mode alone"
            )
        if growth.model_fails:
            notes.append(f"beyond linear theory there is no model: {growth.model_fails}")
        else:
            rows.append(_compare_model(growth, column, kct))
    return rows, notes


def _compare_mode(growth, mode: Harmonic, column, kct: float, several: bool, shown) -> list[Row]:
    """Rows for one mode: its rate, and its size where theory has next to no growth."""
    theory = growth.theory
    window = growth.find_window(mode, kct)
    name = f"growth_rate_mode_{mode.number}" if several else "growth_rate"
    if window is None or mode.column not in column:
        return [Row(name, studied=True)]
    head = f"mode {mode.number}: " if several else ""
    label = (
        f"{head}(da/dt)/(k a0) [m/s], {window.first:g} < k c t < {window.last:.3g}" if shown else ""
    )
    rate = growth.measure_rate(column, mode, window.first, window.last)
    reduction = growth.find_reduction(mode.number)
    expected = float(theory.get_mean_rate(window.first, window.last)) / reduction
    source = "linear compressible theory"
    if reduction != 1.0:
        source += f" over psi = {reduction:.4g} of the graded layer"
    if theory.error > SAID_THEORY_ERROR:
        source += f" (its own error up to {100.0 * theory.error:.1g} %)"
    if not window.linear:
        limit = "waves couple" if several else f"k a > {growth.limit:.2g}"
        beyond = {"off": "--", "source": f"{source}, beyond its range, {limit}"}
        return [
            Row(name, studied=True),
            Row(f"{name}_beyond", rate, expected, label, digits=5, **beyond),
        ]
    returned = mode.number * growth.open_reach
    if window.last == returned:
        source += ", until waves return from the far sides"
    if not is_still(theory, expected):
        if not several and window.last < min(WINDOW[1], kct, returned):
            source += f", up to k a = {growth.limit:.2g}, its limit"
        return [Row(name, rate, expected, label, digits=5, studied=True, source=source)]
    share = f"{100.0 * (rate - expected) / theory.base.u:+.2f} % of u"
    source += "; u: interface speed"
    times = mode.number * get_kct(growth.shocked, column["t"])
    size = float(np.interp(window.last, times, column[mode.column])) / mode.amplitude
    size_expected = float(predict_amplitude(theory, window.last))
    size_expected = theory.compression + (size_expected - theory.compression) / reduction
    size_label = f"{head}a / a0 at k c t = {window.last:.3g}" if shown else ""
    missing = {"off": f"{100.0 * (size - size_expected):+.2f} % of a0", "source": "the same theory"}
    return [
        Row(name, rate, expected, label, digits=5, studied=True, source=source, off=share),
        Row(f"{name}_size", size, size_expected, size_label, digits=5, **missing),
    ]


def _compare_model(growth, column, kct: float) -> Row:
    """The row of the Padé model, at the end or where its range ends."""
    shocked = growth.shocked
    last = min(kct, growth.model_reach)
    t = shocked.arrival + last / (shocked.k * shocked.linear_growth.sound_speed)
    computed = float(np.interp(t, column["t"], column["amplitude"]))
    model = float(growth.compute_model(np.array([t]))[-1])
    ends = last < kct
    label = f"amplitude at k c t = {last:.3g} [m]" if ends else "amplitude at the end [m]"
    why = "waves return" if last == growth.open_reach else "its range ends"
    source = "Padé model, rough" + (f": {why} there" if ends else "")
    return Row("model_amplitude", computed, model, label, digits=5, source=source)


class _Curve(NamedTuple):
    """What is drawn of one mode, or of the whole line: values over `first`, in k of `number`."""

    label: str
    values: np.ndarray
    first: float
    number: int


def _choose_curves(shocked: Shocked, growth, column) -> list[_Curve]:
    """The whole line where it is steep, else each of its modes."""
    modes = [mode for mode in shocked.harmonics if mode.column in column]
    one = len(modes) == 1 and growth is not None
    if not modes or growth is None or (one and growth.linear_reach == 0.0):
        return [_Curve("computed", column["amplitude"], column["amplitude"][0] or 1.0, 1)]
    return [
        _Curve("computed" if one else f"mode {m.number}", column[m.column], m.amplitude, m.number)
        for m in find_strongest(modes)
    ]


def _draw_theory(amplitude, rate, growth, curves: list[_Curve], column, kct: np.ndarray) -> None:
    """Theories of the curves, and the time up to which they hold, where it ends."""
    shocked = growth.shocked
    theory = growth.theory
    known = (kct > 0.0) & (kct <= min(theory.kt[-1] * theory.sound_speed, growth.open_reach))
    t = column["t"][known] - shocked.arrival
    reach = growth.linear_reach
    several = len(curves) > 1
    for n, curve in enumerate(curves):
        dashes = {"color": f"C{n}" if several else "k", "ls": "--"}
        reduction = growth.find_reduction(curve.number)
        pressed = theory.compression
        grown = predict_amplitude(theory, curve.number * kct[known]) - pressed
        amplitude.plot(kct[known], pressed + grown / reduction, **dashes)
        rate.plot(kct[known], theory.get_rate(curve.number * shocked.k, t) / reduction, **dashes)
    label = "linear compressible"
    modes = len(shocked.harmonics) > 1
    label += ", waves couple" if modes and reach == 0.0 else ""
    for axes in (amplitude, rate)[modes:]:  # the first is too narrow for this and names of modes
        axes.plot([], [], "k--", label=label)
    if modes and 0.0 < reach < kct[-1]:
        for axes in (amplitude, rate):
            axes.axvline(reach, color="0.4", lw=0.8, ls=":", label="waves couple")
    if growth.open_reach < kct[-1]:
        for axes in (amplitude, rate):
            axes.axvline(growth.open_reach, color="0.4", lw=0.8, ls="-.", label="waves return")
    rate.axhline(theory.impulsive, color="0.6", lw=0.8, label=f"impulsive ({theory.impulse})")
    if reach == 0.0 and not growth.model_fails:
        model = growth.compute_model(column["t"]) / curves[0].first
        model[kct > growth.model_reach] = np.nan
        amplitude.plot(kct, model, "C1:", label="Padé model")
        top = np.nanmax([np.nanmax(model), (column["amplitude"] / curves[0].first).max()])
        amplitude.set_ylim(0.0, 1.6 * top)


def _draw_rates(shocked: Shocked, axes, t, curves: list[_Curve]) -> None:
    """Computed rates after the shock's passage."""
    for n, c in enumerate(curves):
        times, speed = compute_rates(t, c.values)
        kct = get_kct(shocked, times)
        shown = kct > FIRST_DRAWN_KCT
        rate = speed / (c.number * shocked.k * c.first)
        label = f"{c.label} (after shock passage)" if len(curves) <= MOST_NAMED else None
        axes.plot(kct[shown], rate[shown], color=f"C{n}", label=label)
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))


def find_reach(drawn: Sequence[Sequence[np.ndarray]], margin: float) -> float:
    """Half of the width [m] that panels of the interface need, all of them alike.

    drawn: curves (2, n) of the interface at each time.
    """
    lines = [np.concatenate(curves, axis=1) for curves in drawn]
    return max((max(0.6 * np.ptp(x) + margin, 0.5 * np.ptp(y)) for x, y in lines), default=0.0)


def _mark_handover(
    axes, shocked: Shocked, history: Mapping[str, np.ndarray], kct: np.ndarray
) -> None:
    """A line where both materials come onto one grid."""
    mixed = np.flatnonzero(np.asarray(history.get("mixed_mass", ())) > 0.0)
    if mixed.size and mixed[0] > 0:
        at = float(get_kct(shocked, history["t"][mixed[0]]))
        axes.axvline(at, color="C3", lw=0.8, label="one grid for both")


class Results:
    """What the problem says of a run, a part of its class: its report and its pictures."""

    def report(self, run) -> Report:
        """Growth rates (da/dt)/(k a0) of the modes [m/s], each over the window where theory holds,
        and the speed of the interface [m/s], which studies draw; sizes by the models.

        No numbers for two shocks, for which there is no theory.
        """
        theory = self.linear_growth
        deck = self.deck
        if not run.begun:
            return Report(rows=_predict(self.shocked))
        column = _columns(self.followed, run.history)
        first, kct = (float(get_kct(self.shocked, t)) for t in (0.0, column["t"][-1]))
        times = f"to k c t = {kct:.3g}"
        if self.start == "crossed":
            times = f"from linear theory at k c t = {first:.2g} to {kct:.3g}"
        jump = abs(theory.base.p - self.shock.p)
        reflected = theory.reflected if jump > NO_WAVE * self.shock.p else "none"
        ahead = float(self.eos_first.sound_speed(self.rho_first, deck.pressure))
        head = [
            f"Mach {self.shock.shock_speed / ahead:.3g} shock (to p = {self.shock.p:.4g} Pa) from "
            f"density {self.rho_first:g} kg/m3 into density {self.rho_second:g} kg/m3; "
            f"{_describe_modes(self.shocked)}, {deck.cells} cells per wavelength, {times}",
            f"  reflected wave: {reflected}, Atwood number after the shock {theory.atwood:.3f}",
            f"  smoothing length of the interface: {self.thickness / deck.wavelength:.3g} "
            f"wavelengths ({self.thickness * deck.cells / deck.wavelength:.2g} of a cell)",
        ]
        rows = []
        notes = ["growth: there is no theory for two shocks"]
        if deck.second_shock is None:
            rows, notes = _compare(self.shocked, column, kct)
        notes += _describe_ends(self.shocked)
        if reshock := find_reshock(self.shocked):
            rows += compare_growth(self.shocked, reshock, column)
            notes.append(describe_reshock(reshock))
        notes += _describe_handover(self.shocked, run.history)
        far = column["far_transverse_speed"].max() / theory.sound_speed
        notes.append(
            f"amplitude {column['amplitude'][0]:.4g} -> {column['amplitude'][-1]:.4g} m, largest "
            f"transverse speed in the far field {far:.1e} of the sound speed"
        )
        return Report("\n".join(head), rows, notes)

    def scale_time(self, t):
        return f"k c t = {float(get_kct(self.shocked, t)):.3g}"

    def figures(self):
        found = super().figures()
        drawn = {"spectrum": len(self.harmonics) > MOST_CURVES, "reshock": self._is_reshocked()}
        return {name: draw for name, draw in found.items() if drawn.get(name, True)}

    def _is_reshocked(self) -> bool:
        """Whether the run is to show what the shock does that comes back from an end wall."""
        return find_reshock(self.shocked) is not None

    def draw_growth(self, figure, run) -> None:
        """Amplitude and growth rate against theory, and the interface with its grid at the end."""
        drawn = self._find_drawn_lines(run)
        reach = find_reach([lines for _, lines in drawn], 0.05 * self.deck.wavelength)
        # panels of a zone that is longer than high lie one above the other
        height = self.deck.width * self.deck.wavelength
        flat = 2.0 * reach > FLAT_ZONE_HEIGHTS * height
        count = max(1, len(drawn)) if flat else 1
        ratios = [1.0] + [0.45] * count if flat else [1.0, 1.1]
        figure.set_size_inches(10.0, 4.0 + 1.4 * count if flat else 6.0)
        grid = figure.add_gridspec(1 + count, 2 * SHOWN_TIMES, height_ratios=ratios)
        narrow = SHOWN_TIMES if flat else 2
        amplitude = figure.add_subplot(grid[0, :narrow])
        rate = figure.add_subplot(grid[0, narrow:])
        column = _columns(self.followed, run.history)
        kct = get_kct(self.shocked, column["t"])
        several = len(self.harmonics) > 1
        growth = Growth(self.shocked) if self.deck.second_shock is None and self.harmonics else None
        curves = _choose_curves(self.shocked, growth, column)
        for n, curve in enumerate(curves):
            amplitude.plot(kct, curve.values / curve.first, color=f"C{n}", label=curve.label)
        if growth is not None:
            _draw_theory(amplitude, rate, growth, curves, column, kct)
        if len(kct) > 3:
            _draw_rates(self.shocked, rate, column["t"], curves)
        time_label = "k c t after the shock's arrival" + ", k of mode 1" * several
        amplitude.set(xlabel=time_label, ylabel="a / a0")
        rate.set(xlabel=time_label, ylabel="(da/dt) / (k a0)")
        for axes in (amplitude, rate):
            _mark_handover(axes, self.shocked, run.history, kct)
        if drawn:
            places = [(1 + n, slice(None)) for n in range(len(drawn))]
            if not flat:
                places = [(1, slice(2 * n, 2 * n + 2)) for n in range(len(drawn))]
            panels = [figure.add_subplot(grid[place]) for place in places]
            self._draw_zone(figure, panels, drawn, reach)

    def _find_drawn_lines(self, run) -> list[tuple]:
        """Dumps over the run, and in each the curves (2, n) of the interface."""
        return [(dump, find_lines(dump.blocks)) for dump in choose_even_dumps(run, SHOWN_TIMES)]

    def _draw_zone(self, figure, panels, drawn, reach: float) -> None:
        """Density and grid around the interface, in a panel each, all as wide as 2 `reach` [m]."""
        windows = []
        shown = []
        for dump, curves in drawn:
            x = np.concatenate(curves, axis=1)[0]
            middle = 0.5 * (x.min() + x.max())
            windows.append((middle - reach, middle + reach))
            for block in dump.blocks:
                inside = np.abs(compute_centres(block.nodes)[0] - middle) <= reach
                shown.append(block.rho[inside])
        rho = np.concatenate(shown)
        for axes, (dump, curves), window in zip(panels, drawn, windows, strict=True):
            title = f"density and grid, {self.scale_time(dump.t)}"
            colours = Colours(low=rho.min(), high=rho.max())
            picture = draw_field(axes, dump, "rho", colours, every=1, title=title)
            draw_lines(axes, curves)
            axes.set_xlim(*window)
        label = name_axis("density", "kg/m3" if self.t_unit == "s" else "1")
        figure.colorbar(picture, ax=panels, label=label)

    def draw_reshock(self, figure, run) -> None:
        """Widths of the zone after the reshock beside the growth of a turbulent zone."""
        reshock = find_reshock(self.shocked)
        history = run.history
        wavelength = self.deck.wavelength
        since = scale_since(reshock, wavelength, history["t"])
        figure.set_size_inches(7.0, 4.5)
        axes = figure.subplots()
        extent = np.asarray(history["interface_max"]) - np.asarray(history["interface_min"])
        axes.plot(since, extent / wavelength, label="between both tips")
        if "integral_width" in history:
            width = np.asarray(history["integral_width"]) / wavelength
            axes.plot(since, width, label="integral width")
        # from the least extent on
        after = since > 0.0
        start = int(np.flatnonzero(after)[np.argmin(extent[after])])
        way = since[start:] - since[start]
        model = extent[start] / wavelength + TURBULENT_GROWTH * way
        axes.plot(since[start:], model, "k--", label=f"{TURBULENT_GROWTH} A dV: turbulent zone")
        axes.axvline(0.0, color="0.4", lw=0.8, ls="-.", label="reshock")
        mixed = np.flatnonzero(np.asarray(history.get("mixed_mass", ())) > 0.0)
        if mixed.size and mixed[0] > 0:
            axes.axvline(since[mixed[0]], color="C3", lw=0.8, label="one grid for both")
        words = "A dV (t - arrival of the reshock) / wavelength"
        axes.set(xlabel=words, ylabel="width / wavelength")

    def draw_spectrum(self, figure, run) -> None:
        """k a of each mode by its number at some times, and the line at these times.

        Theory is drawn where there is one: for a single shock, and for small slopes alone right.
        """
        from matplotlib.ticker import MaxNLocator

        history = run.history
        modes = self.harmonics
        known = np.flatnonzero(np.isfinite(history["amplitude"]))
        numbers, first = np.array([(mode.number, mode.amplitude) for mode in modes]).T
        kct = np.asarray(get_kct(self.shocked, history["t"]), dtype=float)
        axes, lines = figure.subplots(1, 2, width_ratios=(2.0, 1.0))
        axes.semilogy(numbers, np.abs(first) * self.k, "o-", color="0.6", ms=3, label="start")
        for n in range(SHOWN_TIMES):
            row = known[np.argmin(np.abs(kct[known] - kct[known[-1]] * (n + 1) / SHOWN_TIMES))]
            size = np.array([history[mode.column][row] for mode in modes])
            colour = f"C{n}"
            axes.semilogy(
                numbers,
                np.abs(size) * self.k,
                "o",
                color=colour,
                ms=4,
                label=f"k c t = {kct[row]:.3g}",
            )
            if self.deck.second_shock is None and kct[row] > 0.0:
                theory = first * predict_amplitude(self.linear_growth, numbers * kct[row])
                axes.semilogy(numbers, np.abs(theory) * self.k, "--", color=colour, lw=1)
            if run.dumps:
                curves = find_lines(find_dump(run, float(history["t"][row])).blocks)
                mean = np.concatenate(curves, axis=1)[0].mean()
                for x, y in curves:
                    lines.plot(x - mean, y, color=colour, lw=1)
        axes.plot([], [], "k--", lw=1, label="linear compressible")
        axes.set(xlabel="number of the mode", ylabel="k $|a_n|$ of mode n, k = 2π / wavelength")
        unit = "m" if self.t_unit == "s" else "1"
        lines.set(xlabel=name_axis("x minus its mean", unit), ylabel=name_axis("y", unit))
        lines.set_title("the interface at these times", fontsize=9)
        lines.xaxis.set_major_locator(MaxNLocator(4))
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
