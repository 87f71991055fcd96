"""Convection between vertical plates: a column, and its march.

May import: `regrid`, `hydro.convection.tensor_grids`.
"""
