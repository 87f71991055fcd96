"""The deck of interface-instability: materials, shocks, the line, what bounds it.

`check_sense` refuses keys that are each allowed and together make no sense.  A wave needs cells to
grow with: in a run that begins after the shock's passage it has 0.91 of the growth of linear theory
with 16, 0.66 with 8, 0.25 with 4, and with 2, where its nodes are its crests alone, none.  Between
walls, which are mirrors, a line meets the wall at a right angle, or its mirror image makes a kink
there; between periodic sides a whole number of waves fits.  A mode of ka0 = 0 is no wave, and may
have any number and phase.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import ClassVar, Literal

import msgspec

from shockgrid.problems.deck import (
    MOST_CELLS,
    DeckTable,
    Limiter,
    Regrid,
    RunControl,
    key,
    place_file,
)
from shockgrid.problems.initial_states import Fluid
from shockgrid.problems.interface_instability.line import Mode, Spectrum
from shockgrid.problems.solids import SolidDeck
from shockgrid.regrid.errors import BadInput

LONGEST_WAVELENGTHS = 1e4  # wavelengths in a length


class SecondShock(DeckTable, kw_only=True):
    """A stronger shock that follows the first."""

    pressure: key(float, "pressure behind it [Pa]", ge=1e-12, le=1e20)
    kct: key(float, "when the piston sends it: k c t after the first", ge=1e-12, le=1e9) = 6.0


class LineMotion(DeckTable, kw_only=True):
    """How the interface's nodes are re-spaced along it."""

    shape: key(Literal["spline", "chord"], "curve between nodes when re-spaced") = "spline"
    relax: key(float, "fraction of the way to the target spacing in a step", ge=0, le=1) = 0.02
    thickness: key(
        float | None, "smoothing length [m]. If left out: 0.75 of a cell", ge=0, le=1e12
    ) = None
    tension: key(float, "surface tension of the interface [N/m]", ge=0, le=1e20) = 0.0
    contact: key(
        Literal["sliding", "bonded"],
        "solids on both sides slip along each other, or stick together",
    ) = "sliding"


class InterfaceDeck(SolidDeck, kw_only=True):
    """Deck of `interface-instability`; the defaults are the 1:3 gas at Mach 1.5."""

    runtime = ("kct_end",)
    absent: ClassVar[dict[str, str | float]] = {"start": "incident", "passage_refinement": 1.0}
    overruled: ClassVar[dict[str, str]] = {"kct_end": "run.t_end"}

    run: RunControl = RunControl(cfl=0.8)
    first: Fluid = Fluid(rho=1.0)
    second: Fluid = Fluid(rho=3.0)
    pressure: key(float, "pressure ahead of the shock [Pa]", le=1e20) = 1.0
    mach: key(
        float | None, "Mach number. If left out: by shock_pressure, or 1.5", ge=1.001, le=1000
    ) = None
    shock_pressure: key(float | None, "behind the shock [Pa]", ge=1e-12, le=1e20) = None
    second_shock: SecondShock | None = None
    diffusion_thickness: key(
        float,
        "of a layer between the materials, in which the density is graded: jump of the density "
        "over its steepest gradient [m]; 0: none",
        ge=0,
        le=1e12,
    ) = 0.0
    wavelength: key(float, "2 pi / k [m]", ge=1e-12, le=1e12) = 1.0
    modes: key(list[Mode], "harmonics; [] for a spectrum or a line_file alone") = msgspec.field(
        default_factory=lambda: [Mode()]
    )
    spectrum: Spectrum | None = None
    line_file: key(
        str | None, "text file of a line, added to the modes: x and y, or x [m]", min_length=1
    ) = None
    line_curve: key(
        Literal["spline", "straight"], "between the points of a line_file: cubic spline or straight"
    ) = "spline"
    width: key(float, "width of the domain in wavelengths", ge=1e-12, le=LONGEST_WAVELENGTHS) = 0.5
    sides: key(Literal["wall", "periodic"], "what bounds the domain along the interface") = "wall"
    cells: key(int, "cells per wavelength", ge=4, le=MOST_CELLS) = 64
    refine: key(bool, "add grid lines where the interface grows long or bends") = False
    uniform: key(float, "evenly spaced zone on each side, in wavelengths", ge=0, le=1e4) = 1.0
    stretch: key(float, "growth of cells from one to the next beyond it", ge=1, le=1.5) = 1.01
    reach: key(float, "grid lines bend within so many wavelengths", ge=1e-12, le=1e4) = 0.1
    lengths: key(
        tuple[float, float] | None,
        "of both sides in metres, not wavelengths. If left out: so long that no reflection returns",
    ) = None
    start: key(
        Literal["auto", "crossed", "incident", "captured"],
        "crossed: the shock is beyond the interface; incident: before it; auto: beyond if it can; "
        "captured: as auto, with both materials on one grid",
    ) = "auto"
    handover: key(
        bool, "where the line can no longer be followed, go on with both materials on one grid"
    ) = False
    handover_kct: key(
        float | None, "k c t from which on both materials are on one grid", ge=-1e4, le=1e4
    ) = None
    handover_refinement: key(
        int | None,
        "how much finer the grid of both materials is where the line was. If left out: 2, and 1 "
        "for start captured",
        ge=1,
        le=16,
    ) = None
    layer: key(
        float | None,
        "start crossed: cells to the nearer wave. If left out: those of 3/16 of the shortest "
        "wavelength of the interface, at least 8 or a quarter of that wavelength",
        ge=3,
        le=1000,
    ) = None
    gap: key(float, "initial wavelengths from shock to interface", ge=0.01, le=20) = 0.3
    passage_refinement: key(
        float, "start incident: how much finer cells at the interface are at first", ge=1, le=64
    ) = 4.0
    kct_end: key(float, "end: k c t, c of the shocked second material", ge=1e-12, le=10000) = 30.0
    limiter: Limiter = "smooth-shear"
    line: LineMotion = LineMotion()
    regrid: Regrid = Regrid()

    def place_own_files(self, folder: Path, names: list[str]) -> InterfaceDeck:
        if self.line_file is None:
            return self
        names.append(place_file(self.line_file, folder))
        return msgspec.structs.replace(self, line_file=names[-1])


LEAST_WAVE_CELLS = 3  # in a wave: with fewer it hardly grows
# most slope of a wave at a wall, over its largest: a phase of 3.14 is one of pi
WALL_SLOPE_PART = 2e-3
MOST_CELL_RATIO = 4.0  # of first cells at the interface: one side over the other
MOST_DENSITY_RATIO = 1e6  # most ratio of densities


def check_sense(deck: InterfaceDeck, rho: tuple[float, float], drawn: Iterable[Mode]) -> None:
    """Raise BadInput with a sentence about each key that makes no sense beside the others.

    rho: densities of the two materials [kg/m3]; drawn: the modes of the deck's spectrum.
    """
    named = [(f"modes.{place}", mode) for place, mode in enumerate(deck.modes)]
    waves = [(name, mode) for name, mode in named if mode.ka0]
    faults = [*_list_wave_faults(deck, waves, drawn), *_list_size_faults(deck, rho)]
    if faults:
        raise BadInput("\n".join(f"deck: {sentence}" for sentence in dict.fromkeys(faults)))


def _list_wave_faults(
    deck: InterfaceDeck, waves: list[tuple[str, Mode]], drawn: Iterable[Mode]
) -> Iterator[str]:
    """Waves of too few cells, and whether waves fit into the width and stand square on walls."""
    for name, mode in waves:
        if LEAST_WAVE_CELLS * mode.number > deck.cells:
            share = deck.cells / mode.number
            most = deck.cells // LEAST_WAVE_CELLS
            least = LEAST_WAVE_CELLS * mode.number
            yield (
                f"{name}.number is {mode.number}: waves of {share:.3g} cells (fewer than "
                f"{LEAST_WAVE_CELLS}) hardly grow: take a number up to {most}, or cells = {least}"
            )
        if deck.sides == "wall" and abs(math.sin(mode.phase)) > WALL_SLOPE_PART:
            yield (
                f"{name}.phase is {mode.phase:g}; walls meet a line at a right angle, "
                "with phase 0 or 3.141592653589793; or take sides = 'periodic'"
            )
    piece, what = (0.5, "halves of waves") if deck.sides == "wall" else (1.0, "waves")
    for name, mode in [*waves, *(("spectrum", mode) for mode in drawn)]:
        count = mode.number * deck.width / piece
        if abs(math.sin(math.pi * count)) > WALL_SLOPE_PART or round(count) < 1:
            right = max(1, round(count)) * piece / mode.number
            yield (
                f"width is {deck.width:g} wavelengths, which holds {count:.4g} {what} of mode "
                f"{mode.number} ({name}); it must hold whole ones, such as width = {right:.12g}"
            )
            return


def _list_size_faults(deck: InterfaceDeck, rho: tuple[float, float]) -> Iterator[str]:
    """Cells far from square, lengths and densities out of all proportion."""
    rows = max(2, round(deck.cells * deck.width))
    aspect = deck.width / rows * deck.cells
    if not 1.0 / MOST_CELL_RATIO <= aspect <= MOST_CELL_RATIO:
        least = 2.0 / MOST_CELL_RATIO / deck.cells
        yield (
            f"width is {deck.width:g} wavelengths: its {rows} rows are {aspect:.3g} times as high "
            f"as cells are long; take a width from {least:.3g}, or more cells"
        )
    for place, length in enumerate(deck.lengths or ()):
        if length > LONGEST_WAVELENGTHS * deck.wavelength:
            longest = LONGEST_WAVELENGTHS * deck.wavelength
            most = f"take at most {LONGEST_WAVELENGTHS:g} wavelengths, {longest:g}"
            yield f"lengths.{place} is {length:g}, too long: {most}"
    ratio = rho[1] / rho[0]
    if not 1.0 / MOST_DENSITY_RATIO <= ratio <= MOST_DENSITY_RATIO:
        yield (
            f"the second material's density, {rho[1]:g}, is {ratio:.3g} times the first's; "
            f"that has to lie between {1.0 / MOST_DENSITY_RATIO:g} and {MOST_DENSITY_RATIO:g} "
            "(first.rho, second.rho)"
        )
