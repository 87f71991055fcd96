"""Fluxes through the faces of a perimeter: none of material, or from two traces."""

from __future__ import annotations

import functools

from hydro.formulas.geometry import PLANE, Geometry
from hydro.formulas.riemann import compute_hll_flux, compute_hllc_flux
from hydro.perimeter.rows import (
    AREA_X,
    AREA_Y,
    SURFACE_P,
    SWEPT_RATE,
    TRACE_ACOUSTIC,
    TRACE_C2,
    TRACE_E,
    TRACE_HLL,
)
from hydro.rows import ENERGY, FLUX_ROWS, HOOP, MASS, MOMENTUM_X, MOMENTUM_Y, PUSH, RHO, P, U, V
from regrid.jit import compiled_once, kernel


@functools.cache
def make_fill_material_flux(geometry: Geometry = PLANE):
    """Kernel that fills the flux through impermeable faces; `Geometry.split`."""
    split = geometry.split

    @kernel
    def fill_material_flux(surface, faces, plane_faces, spans, flux):
        """Outward flux (6, n) through impermeable faces: pressure acting on the moving face.

        faces, plane_faces: rows AREAS of the faces, what flux passes through, and per depth; spans
        (m, 2): from which face to which.
        """
        for number in range(spans.shape[0]):
            for k in range(spans[number, 0], spans[number, 1]):
                pressure = surface[SURFACE_P, k]
                flux[MASS, k] = 0.0
                flux[MOMENTUM_X, k] = pressure * faces[AREA_X, k]
                flux[MOMENTUM_Y, k], flux[PUSH, k], flux[HOOP, k] = split(
                    pressure * faces[AREA_Y, k], pressure, faces[AREA_Y, k], plane_faces[AREA_Y, k]
                )
                flux[ENERGY, k] = pressure * faces[SWEPT_RATE, k]

    return fill_material_flux


@compiled_once
def compute_through_flux(a, b, k, area_x, area_y, sweep):
    """Flux from the traces `a` to the traces `b` (rows TRACE_ROWS) through face k."""
    if a[TRACE_HLL, k] + b[TRACE_HLL, k] > 0.0:
        return compute_hll_flux(
            a[RHO, k], a[U, k], a[V, k], a[P, k], a[TRACE_E, k], a[TRACE_C2, k], b[RHO, k], b[U, k],
            b[V, k], b[P, k], b[TRACE_E, k], b[TRACE_C2, k], area_x, area_y, sweep,
        )  # fmt: skip
    acoustic_weight = (
        a[TRACE_ACOUSTIC, k]
        if a[TRACE_ACOUSTIC, k] > b[TRACE_ACOUSTIC, k]
        else b[TRACE_ACOUSTIC, k]
    )
    return compute_hllc_flux(
        a[RHO, k], a[U, k], a[V, k], a[P, k], a[TRACE_E, k], a[TRACE_C2, k],
        b[RHO, k], b[U, k], b[V, k], b[P, k], b[TRACE_E, k], b[TRACE_C2, k],
        area_x, area_y, sweep, acoustic_weight,
    )  # fmt: skip


@functools.cache
def make_fill_through_flux(geometry: Geometry = PLANE):
    """Kernel that fills the flux through faces where material passes; `Geometry.split`."""
    split = geometry.split

    @kernel
    def fill_through_flux(traces, other, first, faces, plane_faces, start, stop, flux):
        """Outward flux where material passes: the Riemann solver of block interiors; flux (6, n).

        faces, plane_faces: as in `fill_material_flux`.
        """
        for k in range(start, stop):
            one, two = (traces, other) if first else (other, traces)
            sign = 1.0 if first else -1.0
            mass, momentum_x, momentum_y, energy, pressure = compute_through_flux(
                one,
                two,
                k,
                sign * faces[AREA_X, k],
                sign * faces[AREA_Y, k],
                sign * faces[SWEPT_RATE, k],
            )
            momentum_y, push, hoop = split(
                momentum_y, pressure, sign * faces[AREA_Y, k], sign * plane_faces[AREA_Y, k]
            )
            flux[MASS, k] = sign * mass
            flux[MOMENTUM_X, k] = sign * momentum_x
            flux[MOMENTUM_Y, k] = sign * momentum_y
            flux[ENERGY, k] = sign * energy
            flux[PUSH, k] = sign * push
            flux[HOOP, k] = sign * hoop

    return fill_through_flux


@kernel
def spread_flux(flux, flux_i, flux_j):
    """Turn the outward fluxes (6, faces) of a perimeter into fluxes towards +i and +j."""
    nj = flux_i.shape[2]
    ni = flux_j.shape[2]
    for q in range(FLUX_ROWS):
        for k in range(nj):
            flux_i[0, q, k] = -flux[q, k]
            flux_i[1, q, k] = flux[q, nj + k]
        for k in range(ni):
            flux_j[0, q, k] = -flux[q, 2 * nj + k]
            flux_j[1, q, k] = flux[q, 2 * nj + ni + k]
