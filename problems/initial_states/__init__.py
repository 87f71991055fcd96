"""Grids and cell states at t = 0 that several problems share.

May import: `regrid`, `hydro`, `problems.references`.
"""
