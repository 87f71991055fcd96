"""Convection in two-dimensional boxes: fields, walls, march, steady solver, stability.

May import: `regrid`, `hydro.convection.tensor_grids`.
"""
