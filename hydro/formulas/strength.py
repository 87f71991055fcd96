"""Stress of solids as parts of kernels: components along faces, shear waves, rotation, yield.

The deviatoric stress in the plane is (s_xx, s_yy, s_xy); across the plane it is
s_zz = -s_xx - s_yy, in axisymmetric flow the hoop stress.  Tension is positive.  A face has the
normal n and, along it, t = (-n_y, n_x): the stress on it is s_nn = n·s·n and s_nt = n·s·t.  From
the other side, with -n and -t, both are the same.  Theory F20.
"""

from __future__ import annotations

from shockgrid.regrid.jit import inlined

TINY_IMPEDANCE = 1e-300  # keeps 0/0 between two fluids from being a NaN
LONGITUDINAL_PART = 4.0 / 3.0  # rho c_l² = rho c² + 4 G / 3


@inlined
def add_shear_wave(c2, shear, rho):
    """c² of longitudinal waves [m²/s²], from that of sound in a fluid and the modulus G [Pa]."""
    return c2 + LONGITUDINAL_PART * shear / rho


@inlined
def compute_hoop_stress(s_xx, s_yy):
    """Deviatoric stress across the plane; the sum of all three is 0."""
    return -(s_xx + s_yy)


@inlined
def resolve_stress(s_xx, s_yy, s_xy, nx, ny):
    """s_nn, s_tt and s_nt of a stress, along the unit normal and along the face."""
    s_nn = (nx * nx) * s_xx + (ny * ny) * s_yy + 2.0 * (nx * ny) * s_xy
    s_nt = (nx * ny) * (s_yy - s_xx) + (nx * nx - ny * ny) * s_xy
    return s_nn, (s_xx + s_yy) - s_nn, s_nt


@inlined
def compose_stress(s_nn, s_tt, s_nt, nx, ny):
    """(s_xx, s_yy, s_xy) of the components that `resolve_stress` gives."""
    s_xx = (nx * nx) * s_nn + (ny * ny) * s_tt - 2.0 * (nx * ny) * s_nt
    s_xy = (nx * ny) * (s_nn - s_tt) + (nx * nx - ny * ny) * s_nt
    return s_xx, (s_nn + s_tt) - s_xx, s_xy


@inlined
def compute_shear_contact(left, right):
    """Shear stress and tangential speed between two states that stick together (theory F20.6).

    left, right: (z, speed, stress): impedance rho c_s of shear waves, speed along the face, s_nt.
    """
    z_l, speed_l, stress_l = left
    z_r, speed_r, stress_r = right
    inverse = 1.0 / (z_l + z_r + TINY_IMPEDANCE)
    stress = ((z_r * stress_l + z_l * stress_r) + (z_l * z_r) * (speed_r - speed_l)) * inverse
    return stress, ((z_l * speed_l + z_r * speed_r) + (stress_r - stress_l)) * inverse


@inlined
def turn_stress(s_xx, s_yy, s_xy, half_angle):
    """The stress after a rotation, exactly one [HughesWinget1980]; theory F20.9.

    half_angle: half of the vorticity's turn dt w, w = (dv/dx - du/dy)/2 [rad]; the turn is by
    2 atan(half_angle).
    """
    square = half_angle * half_angle
    inverse = 1.0 / (1.0 + square)
    cosine = (1.0 - square) * inverse
    sine = 2.0 * half_angle * inverse
    new_xx = (cosine * cosine) * s_xx + (sine * sine) * s_yy - 2.0 * (cosine * sine) * s_xy
    new_xy = (cosine * sine) * (s_xx - s_yy) + (cosine * cosine - sine * sine) * s_xy
    return new_xx, (s_xx + s_yy) - new_xx, new_xy


@inlined
def compute_equivalent(s_xx, s_yy, s_xy):
    """Equivalent stress (3/2 s:s)^(1/2) of von Mises [Pa]."""
    square = (s_xx * s_xx + s_yy * s_yy) + (s_xx * s_yy + s_xy * s_xy)
    return (3.0 * square) ** 0.5


@inlined
def return_to_yield(s_xx, s_yy, s_xy, shear, flow_stress, hardening):
    """Stress brought back to the yield surface along the radius, and the plastic strain for it.

    flow_stress: Y; hardening: dY/d(plastic strain) [Pa].  Theory F20.10 [Wilkins1964].  Without a
    shear modulus, as where it has melted, material bears no stress and strains no further.
    """
    equivalent = compute_equivalent(s_xx, s_yy, s_xy)
    excess = equivalent - flow_stress
    excess = excess if excess > 0.0 else 0.0
    strain = excess / (3.0 * shear + hardening + TINY_IMPEDANCE) if shear > 0.0 else 0.0
    part = 1.0 - 3.0 * shear * strain / (equivalent + TINY_IMPEDANCE) if shear > 0.0 else 0.0
    return part * s_xx, part * s_yy, part * s_xy, strain
