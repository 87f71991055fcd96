"""Numbers to compare a convecting cavity with: steady states and onsets.

The square cavity with isothermal sides and adiabatic floor and ceiling, Pr = 0.71, in the scales L,
kappa/L, dT [DeVahlDavis1983]: computed independently by a spectral method at two resolutions, to
the digits given.  (The table of 1983 has Nu max at Ra = 1e6 2.2 % too high and ends there; at
1e7 the spectral benchmark of [LeQuere1991] has Nu = 16.523.)  Onsets: the Rayleigh numbers at
which a fluid heated from below begins to move, all walls no-slip.
"""

from __future__ import annotations

from dataclasses import dataclass

PRANDTL = 0.71


@dataclass(frozen=True)
class CavityState:
    """Steady state of the square cavity; places in units of its side."""

    nusselt: float  # mean over a side wall
    u_max: float  # greatest u on x = 1/2
    u_max_y: float
    v_max: float  # greatest v on y = 1/2
    v_max_x: float
    nusselt_max: float  # greatest local one on the hot wall
    nusselt_max_y: float


STATES: dict[float, CavityState] = {
    1e3: CavityState(1.117790, 3.649448, 0.81323, 3.697438, 0.17833, 1.506307, 0.08842),
    1e4: CavityState(2.244816, 16.18334, 0.82323, 19.62822, 0.11886, 3.531066, 0.14420),
    1e5: CavityState(4.521635, 34.74067, 0.85461, 68.63536, 0.065858, 7.72012, 0.08208),
    1e6: CavityState(8.825202, 64.8344, 0.84992, 220.5651, 0.037756, 17.5360, 0.03921),
    1e7: CavityState(16.52309, 148.5855, 0.87932, 699.330, 0.021300, 39.3947, 0.01796),
}

LAYER_ONSET = 1707.7618
LAYER_WAVENUMBER = 3.11632  # of the height
FREE_LAYER_ONSET = 657.51136  # 27 pi^4 / 4
FREE_LAYER_WAVENUMBER = 2.22144147  # pi / sqrt(2)
BOX_ONSETS = {"adiabatic": 2585.019, "conducting": 5011.71}  # square, by its sides
