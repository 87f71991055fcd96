"""A grid marched without flow: a named domain bends step by step, and a regridder follows.

This problem is for work on regridders.  The shapes are those of `regrid.domains` (tongues, a
100:1 strip, a pinched jet, a shifted rectangle, ...); `cells_a_step` says how far the fastest
boundary node goes in one step, `noise` shakes the deforming sides by fresh random normal
displacements every step.  Time runs from 0 to 1 over the whole motion.

The closing table gives the worst of every step: first line gap (distance of the first grid line
from a deforming side over that of the quasi-1D grid), aspect ratio, scaled Jacobian (the smallest
sine of a corner), node speeds, and what the regridder did.  Note: a march ends with the first step
that has no valid grid, so look at the number of steps before comparing the rest.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from typing import Literal

import numpy as np

from shockgrid.problems.deck import Deck, Regrid, RunControl, key
from shockgrid.problems.problem import Problem
from shockgrid.problems.report import Report, Row
from shockgrid.regrid.domains import DOMAINS, MovingDomain, make_domain
from shockgrid.regrid.errors import RegridFailure
from shockgrid.regrid.measure.quality import (
    compute_aspect_ratio,
    compute_scaled_jacobians,
    measure_first_line_gap,
    measure_quality,
)
from shockgrid.regrid.node_speeds import measure_node_speeds
from shockgrid.regrid.protocol import call_regridder
from shockgrid.regrid.sides import get_side

DomainName = Literal[tuple(DOMAINS)]
NUMBERS = {  # of all steps: label, what of the column, what is wanted
    "bad_cells": ("bad cells in any step", np.max, 0.0),
    "regrid_sub_moves": ("sub-moves", np.sum, math.nan),
    "regrid_rescues": ("untangling events", np.sum, math.nan),
    "first_line_gap": ("largest first line gap", np.max, 1.0),
    "worst_aspect": ("worst aspect ratio", np.max, math.nan),
    "least_scaled_jacobian": ("min. scaled Jacobian", np.min, math.nan),
    "node_speed_ratio": ("node speed ratio, at most 1 wanted", np.max, math.nan),
    "regrid_iterations": ("iterations per step", np.mean, math.nan),
    "far_line_bend": ("far lines from straight [cells]", np.max, math.nan),
    "shift_error": ("error of the shift [cells]", np.max, math.nan),
}
REPORTED = "iterations node_iterations sub_moves rescues least_corner_ratio residual".split()
FAR_HEIGHT = 5.0  # of the strip's widths: lines beyond are to stay straight


class GridMarchDeck(Deck, kw_only=True):
    """A domain, its cells, how fast and how rough its motion is, and the regridder."""

    run: RunControl = RunControl(t_end=1.0)
    domain: key(DomainName, "shape of the domain and its motion") = "three_fingers"
    ni: key(int, "cells away from the deforming side", ge=2, le=4000) = 60
    nj: key(int, "cells along the deforming side", ge=2, le=4000) = 40
    transposed: key(bool, "exchange i and j, x and y") = False
    cells_a_step: key(float, "cells that the fastest node goes in a step", gt=0, le=1e9) = 0.5
    noise: key(float, "normal noise of deforming sides, in node spacings (std)", ge=0, le=0.5) = 0.0
    seed: key(int, "seed of the noise", ge=0, le=2**63 - 1) = 0
    regrid: Regrid = Regrid()


class GridBlock:
    """The marched grid as pictures see it."""

    name = "grid"
    long_names: Mapping[str, str] = {
        "scaled_jacobian": "scaled Jacobian",
        "aspect_ratio": "aspect ratio",
    }
    units: Mapping[str, str] = dict.fromkeys(long_names, "1")

    def __init__(self, nodes: np.ndarray):
        self.nodes = nodes

    @property
    def cell_fields(self) -> dict[str, np.ndarray]:
        least = compute_scaled_jacobians(self.nodes).min(axis=0)
        return {"scaled_jacobian": least, "aspect_ratio": compute_aspect_ratio(self.nodes)}


def shake_side(line: np.ndarray, noise: float, random: np.random.Generator) -> None:
    """Move inner nodes of a line along its normals, by `noise` of the shorter step beside each."""
    tangent = line[:, 2:] - line[:, :-2]
    normal = np.array([-tangent[1], tangent[0]]) / np.hypot(*tangent)
    spacing = np.hypot(*np.diff(line, axis=1))
    size = noise * np.minimum(spacing[1:], spacing[:-1]) * random.normal(size=spacing.size - 1)
    line[:, 1:-1] += size * normal


class GridMarch(Problem):
    """The problem; also makes the steps' boundaries, which tests and benchmarks use."""

    Deck = GridMarchDeck
    counted = ("ni", "nj")

    def __init__(self, deck: GridMarchDeck):
        super().__init__(deck)
        deck.regrid.check_weight(())
        self.check_end(1.0, "the motion is at its end")

    def make_domain(self) -> MovingDomain:
        domain = make_domain(self.deck.domain, self.deck.ni, self.deck.nj)
        return domain.transposed() if self.deck.transposed else domain

    def build(self) -> GridMarchEvolution:
        return GridMarchEvolution(self.deck, self.make_domain())

    def measure(self, evolution: GridMarchEvolution) -> dict[str, float]:
        nodes = evolution.nodes
        domain = evolution.domain
        if self.deck.domain == "strip":
            return {"far_line_bend": measure_far_bend(nodes, domain)}
        if self.deck.domain == "rectangle_shift" and self.deck.noise == 0.0:
            exact = domain.start + (nodes - domain.start)[:, :1, :1]
            return {"shift_error": float(np.abs(nodes - exact).max() / domain.cell)}
        return {}

    def report(self, run) -> Report:
        deck = self.deck
        rows = []
        steps = np.isfinite(run.history["dt"])
        made = {name: values[steps] for name, values in run.history.items()}
        if not steps.any():
            return Report("no step was made" if run.begun else "")
        for name, (label, reduce, wanted) in NUMBERS.items():
            if name in made:
                value = float(reduce(made[name]))
                rows.append(Row(name, value, wanted, label, digits=4, off=" "))
        inner = (deck.ni - 1) * (deck.nj - 1)
        cost = 1e6 * float(np.median(made["seconds_regrid"])) / inner
        rows.append(Row("cost", cost, label="cost per node and step, median [µs]", digits=4))
        method = f" ({deck.regrid.method})" if deck.regrid.name.startswith("barrier") else ""
        head = (
            f"{deck.domain} {deck.ni} x {deck.nj}, regridder {deck.regrid.name}{method}: "
            f"{len(made['t'])} steps of {deck.cells_a_step:g} cells, to "
            f"{100.0 * made['t'][-1]:.0f} % of the motion; theory is the quasi-1D grid's"
        )
        return Report(head, rows)


class GridMarchEvolution:
    """One block whose boundary follows the domain; time is the part of the motion done."""

    def __init__(self, deck: GridMarchDeck, domain: MovingDomain):
        self.deck = deck
        self.domain = domain
        self.t = 0.0
        self.step = 0
        self.t_end = deck.run.t_end or 1.0
        self.steps = domain.steps_for(deck.cells_a_step)
        self.nodes = domain.start.copy()
        self.regridder = deck.regrid.make(threads=deck.run.threads)
        self.blocks = [GridBlock(self.nodes)]

    @property
    def finished(self) -> str | None:
        return "t_end reached" if self.t >= self.t_end else None

    def make_boundary(self, step: int) -> np.ndarray:
        """Sides after `step` steps; the noise is a function of seed and step alone."""
        boundary = self.domain.boundary(step / self.steps)
        if self.deck.noise > 0.0:
            random = np.random.default_rng([self.deck.seed, step])
            for side in self.domain.deforming_sides:
                shake_side(get_side(boundary, side), self.deck.noise, random)
        return boundary

    def start_row(self) -> dict[str, float]:
        return self._measure()

    def advance(self) -> dict[str, float | int | str]:
        boundary = self.make_boundary(self.step + 1)
        begun = time.perf_counter()
        try:
            result = call_regridder(self.regridder, self.nodes, boundary)
        except RegridFailure as failure:
            where = f"t = {self.t:.4g} (step {self.step + 1} of {self.steps})"
            names = "side", "nodes", "grid", "cell", "cause"
            known = {name: getattr(failure, name) for name in names}
            raise RegridFailure(f"{failure.what}, {where}", block="grid", **known) from failure
        nodes = result.nodes
        seconds = time.perf_counter() - begun
        ratio = measure_node_speeds(self.nodes, nodes).ratio
        self.nodes = self.blocks[0].nodes = nodes
        self.step += 1
        last = self.t
        self.t = 1.0 if self.step >= self.steps else self.step / self.steps
        return {
            "t": self.t,
            "dt": self.t - last,
            "dt_limit": "march",
            **self._measure(),
            "node_speed_ratio": min(ratio, 1e300),
            **{f"regrid_{name}": getattr(result.report, name) for name in REPORTED},
            "regrid_limited_nodes": result.report.limited_nodes,
            "seconds_regrid": seconds,
        }

    def _measure(self) -> dict[str, float]:
        quality = measure_quality(self.nodes)
        sides = self.domain.deforming_sides
        return {
            "least_scaled_jacobian": quality.least_scaled_jacobian,
            "worst_aspect": quality.worst_aspect_ratio,
            "worst_skew": quality.worst_skew,
            "least_corner_area": quality.least_corner_area,
            "bad_cells": quality.bad_cells,
            "first_line_gap": max(measure_first_line_gap(self.nodes, side) for side in sides),
        }

    def get_state(self) -> dict[str, np.ndarray | float | int]:
        return {"t": self.t, "step": self.step, "nodes": self.nodes}

    def set_state(self, state) -> None:
        self.t = float(state["t"])
        self.step = int(state["step"])
        self.nodes = self.blocks[0].nodes = np.array(state["nodes"], dtype=np.float64)


def measure_far_bend(nodes: np.ndarray, domain: MovingDomain) -> float:
    """How far the strip's lines j = const, beyond 5 widths, are from straight, in cell widths.

    The lines i = const cannot be: on the quasi-1D grid itself they carry the interface's shape,
    fading in proportion to the distance from the far end.
    """
    turned = nodes if domain.deforming_sides[0][0] == "i" else nodes[::-1].transpose(0, 2, 1)
    x, y = turned
    first = int(np.argmax(y.min(axis=1) > FAR_HEIGHT))
    part = (y[first:] - y[first]) / (y[-1] - y[first])
    straight = x[first] + part * (x[-1] - x[first])
    return float(np.abs(x[first:] - straight).max() * domain.start.shape[2])
