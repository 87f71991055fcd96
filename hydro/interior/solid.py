"""Arrays of a solid's stress that the flow's kernels read and fill, besides those of fluids."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

NO_SHEAR = np.zeros((1, 1))  # stands for the shear modulus of a fluid's cells


class SolidArrays(NamedTuple):
    """Of a block of ni × nj cells; filled by `hydro.strength`, but for the speeds.

    shear (ni, nj): modulus G [Pa]; shear_wave (ni, nj): what it adds to c², 4/3 G/rho [m²/s²]; pull
    (2, ni, nj): force per volume of the deviatoric stress, its divergence [N/m³]; hoop (2, ni, nj),
    axisymmetric: s_rr - s_tt and s_tt at mid-time [Pa].  stress_i (4, ni + 1, nj), stress_j (4, ni,
    nj + 1): s_nn and s_nt on the faces inside, as the cells before have it, then those after.
    speed_i (2, ni + 1, nj), speed_j (2, ni, nj + 1): velocity of the contacts at the faces [m/s],
    which the update fills inside.
    """

    shear: np.ndarray
    shear_wave: np.ndarray
    pull: np.ndarray
    hoop: np.ndarray
    stress_i: np.ndarray
    stress_j: np.ndarray
    speed_i: np.ndarray
    speed_j: np.ndarray


def make_solid_arrays(ni: int, nj: int) -> SolidArrays:
    """Arrays for a block without stress and without a shear modulus."""
    return SolidArrays(
        shear=np.zeros((ni, nj)),
        shear_wave=np.zeros((ni, nj)),
        pull=np.zeros((2, ni, nj)),
        hoop=np.zeros((2, ni, nj)),
        stress_i=np.zeros((4, ni + 1, nj)),
        stress_j=np.zeros((4, ni, nj + 1)),
        speed_i=np.zeros((2, ni + 1, nj)),
        speed_j=np.zeros((2, ni, nj + 1)),
    )
