"""Blocks of `conical-target`, how they touch, and the ripple on the line between cone and lead.

The shell's front may be a disc that leaves a ring of lead at the impactor (`cover` less than
`radius`), or close the shell.  Of a sliding pair lead and graphite are leaders and steel follows;
on the cone's side lead is, at the impact face the impactor follows.  So where materials meet on a
line they are all on the leader's side.  Note: a corner of a block is an end of two contacts; the
one that moves it must be placed before the one that is laid on it.

The ripple is a wave along the cone's side that rises from nothing over one wave at either end, so
that the ends and the angles there stay.  The whole side bends while the shock runs along it and
after; therefore the amplitude is measured place by place (`fit_wave`), in windows that go with the
wave as it drifts after the shock's passage (`problems.references.shock_polars`).  Note: in a window
of one wavelength parabola and wave cannot be distinguished, and while the shock is within a window
the line has a kink there: the fit is meaningless.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from shockgrid.hydro.boundary import put
from shockgrid.hydro.links import join, slide
from shockgrid.problems.initial_states import make_plane_grid, put_walls
from shockgrid.problems.references.hugoniot import shock_to_pressure, shock_with_particle_speed
from shockgrid.problems.references.riemann import solve_riemann
from shockgrid.problems.references.shock_polars import Body, CrossedLine, cross_line
from shockgrid.regrid.errors import BadInput
from shockgrid.regrid.measure.quality import find_bad_cells

if TYPE_CHECKING:
    from shockgrid.hydro.block import Block


LEAST_RIPPLE_CELLS = 6  # a wave: the thickness of interfaces holds shorter ones back (theory F6.6)
FITTED_POINTS = 24  # between two nodes, in fits
COVERED_WINDOW_PART = 0.93  # of a window that the line has to fill


class SideFrame:
    """Places along the cone's first side and heights over it, towards the lead [m]."""

    def __init__(self, deck):
        self.start = np.array([deck.front, deck.base])
        way = np.array([deck.cone, deck.tip - deck.base])
        self.length = float(np.hypot(*way))
        self.along = way / self.length
        self.across = np.array([-self.along[1], self.along[0]])

    def measure(self, line: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Place and height (n,) of the points of a line (2, n)."""
        away = line - self.start[:, None]
        return self.along @ away, self.across @ away


class Ripple:
    """The ripple of a deck of `conical-target`; `materials`, `impact` as its problem has them."""

    def __init__(self, deck, materials: dict, impact: tuple[float, float, float]):
        self.deck = deck
        self.materials = materials
        self.impact = impact
        self.frame = SideFrame(deck)
        self.amplitude = deck.ripple_amplitude
        self.wavelength = deck.ripple_wavelength
        self.wavenumber = 2.0 * math.pi / self.wavelength
        length = self.frame.length
        self.cells_a_wave = deck.cells * deck.cone / deck.radius * self.wavelength / length
        if self and 3.0 * self.wavelength > length:
            raise deck.error(
                "ripple_wavelength",
                f"the cone's side, {length:.4g} m long, must have room for three waves",
            )

    def __bool__(self) -> bool:
        return self.amplitude > 0.0

    def compute_shift(self, line: np.ndarray) -> np.ndarray:
        """How far (2, n) [m] the nodes of the straight side (2, n) are moved by the ripple."""
        position = self.frame.measure(line)[0]
        inside = np.minimum(position, self.frame.length - position) / self.wavelength
        rise = np.sin(0.5 * math.pi * np.clip(inside, 0.0, 1.0)) ** 2
        wave = np.sin(self.wavenumber * position + self.deck.ripple_phase)
        return self.frame.across[:, None] * (self.amplitude * rise * wave)

    def check(self, cells: int, grids: dict[str, np.ndarray]) -> None:
        """Raise BadInput for waves of too few of the side's `cells`, or grids that they fold."""
        number = cells * self.wavelength / self.frame.length
        least = LEAST_RIPPLE_CELLS * self.frame.length / cells
        if number < LEAST_RIPPLE_CELLS:
            raise self.deck.error(
                "ripple_wavelength",
                f"that are {number:.3g} cells; give at least {least:.3g} m, or more `cells`",
            )
        bad = any(len(find_bad_cells(nodes)) for nodes in grids.values())
        if bad:
            raise self.deck.error(
                "ripple_amplitude",
                "cells beside the cone's side would not be convex; give a smaller one",
            )

    @cached_property
    def first_shock(self) -> tuple[float, float]:
        """When the plane shock reaches the cone's base [s], and its speed in it [m/s]."""
        shell = self.materials["shell"]
        filling = self.materials["filling"]
        p, u, arrival = self.impact
        in_shell = shock_to_pressure(shell.eos, shell.rho0, 0.0, p)
        base = solve_riemann(shell.eos, (in_shell.rho, u, p), filling.eos, (filling.rho0, 0.0, 0.0))
        in_cone = shock_with_particle_speed(filling.eos, filling.rho0, 0.0, base.u)
        return arrival, in_cone.shock_speed

    def cross(self, speed: float | None = None) -> CrossedLine | None:
        """Theory of the shock that passes the side at `speed` (None: of the plane shock).

        None where there is none: the shock does not lead in the cone.
        """
        filling = self.materials["filling"]
        target = self.materials["target"]
        speed = self.first_shock[1] / self.frame.along[0] if speed is None else speed
        try:
            return cross_line(Body(filling.eos, filling.rho0), Body(target.eos, target.rho0), speed)
        except BadInput:
            return None

    @cached_property
    def waves(self) -> np.ndarray:
        """Places (m,) along the side, a wavelength apart, where amplitudes are measured [m]."""
        count = int(self.frame.length / self.wavelength - 1.0 + 1e-9)
        spare = self.frame.length - (count - 1) * self.wavelength
        return 0.5 * spare + np.arange(count) * self.wavelength

    @cached_property
    def _passage(self) -> tuple[np.ndarray, float, float]:
        """When the plane shock is at the waves (m,), how fast they drift then, its speed there."""
        begin, speed = self.first_shock
        point = speed / self.frame.along[0]
        crossed = self.cross()
        return begin + self.waves / point, crossed.drift if crossed else 0.0, point

    def measure(self, line: np.ndarray, t: float) -> dict[str, float]:
        """Amplitude [m] of every wave of the side's line (2, n) at the time t [s]."""
        passed, drift, point = self._passage
        row = {}
        dense = densify(line)
        position, height = self.frame.measure(dense)
        for number, (middle, hit) in enumerate(zip(self.waves, passed, strict=True)):
            since = max(0.0, t - hit)
            length = self.wavelength * (1.0 - drift / point if since > 0.0 else 1.0)
            row[f"ripple_{number}"] = fit_wave(position, height, middle + drift * since, length)
        return row


def densify(line: np.ndarray) -> np.ndarray:
    """FITTED_POINTS times as many points (2, m) on the cubic spline through the line's nodes (2,
    n)."""
    arc = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(line, axis=1)))))
    fine = np.arange(FITTED_POINTS * (arc.size - 1) + 1) / FITTED_POINTS
    fine = np.interp(fine, np.arange(arc.size, dtype=float), arc)
    from scipy.interpolate import CubicSpline  # slow to load

    return CubicSpline(arc, line, axis=1)(fine)


def fit_wave(position: np.ndarray, height: np.ndarray, middle: float, length: float) -> float:
    """Amplitude of a wave of that length in a line (n,) around `middle`, beside a parabola.

    Least squares within a wavelength to either side, weighted by the line's steps and by
    cos²(pi (place - middle)/(2 length)); NaN where the line does not fill the window.
    """
    part = (position - middle) / length
    chosen = np.abs(part) <= 1.0
    if chosen.sum() < 5 * LEAST_RIPPLE_CELLS or np.ptp(part[chosen]) < 2.0 * COVERED_WINDOW_PART:
        return math.nan
    step = np.hypot(np.gradient(position), np.gradient(height))[chosen]
    part = part[chosen]
    weight = np.sqrt(step / step.sum()) * np.cos(0.5 * math.pi * part)
    angle = 2.0 * math.pi * part
    columns = np.array([np.ones(part.size), part, part**2, np.cos(angle), np.sin(angle)])
    found = np.linalg.lstsq((columns * weight).T, height[chosen] * weight, rcond=None)[0]
    return float(math.hypot(found[3], found[4]))


FEWEST_CELLS_THROUGH = 4  # through a part
MATERIALS = {
    "impactor": "impactor", "front": "shell", "ring": "target", "cone": "filling",
    "beside": "target", "behind": "target", "side": "shell",
}  # fmt: skip


class Layout:
    """Sizes, nodes and contacts of the blocks."""

    def __init__(self, deck, ripple: Ripple | None = None):
        self.deck = deck
        self.ripple = ripple
        self.open = deck.cover < deck.radius
        count = self.count_cells  # from the axis to the cone, to the front's rim, to the side
        self.within = count(deck.base)
        self.shell = count(deck.side)
        self.ring = count(deck.radius - deck.cover) if self.open else 0
        self.covered = max(FEWEST_CELLS_THROUGH, deck.cells - self.within - self.ring)
        self.inside = self.within + self.covered + self.ring
        self.impactor = count(deck.thickness)
        self.front = count(deck.front)
        self.along = count(deck.cone)
        self.behind = count(deck.length - deck.cone)

    def count_cells(self, length: float) -> int:
        """Cells along a part of that length [m], square ones where it is not very short."""
        return max(FEWEST_CELLS_THROUGH, round(length * self.deck.cells / self.deck.radius))

    def estimate_cells(self) -> int:
        """Cells of all blocks, by arithmetic alone."""
        wide = self.inside + self.shell
        deep = self.along + self.behind
        # the front as far as the shell's outside, or beside it the ring and the shell's side
        return (self.impactor + self.front + deep) * wide

    def make_grids(self) -> dict[str, np.ndarray]:
        """Nodes of the blocks at the impact."""
        deck = self.deck
        part = np.linspace(0, 1, self.within + 1)
        rim = (min(deck.cover, deck.radius) - deck.base) / (deck.radius - deck.base)
        part_beside = np.linspace(0, rim, self.covered + 1)
        if self.open:
            part_beside = np.append(part_beside, np.linspace(rim, 1, self.ring + 1)[1:])
        outside = np.linspace(deck.radius, deck.radius + deck.side, self.shell + 1)

        def radii(split):
            return np.concatenate((split * part, (split + (deck.radius - split) * part_beside)[1:]))

        impactor = np.linspace(-deck.thickness, 0, self.impactor + 1)
        before = np.linspace(0.0, deck.front, self.front + 1)
        along = np.linspace(deck.front, deck.front + deck.cone, self.along + 1)[:, None]
        behind = np.linspace(deck.front + deck.cone, deck.front + deck.length, self.behind + 1)
        deep = np.concatenate((before[: -1 if self.open else 0], along[:, 0], behind[1:]))
        edge = deck.base + (deck.tip - deck.base) * ((along - deck.front) / deck.cone)
        cone = np.array(np.broadcast_arrays(along, edge * part))
        beside = np.broadcast_arrays(along, edge + (deck.radius - edge) * part_beside)
        shift = self.ripple.compute_shift(cone[:, :, -1])[:, :, None] if self.ripple else 0.0
        whole = np.concatenate((radii(deck.base), outside[1:]))
        cut = self.within + self.covered if self.open else whole.size - 1
        grids = {
            "impactor": make_plane_grid(impactor, whole),
            "front": make_plane_grid(before, whole[: cut + 1]),
            "ring": make_plane_grid(before, whole[cut : self.inside + 1]),
            "cone": cone + shift * part,
            "beside": np.array(beside) + shift * (1.0 - part_beside),
            "behind": make_plane_grid(behind, radii(deck.tip)),
            "side": make_plane_grid(deep, outside),
        }
        return {name: nodes for name, nodes in grids.items() if self.open or name != "ring"}

    def connect(self, blocks: dict[str, Block]) -> list:
        """Links and contacts of all blocks, the walls, the axis and the free surface."""
        impactor = blocks["impactor"]
        front = blocks["front"]
        side = blocks["side"]
        cone = blocks["cone"]
        beside = blocks["beside"]
        behind = blocks["behind"]
        contact = self.deck.contact
        inner = self.within
        covered = self.covered
        links = [join("seam", (beside, "i_max"), (behind, "i_min", inner, self.inside))]
        links += touch(contact.cone, [(beside, "j_min")], (cone, "j_max"))
        links += touch("joined", [(cone, "i_max")], (behind, "i_min", 0, inner))
        under = [(cone, "i_min"), (beside, "i_min", 0, covered)]
        around = [(beside, "j_max"), (behind, "j_max")]
        face = [(front, "i_min")]
        if self.open:
            ring = blocks["ring"]
            links.append(join("seam", (ring, "i_max"), (beside, "i_min", covered, None)))
            links += touch(contact.front, under, (front, "i_max"))
            links += touch(contact.front, [(ring, "j_min")], (front, "j_max"))
            around = [(ring, "j_max"), *around]
            face = [*face, (ring, "i_min"), (side, "i_min")]
        else:
            cut = inner + covered
            links.append(join("seam", (front, "i_max", cut, front.nj), (side, "i_min")))
            links += touch(contact.front, under, (front, "i_max", 0, cut))
        links += touch(contact.side, around, (side, "j_min"))
        links += touch(contact.impactor, face, (impactor, "i_max"))
        put(impactor, "i_min", "free-surface")
        put_walls(*blocks.values(), curved=True)
        return links


def touch(how: str, carrying: list[tuple], following: tuple) -> list:
    """Links between places (block, side[, start, stop]) in order and the place along them all."""
    if how == "sliding":
        return [slide(carrying, following)]
    block, side, *span = following
    start = span[0] if span else 0
    links = []
    for faces in carrying:
        count = faces[3] - faces[2] if len(faces) > 2 else faces[0].side_faces(faces[1])[1]
        links.append(join("interface", faces, (block, side, start, start + count)))
        start += count
    return links
