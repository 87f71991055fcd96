"""Grids written down from the sides: quasi-one-dimensional, transfinite, displacement.

May import: the contract of `regrid`, `regrid.measure` and `regrid.curves`.
"""
