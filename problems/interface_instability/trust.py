"""Where growth of a shocked interface is not to be trusted.

By a deck's place in what was measured, and by the roughness of the line in a run.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from hydro.eos import IdealGas
from problems.interface_instability.accuracy import ROUGH_LINE, sort_cautions
from problems.interface_instability.first_shape import caution_short_waves
from problems.interface_instability.theories import Growth, get_kct, is_still

FREE = 0.25  # phase of a capillary wave up to which its growth is within 1 % of that without


def find_cautions(problem, history: Mapping[str, np.ndarray] | None) -> list[str]:
    """Sentences for the deck of an `InterfaceInstability`; with a history, for the run as well."""
    told = _caution_deck(problem) if problem.harmonics else []
    told += _caution_echoes(problem) + _caution_tension(problem)
    if history is not None and problem.harmonics and problem.deck.second_shock is None:
        told += _caution_line(problem, history)
    return told


def _caution_echoes(problem) -> list[str]:
    """Waves that are back from the far ends before the run's end: the domain is too short."""
    if problem.deck.second_shock is not None:
        return []
    return [
        f"waves are back at the interface from the far end of the {name} material at t = "
        f"{t:.4g} s, k c t = {float(get_kct(problem, t)):.3g}, and the run ends at t = "
        f"{problem.t_end:.4g} s: what comes after is not the growth of an open interface; for that "
        "begin a new run with longer `lengths`, or without them and run.t_set_up"
        for name, t in problem.find_echoes().items()
        if t < problem.t_end
    ]


def _caution_tension(problem) -> list[str]:
    """Surface tension that changes growth before the run's end, and is not in any theory here."""
    tension, base = problem.deck.line.tension, problem.theory.base
    if not (tension and problem.harmonics):
        return []
    k = problem.harmonics[-1].number * problem.k
    omega = math.sqrt(tension * k**3 / (base.rho_left + base.rho_right))
    if omega * (problem.t_end - problem.arrival) < FREE:
        return []
    return [
        f"surface tension swings waves of mode {problem.harmonics[-1].number} with a period of "
        f"{2.0 * math.pi / omega:.3g} s; the theories of growth leave it out, and hold until "
        f"t = {problem.arrival + FREE / omega:.3g} s"
    ]


def list_wave_cautions(problem) -> list[str]:
    """Sentences on modes with few cells a wave."""
    return _sort_deck(problem)[0] if problem.harmonics else []


def _caution_deck(problem) -> list[str]:
    """By the shock's Mach number, the ratio of densities and the cells of the shortest mode."""
    of_cells, others = _sort_deck(problem)
    return of_cells + others


def _sort_deck(problem) -> tuple[list[str], list[str]]:
    """Of few cells a wave, and others."""
    gases = [isinstance(eos, IdealGas) for eos in (problem.eos_first, problem.eos_second)]
    materials = "gas" if all(gases) else "mixed" if any(gases) else "condensed"
    ahead = problem.eos_first.sound_speed(problem.rho_first, problem.deck.pressure)
    theory = problem.theory
    rate = theory.impulsive  # the scale alone: a check does not wait for the linear theory
    growth = 1.0 if is_still(theory, rate) else abs(rate / theory.base.u)
    short = caution_short_waves([m.number for m in problem.harmonics], problem.deck.cells)
    of_cells, others = sort_cautions(
        materials,
        problem.shock.shock_speed / float(ahead),
        problem.rho_second / problem.rho_first,
        problem.deck.cells / problem.harmonics[-1].number,
        growth=growth,
    )
    return short + of_cells, others


def _caution_line(problem, history) -> list[str]:
    """Waves of a few cells on the line, while theory says that it is gentle."""
    modes = [mode.column for mode in problem.harmonics if mode.column in history]
    if "roughness" not in history or not modes:  # of an earlier version
        return []
    growth = Growth(problem)
    kct = get_kct(problem, history["t"])
    gentle = (kct > 1.0) & (kct <= growth.linear_reach)
    if not gentle.any():
        return []
    rough = growth.scale_roughness(history)[gentle]
    last = float(rough[-1])
    if last <= ROUGH_LINE:
        return []
    return [
        f"the line is rough: harmonics above the fourth are {last:.2g} of the largest mode at "
        f"k c t = {kct[gentle][-1]:.3g}, and theory has next to none; try other or finer cells"
    ]
