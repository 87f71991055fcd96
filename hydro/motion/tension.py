"""Surface tension of moving lines: a jump of the pressure across them, and a tangential force.

The tension pulls on each face at its two end nodes, along the tangents t there,

    F = tension × (t_b - t_a),     theory F14.1

so that what pulls one face pulls the next the other way, and over a closed line nothing is left.
The part of F across the face is the jump of the pressure of the contact states; the rest, which
vanishes on a circle, pulls on the material of both sides by their densities.  Tangents are those
of the circle through a node and two others, so that on circles (in axisymmetric flow on spheres)
the jump is that of Laplace on every face, however the nodes are spaced.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shockgrid.hydro.block import Block
from shockgrid.hydro.boundary import Segment
from shockgrid.hydro.links import Exchange
from shockgrid.hydro.motion.grid_motion import GridMotion
from shockgrid.hydro.motion.line import Line
from shockgrid.hydro.rim import AREA, TRACTION
from shockgrid.hydro.rows import RHO
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.sides import get_side

TINY_LENGTH = 1e-300  # keeps a line that turns back on itself from dividing by zero


def compute_tangents(line: np.ndarray) -> np.ndarray:
    """Unit tangents (2, n) of a line (2, n + 4) of nodes with two images beyond each end.

    Those of the circles through three nodes, one and two away, put together so that they are of
    fourth order on even spacing.  Theory F14.2.
    """
    near = _find_tangents(line[:, 1:-3], line[:, 2:-2], line[:, 3:-1])
    far = _find_tangents(line[:, :-4], line[:, 2:-2], line[:, 4:])
    return _normalise(4.0 * near - far)


def _find_tangents(before: np.ndarray, here: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Unit tangents in the points `here` of the circles through three points each, (2, n) all."""
    step_before, step_after = here - before, after - here
    square_before = _square(step_before)
    square_after = _square(step_after)
    return _normalise(square_after * step_before + square_before * step_after)


def _square(vectors: np.ndarray) -> np.ndarray:
    return vectors[0] * vectors[0] + vectors[1] * vectors[1]


def _normalise(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.sqrt(_square(vectors) + TINY_LENGTH)


@dataclass
class TenseLine:
    """A line under tension, the sides that it acts on, and its forces on their faces.

    `sides`: the segment that has the line and, at an interface, its partner; `orders`: of their
    faces against the line's.
    """

    line: Line
    sides: list[Segment]
    orders: list[int]

    @property
    def tension(self) -> float:
        """Surface tension [N/m]."""
        return self.line.segment.tension


class SurfaceTension:
    """All lines under tension of a simulation."""

    def __init__(self, blocks: list[Block], exchange: Exchange, motion: GridMotion):
        self.curved = blocks[0].geometry.curved
        for block in blocks:
            for segment in block.segments:
                if segment.tension > 0.0 and motion.mesh != "regrid":
                    raise BadInput(
                        f"{segment}: surface tension acts on lines that the flow moves; it needs "
                        "mesh 'regrid'"
                    )
        partners = {id(link.leader): link for link in exchange.links}
        self.lines: list[TenseLine] = []
        for line in motion.sides.lines:
            if line.segment.tension == 0.0:
                continue
            sides = [line.segment]
            orders = [1]
            if link := partners.get(id(line.segment)):
                sides = [link.leader, link.follower]
                orders = [1, -1 if link.reverse else 1]
            self.lines.append(TenseLine(line, sides, orders))

    def fill_ghosts(self, t: float, dt: float) -> None:
        """The jumps of the pressure on the faces of the old nodes."""
        for tense in self.lines:
            self._fill_jump(tense, tense.line.extend())

    def fill_speeds(self, t: float, dt: float) -> None:
        """Nothing: contact speeds follow from the jumps of the old nodes."""

    def fill_fluxes(self, t: float, dt: float) -> None:
        """The pressure jumps on the mid-time faces, and the tangential forces as tractions."""
        for tense in self.lines:
            old = tense.line.extend().copy()
            tangential_force = self._fill_jump(tense, 0.5 * (old + tense.line.extend(new=True)))
            densities = [
                side.rim.rho_trace[::order]
                for side, order in zip(tense.sides, tense.orders, strict=True)
            ]
            total = sum(densities)
            for side, order, rho in zip(tense.sides, tense.orders, densities, strict=True):
                side.rim.rows[TRACTION] = (rho / total * tangential_force)[:, ::order]

    def _fill_jump(self, tense: TenseLine, line: np.ndarray) -> np.ndarray:
        """Write the pressure jumps on the faces between the nodes `line`; returns the other forces.

        These are the tangential ones, (2, n).  Theory F14.3.
        """
        force = tense.tension * self._compute_force(line)
        area = tense.sides[0].rim.rows[AREA]
        jump = -(force * area).sum(axis=0) / _square(area)
        for side, order, sign in zip(tense.sides, tense.orders, (1.0, -1.0), strict=False):
            side.rim.jump[:] = sign * jump[::order]
        return force + jump * area

    def _compute_force(self, line: np.ndarray) -> np.ndarray:
        """Forces (2, n) on a line's faces at tension 1; (2, n + 5) nodes.  Theory F14.1, F14.4."""
        tangents = compute_tangents(line)
        nodes = line[:, 2:-2]
        if not self.curved:
            return tangents[:, 1:] - tangents[:, :-1]
        pull = nodes[1] * tangents
        force = pull[:, 1:] - pull[:, :-1]
        steps = nodes[:, 1:] - nodes[:, :-1]
        mean = 0.5 * (tangents[:, 1:] + tangents[:, :-1])
        force[1] -= (steps * mean).sum(axis=0)  # the tension around the axis
        return force

    def find_step(self) -> float:
        """The step [s] that the shortest capillary waves allow: theory F14.5; inf without any."""
        step = math.inf
        for tense in self.lines:
            lead = tense.line.segment
            nodes = lead.line(lead.block.nodes)
            square = _square(nodes[:, 1:] - nodes[:, :-1])
            rho = sum(
                _take_density(side)[::order]
                for side, order in zip(tense.sides, tense.orders, strict=True)
            )
            least_inertia = float((rho * square * np.sqrt(square)).min())
            step = min(step, math.sqrt(least_inertia / (4.0 * math.pi * tense.tension)))
        return step

    def compute_energy(self) -> float:
        """Tension times length [J/m], in axisymmetric flow times area per radian [J]."""
        energy = 0.0
        for tense in self.lines:
            segment = tense.line.segment
            nodes = segment.line(segment.block.nodes)
            size = np.sqrt(_square(nodes[:, 1:] - nodes[:, :-1]))
            if self.curved:
                size *= 0.5 * (nodes[1, 1:] + nodes[1, :-1])
            energy += tense.tension * float(size.sum())
        return energy


def _take_density(segment: Segment) -> np.ndarray:
    """Densities (n,) of the cells along a segment."""
    cells = segment.block.state[RHO : RHO + 1, 1:-1, 1:-1]
    return get_side(cells, segment.side)[0, segment.start : segment.stop]
