"""Fluxes through the faces of a perimeter: none of material, or from two traces."""

from __future__ import annotations

from hydro.formulas.riemann import compute_hll_flux, compute_hllc_flux
from hydro.perimeter.rows import (
    AREA_X,
    AREA_Y,
    SURFACE_P,
    SWEPT_RATE,
    TRACE_ACOUSTIC,
    TRACE_C,
    TRACE_E,
    TRACE_HLL,
)
from hydro.rows import ENERGY, MASS, MOMENTUM_X, MOMENTUM_Y, RHO, P, U, V
from regrid.jit import compiled_once, kernel


@kernel
def fill_material_flux(surface, faces, start, stop, flux):
    """Outward flux (4, n) through impermeable faces: pressure acting on the moving face."""
    for k in range(start, stop):
        pressure = surface[SURFACE_P, k]
        flux[MASS, k] = 0.0
        flux[MOMENTUM_X, k] = pressure * faces[AREA_X, k]
        flux[MOMENTUM_Y, k] = pressure * faces[AREA_Y, k]
        flux[ENERGY, k] = pressure * faces[SWEPT_RATE, k]


@compiled_once
def compute_through_flux(a, b, k, area_x, area_y, sweep):
    """Flux from the traces `a` to the traces `b` (rows TRACE_ROWS) through face k."""
    if a[TRACE_HLL, k] + b[TRACE_HLL, k] > 0.0:
        return compute_hll_flux(
            a[RHO, k], a[U, k], a[V, k], a[P, k], a[TRACE_E, k], a[TRACE_C, k], b[RHO, k], b[U, k],
            b[V, k], b[P, k], b[TRACE_E, k], b[TRACE_C, k], area_x, area_y, sweep,
        )  # fmt: skip
    acoustic_weight = (
        a[TRACE_ACOUSTIC, k]
        if a[TRACE_ACOUSTIC, k] > b[TRACE_ACOUSTIC, k]
        else b[TRACE_ACOUSTIC, k]
    )
    return compute_hllc_flux(
        a[RHO, k], a[U, k], a[V, k], a[P, k], a[TRACE_E, k], a[TRACE_C, k], b[RHO, k], b[U, k], b[V,
        k], b[P, k], b[TRACE_E, k], b[TRACE_C, k], area_x, area_y, sweep, acoustic_weight,
    )  # fmt: skip


@kernel
def fill_through_flux(traces, other, first, faces, start, stop, flux):
    """Outward flux where material passes: the Riemann solver of block interiors; flux (4, n)."""
    for k in range(start, stop):
        if first:
            mass, momentum_x, momentum_y, energy = compute_through_flux(
                traces, other, k, faces[AREA_X, k], faces[AREA_Y, k], faces[SWEPT_RATE, k]
            )
            flux[MASS, k] = mass
            flux[MOMENTUM_X, k] = momentum_x
            flux[MOMENTUM_Y, k] = momentum_y
            flux[ENERGY, k] = energy
        else:
            mass, momentum_x, momentum_y, energy = compute_through_flux(
                other, traces, k, -faces[AREA_X, k], -faces[AREA_Y, k], -faces[SWEPT_RATE, k]
            )
            flux[MASS, k] = -mass
            flux[MOMENTUM_X, k] = -momentum_x
            flux[MOMENTUM_Y, k] = -momentum_y
            flux[ENERGY, k] = -energy


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
