"""The pressure behind a running contact point A: the plateau found in the data, or none.

Nothing but A's path sets a length in the flow around A, so pressures at equal parts of the path
behind A are compared: in every step on a fixed set of parts, then over all steps.  From A
backwards there come

1. the numerical rise and its ringing, as many faces long in any cells: left out of every step;
2. the plateau, the zone of constant states that only A has seen;
3. the fall, where sound from elsewhere (the wedge's edge, the plate's back) has come.

Near the critical angle there is no plateau: the fall begins at A.  Then the line of the fall is
continued to A.  Note: behind the rise the scheme's own crest and dip are a few faces long
each, and a mean over so few faces may pass for a plateau of the wrong pressure.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

# thousandths of A's path behind A between which pressures are averaged
EDGES = (*range(10, 100, 10), 100, 125, 150, 175, 200, 250, 300, 350, 400, 450, 500)
COLUMNS = tuple(f"behind_{edge}" for edge in EDGES[:-1])
RISEN = 0.9  # of the faces behind it: there the numerical rise is over
NEXT = 8  # faces behind a face that say what it rises to
RINGING = 4  # faces from there on that belong to its crest and dip
REFINED_RINGING = 5  # the same where cells at A are refined: rows are so by less than the faces
SEEN = 0.1  # of all steps: a part seen in fewer is left out
LEAST_RATIO = 2.5  # of a plateau's two ends' distances from A: a shorter one is chance
SUBSONIC = 0.12  # below Mach 1 from which on the pressure is taken to fall from A on
LEAST_MISFIT = 1e-7  # relative to p², so that two good fits count alike
FALLEN = 0.88  # of the highest pressure: so far the line of the fall is followed
LEAST_PARTS = 3  # that a fit needs
FARTHEST = 0.15  # of A's path: where the profile has to begin at the latest
BENDS = 40  # places of the bend that are tried


@dataclass(frozen=True)
class Plateau:
    """What was found behind A.

    - `p`: pressure behind A, Pa: mean of the plateau, or the fall continued to A; NaN where
      hardly a part lies behind the numerical rise;
    - `scatter`: root mean square of the pressures about the plateau or the fall, over p;
    - `start`, `end`: parts of A's path behind A of the plateau, or of the fall used;
    - `flat`: is it a plateau?
    - `fall`: by how much the pressure is less at `end` than at A, over p; 0 of a plateau.
    """

    p: float
    scatter: float
    start: float
    end: float
    flat: bool
    fall: float


NOTHING = Plateau(math.nan, math.nan, math.nan, math.nan, False, math.nan)


def measure_profile(
    arc: np.ndarray, p: np.ndarray, path: float, ringing: int = RINGING
) -> np.ndarray:
    """Mean pressures (len(COLUMNS),) between the parts EDGES of A's `path` behind A.

    `arc` (n + 1,): distances of the contact's nodes from A; `p` (n,): pressures of the faces
    between them; `ringing`: faces behind the rise that are left out.  NaN where the numerical rise
    and its ringing reach or the contact ends.
    """
    means = np.full(len(COLUMNS), math.nan)
    for k in range(p.size - NEXT):
        if p[k] >= RISEN * np.median(p[k + 1 : k + 1 + NEXT]):
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
    known = np.flatnonzero(seen.sum(axis=0) > SEEN * max(len(profiles), 1))
    edges = 1e-3 * np.array(EDGES)
    if known.size < LEAST_PARTS or (np.diff(known) > 1).any() or edges[known[0]] > FARTHEST:
        return NOTHING
    low, high = edges[:-1][known], edges[1:][known]
    profiles = profiles[:, known]
    p = np.nanmean(profiles, axis=0)
    fallen = np.flatnonzero((p < FALLEN * p.max()) & (np.arange(p.size) > p.argmax()))
    count = max(int(fallen[0]) if fallen.size else p.size, LEAST_PARTS)
    x, width = 0.5 * (low + high)[:count], (high - low)[:count]
    broken, bend = _fit_broken_line(x, p[:count], width)
    curved = _fit_parabola(x, p[:count], width)
    flat = int(np.searchsorted(x, bend))
    if broken.misfit < curved.misfit and bend > LEAST_RATIO * low[0]:
        weight = width[:flat]
        level = float(p[:flat] @ weight / weight.sum())
        miss = profiles[:, :flat] / level - 1.0
        end = float(high[flat - 1])
        return Plateau(level, _measure_scatter(miss), float(low[0]), end, True, 0.0)
    share = min(max((1.0 - mach) / SUBSONIC, 0.0), 1.0)
    level = (1.0 - share) * broken.level + share * curved.level
    fit = (1.0 - share) * broken.values + share * curved.values
    miss = (profiles[:, :count] - fit) / level
    end, fall = float(high[count - 1]), 1.0 - float(fit[-1]) / level
    return Plateau(level, _measure_scatter(miss), float(low[0]), end, False, fall)


def _measure_scatter(miss: np.ndarray) -> float:
    return math.sqrt(float(np.nanmean(miss * miss)))


class _Fit(NamedTuple):
    """A curve through the parts: its value at A, its values at them, its weighted misfit."""

    level: float
    values: np.ndarray
    misfit: float


def _fit(basis: np.ndarray, p: np.ndarray, width: np.ndarray) -> _Fit | None:
    """The nearest sum of a constant and the rows of `basis`; None where it rises from A on."""
    columns, root = np.vstack((np.ones_like(p), basis)), np.sqrt(width / width.sum())
    factors, *_ = np.linalg.lstsq((columns * root).T, p * root)
    if factors[1] > 0.0:
        return None
    values = factors @ columns
    misfit = float(((p - values) * root) @ ((p - values) * root))
    return _Fit(float(factors[0]), values, misfit + LEAST_MISFIT * float(p.max()) ** 2)


def _fit_level(p: np.ndarray, width: np.ndarray) -> _Fit:
    level = float(p @ width / width.sum())
    misfit = float((p - level) ** 2 @ width / width.sum())
    return _Fit(level, np.full_like(p, level), misfit + LEAST_MISFIT * level**2)


def _fit_broken_line(x, p, width) -> tuple[_Fit, float]:
    """Flat as far as a bend, straight from there; also the bend, of all that are tried the best."""
    best, place = _fit_level(p, width), float("inf")
    for bend in np.linspace(x[1], x[-1], BENDS + 1)[:-1]:  # nearer to A none can be seen
        found = _fit(np.maximum(0.0, x - bend)[None], p, width)
        if found is not None and found.misfit < best.misfit:
            best, place = found, float(bend)
    return best, place


def _fit_parabola(x, p, width) -> _Fit:
    """A parabola that falls from A on and ever steeper; else a straight line, or a level one.

    Steeper towards A would be the crest of the numerical rise, continued.
    """
    found = _fit(np.array([x, x * x]), p, width) if x.size > LEAST_PARTS else None
    if found is not None and np.interp(0.5 * (x[0] + x[-1]), x, found.values) > 0.5 * (
        found.values[0] + found.values[-1]
    ):
        return found
    steep, level = _fit(x[None], p, width), _fit((x * x)[None], p, width)
    if steep is None or level is None:
        return _fit_level(p, width)
    return min(steep, level, key=lambda fit: fit.misfit)
