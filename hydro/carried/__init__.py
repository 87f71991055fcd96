"""Carried fields: what cells know besides density, velocity and pressure, moved with the mass.

May import: `regrid`, `hydro.rows`, `hydro.rim`, `hydro.formulas`, `hydro.perimeter`.
"""
