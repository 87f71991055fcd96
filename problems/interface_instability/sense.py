"""Decks of interface-instability whose keys are each allowed and together make no sense.

A wave needs cells to grow with: in a run that begins after the shock's passage it has .94 of the
growth of linear theory with 16, .7 with 8, .2 with 4, and with 2, where its nodes are its crests
alone, none.  Between walls, which are
mirrors, a line meets the wall at a right angle, or its mirror image makes a kink there; between
periodic sides a whole number of waves fits.

The trap: a mode of ka0 = 0 is no wave, and may have any number and phase.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from problems.interface_instability.deck import InterfaceDeck
from problems.interface_instability.modes import Mode
from regrid.errors import BadInput

LEAST_CELLS = 3  # in a wave: with fewer it hardly grows
SQUARE = 2e-3  # most slope of a wave at a wall, over its largest: a phase of 3.14 is one of pi
FLATTEST = 4.0  # of first cells at the interface: one side over the other
LONGEST = 1e4  # wavelengths in a length
DENSEST = 1e6  # most ratio of densities


def check_sense(deck: InterfaceDeck, rho: tuple[float, float], drawn: Iterable[Mode]) -> None:
    """Raise BadInput with a sentence about each key that makes no sense beside the others.

    rho: densities of the two materials [kg/m3]; drawn: the modes of the deck's spectrum.
    """
    named = [(f"modes.{place}", mode) for place, mode in enumerate(deck.modes)]
    waves = [(name, mode) for name, mode in named if mode.ka0]
    told = [*_tell_cells(deck, waves), *_tell_fit(deck, waves, list(drawn))]
    told += [*_tell_aspect(deck), *_tell_sizes(deck, rho)]
    if told:
        raise BadInput("\n".join(f"deck: {sentence}" for sentence in dict.fromkeys(told)))


def _tell_cells(deck: InterfaceDeck, waves: list[tuple[str, Mode]]) -> Iterator[str]:
    for name, mode in waves:
        if LEAST_CELLS * mode.number > deck.cells:
            share = deck.cells / mode.number
            yield (
                f"{name}.number is {mode.number}, of which a wave has {share:.3g} cells (cells = "
                f"{deck.cells} a wavelength); waves of fewer than {LEAST_CELLS} hardly grow: "
                f"take a number up to {deck.cells // LEAST_CELLS}, or cells = "
                f"{LEAST_CELLS * mode.number}"
            )


def _tell_fit(
    deck: InterfaceDeck, waves: list[tuple[str, Mode]], drawn: list[Mode]
) -> Iterator[str]:
    """Whether waves fit into the width, and stand square on walls."""
    walls = deck.sides == "wall"
    piece = 0.5 if walls else 1.0  # of a wave
    what = "halves of waves" if walls else "waves"
    for name, mode in waves:
        if walls and abs(math.sin(mode.phase)) > SQUARE:
            yield (
                f"{name}.phase is {mode.phase:g}; between walls the line has to meet them at a "
                "right angle, with phase 0 or 3.141592653589793; or take sides = 'periodic'"
            )
    for name, mode in [*waves, *(("spectrum", mode) for mode in drawn)]:
        count = mode.number * deck.width / piece
        if abs(math.sin(math.pi * count)) > SQUARE or round(count) < 1:
            right = max(1, round(count)) * piece / mode.number
            yield (
                f"width is {deck.width:g} wavelengths, which holds {count:.4g} {what} of mode "
                f"{mode.number} ({name}); it has to hold a whole number, such as width = "
                f"{right:.12g}"
            )
            return


def _tell_aspect(deck: InterfaceDeck) -> Iterator[str]:
    rows = max(2, round(deck.cells * deck.width))
    aspect = deck.width / rows * deck.cells
    if not 1.0 / FLATTEST <= aspect <= FLATTEST:
        yield (
            f"width is {deck.width:g} wavelengths: its {rows} rows are {aspect:.3g} times as high "
            f"as cells are long (cells = {deck.cells} a wavelength); take a width from "
            f"{2.0 / FLATTEST / deck.cells:.3g}, or more cells"
        )


def _tell_sizes(deck: InterfaceDeck, rho: tuple[float, float]) -> Iterator[str]:
    for place, length in enumerate(deck.lengths or ()):
        if length > LONGEST * deck.wavelength:
            yield (
                f"lengths.{place} is {length:g} m, {length / deck.wavelength:.3g} wavelengths; "
                f"take at most {LONGEST:g} wavelengths, {LONGEST * deck.wavelength:g} m"
            )
    ratio = rho[1] / rho[0]
    if not 1.0 / DENSEST <= ratio <= DENSEST:
        yield (
            f"the second material's density, {rho[1]:g} kg/m3, is {ratio:.3g} times the first's, "
            f"{rho[0]:g} kg/m3; the ratio has to lie between {1.0 / DENSEST:g} and {DENSEST:g} "
            "(first.rho, second.rho)"
        )
