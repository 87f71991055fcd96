"""The closing screens of `heated-cavity` and `rayleigh-benard`: computed beside reference."""

from __future__ import annotations

import math

import numpy as np

from problems.references.layer_growth import compute_layer_growth
from regrid.errors import BadInput

ROWS = (
    ("Nu mean, left wall", "nusselt", None),
    ("greatest u on x = 1/2", "u_max", "u_max_y"),
    ("greatest v on y = 1/2", "v_max", "v_max_x"),
    ("greatest Nu, left wall", "nusselt_max", "nusselt_max_y"),
)
POSITIONS = {"u_max_y": "y", "v_max_x": "x", "nusselt_max_y": "y"}
SMALL = 1e-2  # of the last kinetic energy: below it a disturbance grows by linear theory
ONSET_BRACKET = (0.3, 3.0)  # of the reference, or of the deck's Rayleigh number
STILL = 1e-9  # kinetic energy over the squared disturbance: less is no flow [m4/s2/K2]
WIDENINGS = 3  # of the bracket, tenfold both ways


def make_cavity_summary(problem, history) -> str:
    """Table of the quantities of the reference, with its values where there are any."""
    deck = problem.deck
    reference = problem.find_reference()
    across, up = problem.size
    lines = [
        f"Ra = {deck.rayleigh:g}, Pr = {deck.prandtl:g}, {across} x {up} cells, "
        f"grid {deck.grid.kind}",
        "                           computed  reference  difference",
    ]
    for words, name, at in ROWS:
        found = float(history[name][-1])
        line = f"  {words:23} {found:10.6g}"
        if reference is not None:
            exact = getattr(reference, name)
            line += f" {exact:10.6g} {found / exact - 1.0:+10.3%}"
        if at is not None:
            line += f"{'' if reference else ' ':3} at {POSITIONS[at]} = {history[at][-1]:.5f}"
            if reference is not None:
                line += f" ({getattr(reference, at):.5f})"
        lines.append(line)
    if reference is None:
        lines[1] = "                           computed  (no reference for this deck)"
    passes = deck.bottom.heat == deck.top.heat == "adiabatic"
    if passes and history["nusselt"][-1] != 0.0:
        balance = history["nusselt_right"][-1] / history["nusselt"][-1] - 1.0
        lines.append(f"  heat out at the right over heat in at the left, less 1: {balance:.1e}")
    lines.append(
        f"  volume lost in a cell, over the largest flux: {history['mass_residual'][-1]:.1e}"
    )
    if deck.method == "steady":
        part, change = float(history["buoyancy"][-1]), float(history["change"][-1])
        if part < 1.0 or change > deck.tolerance:
            lines.insert(
                1,
                f"NOT STEADY: these are iterates at Ra = {part * deck.rayleigh:.3g} that still "
                f"change by {change:.1e}; more iterations (run.t_end) or method = 'time'",
            )
        lines.append(f"  last change of Newton's iteration: {history['change'][-1]:.1e}")
    return "\n".join(lines)


def measure_growth(t: np.ndarray, energy: np.ndarray) -> tuple[float, float]:
    """(growth rate [1/s], its spread) from the time and kinetic energy of a disturbance.

    Median of the slopes of log(energy)/2 while the energy is small and after the first steps; the
    spread is half the range of the middle half of the slopes.  nan where too few steps are small.
    """
    known = np.isfinite(energy) & (energy > 0.0)
    t, energy = t[known], energy[known]
    decays = energy[-1] < energy[0]
    small = energy < (np.inf if decays else SMALL * energy.max())
    end = int(np.argmin(small)) if not small.all() else small.size
    if end < 12:
        return math.nan, math.nan
    slopes = 0.5 * np.diff(np.log(energy[4:end])) / np.diff(t[4:end])
    low, middle, high = np.percentile(slopes, (25, 50, 75))
    return float(middle), float(0.5 * (high - low))


def find_onset(problem) -> tuple[float | None, float | None]:
    """(Ra at which growth of the discrete equations begins, the reference); None where unknown."""
    from hydro.convection.box import make_fluid
    from hydro.convection.measure import find_onset as bracket

    reference = problem.find_onset_reference()
    deck = problem.deck
    about = reference or max(deck.rayleigh, 1.0)
    fluid = make_fluid(1.0, deck.prandtl, deck.tilt)
    equations = problem.make_first_equations()
    low, high = (part * about for part in ONSET_BRACKET)
    for _ in range(WIDENINGS):
        try:
            return bracket(equations, fluid, low, high), reference
        except BadInput:  # both ends grow, or both decay
            low, high = 0.1 * low, 10.0 * high
    return None, reference


def make_benard_summary(problem, history) -> str:
    """Onset and growth rate beside linear theory, heat carried at the end."""
    from hydro.convection.measure import compute_growth, solve_rest

    deck = problem.deck
    lines = [
        f"{deck.shape}, Ra = {deck.rayleigh:g}, Pr = {deck.prandtl:g}, {deck.cells} x "
        f"{deck.cells_up} cells, grid {deck.grid.kind}",
        "                              computed  reference  difference",
    ]
    if deck.onset and deck.tilt == 0.0:
        found, reference = find_onset(problem)
        if found is None:
            lines.append(f"  {'onset, Ra':26}      none  was found")
        else:
            lines.append(compare_line("onset, Ra", found, reference, "linear theory"))
    if deck.tilt == 0.0:
        equations = problem.make_first_equations()
        rest = solve_rest(equations, problem.fluid)
        rate = compute_growth(equations, problem.fluid, *rest)[0]
        theory = None
        if deck.shape == "layer":
            wavenumber = 2.0 * math.pi / problem.width
            numbers = deck.rayleigh, deck.prandtl, wavenumber, deck.walls == "free"
            theory = compute_layer_growth(*numbers)
        words = "linear theory, one roll pair"
        lines.append(compare_line("growth rate, eigenvalue", rate, theory, words))
        energy = np.asarray(history["kinetic_energy"])
        seen, _ = measure_growth(np.asarray(history["t"]), energy)
        if energy[0] < STILL * deck.amplitude**2:
            lines.append("  (the disturbance that decays most slowly is heat alone: nothing moves)")
        elif math.isfinite(seen):
            lines.append(compare_line("growth rate, in time", seen, rate, "the eigenvalue"))
    lines.append(f"  {'Nu, floor and ceiling':26} {history['nusselt'][-1]:9.5f}")
    lines[-1] += f"  {history['nusselt_top'][-1]:9.5f}"
    lines.append(
        f"  volume lost in a cell, over the largest flux: {history['mass_residual'][-1]:.1e}"
    )
    return "\n".join(lines)


def compare_line(words: str, found: float, reference: float | None, source: str) -> str:
    """One row of a table."""
    line = f"  {words:26} {found:9.6g}"
    if reference is None:
        return line
    return f"{line}  {reference:9.6g} {found / reference - 1.0:+10.3%}   {source}"
