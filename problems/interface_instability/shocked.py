"""What is known of a shocked interface before a run: all that theories, cautions and reports of it
need, none of which see the problem itself.
"""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from shockgrid.hydro.eos.base import EquationOfState
from shockgrid.problems.interface_instability.deck import InterfaceDeck
from shockgrid.problems.interface_instability.line import FileLine, Harmonic
from shockgrid.problems.references.hugoniot import Shock
from shockgrid.problems.references.linear_growth import LinearGrowth


class Echo(NamedTuple):
    """A wave back from a far end: t [s] at the earliest, speed [m/s] towards the interface."""

    t: float
    speed: float


@dataclass(frozen=True, eq=False)
class Shocked:
    """A shock and the line that it meets.

    first, second: equation of state and density [kg/m3] ahead of the shock; k: 2 pi / wavelength;
    amplitude: of the first line [m]; heights (n,) [m]: of its nodes; arrival, t_end [s]; echoes: by
    the block's name, none for two shocks, of which the second sends waves of its own.
    """

    deck: InterfaceDeck
    eos_first: EquationOfState
    eos_second: EquationOfState
    rho_first: float
    rho_second: float
    shock: Shock
    linear_growth: LinearGrowth
    k: float
    amplitude: float
    harmonics: Sequence[Harmonic]
    heights: np.ndarray
    file_line: FileLine | None
    arrival: float
    t_end: float
    echoes: Mapping[str, Echo]
    may_hand_over: bool

    @functools.cached_property
    def is_tube(self) -> bool:
        """Is the run to go on after its line, with ends that it was given: those of a tube?"""
        return self.may_hand_over and self.deck.lengths is not None
