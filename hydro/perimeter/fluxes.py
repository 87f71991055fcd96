"""Fluxes through the faces of a perimeter: none of material, or from two traces."""

from __future__ import annotations

from hydro.formulas.riemann import compute_hll_flux, compute_hllc_flux
from regrid.jit import kernel, phase


@kernel
def fill_material_flux(surface, faces, start, stop, flux):
    """Outward flux (4, n) through impermeable faces: pressure acting on the moving face."""
    for k in range(start, stop):
        pressure = surface[0, k]
        flux[0, k] = 0.0
        flux[1, k] = pressure * faces[0, k]
        flux[2, k] = pressure * faces[1, k]
        flux[3, k] = pressure * faces[2, k]


@phase
def compute_through_flux(a, b, k, area_x, area_y, sweep):
    """Flux from the traces `a` to the traces `b` (rows TRACE_ROWS) through face k."""
    if a[6, k] + b[6, k] > 0.0:
        return compute_hll_flux(
            a[0, k], a[1, k], a[2, k], a[3, k], a[4, k], a[5, k],
            b[0, k], b[1, k], b[2, k], b[3, k], b[4, k], b[5, k], area_x, area_y, sweep,
        )  # fmt: skip
    wave_part = a[7, k] if a[7, k] > b[7, k] else b[7, k]
    return compute_hllc_flux(
        a[0, k], a[1, k], a[2, k], a[3, k], a[4, k], a[5, k],
        b[0, k], b[1, k], b[2, k], b[3, k], b[4, k], b[5, k], area_x, area_y, sweep, wave_part,
    )  # fmt: skip


@kernel
def fill_through_flux(traces, other, first, faces, start, stop, flux):
    """Outward flux where material passes: the Riemann solver of block interiors; flux (4, n)."""
    for k in range(start, stop):
        if first:
            mass, momentum_x, momentum_y, energy = compute_through_flux(
                traces, other, k, faces[0, k], faces[1, k], faces[2, k]
            )
            flux[0, k] = mass
            flux[1, k] = momentum_x
            flux[2, k] = momentum_y
            flux[3, k] = energy
        else:
            mass, momentum_x, momentum_y, energy = compute_through_flux(
                other, traces, k, -faces[0, k], -faces[1, k], -faces[2, k]
            )
            flux[0, k] = -mass
            flux[1, k] = -momentum_x
            flux[2, k] = -momentum_y
            flux[3, k] = -energy


@kernel
def spread_flux(flux, flux_i, flux_j):
    """Turn the outward fluxes (4, faces) of a perimeter into fluxes towards +i and +j."""
    nj = flux_i.shape[2]
    ni = flux_j.shape[2]
    for q in range(4):
        for k in range(nj):
            flux_i[0, q, k] = -flux[q, k]
            flux_i[1, q, k] = flux[q, nj + k]
        for k in range(ni):
            flux_j[0, q, k] = -flux[q, 2 * nj + k]
            flux_j[1, q, k] = flux[q, 2 * nj + ni + k]
