"""Grids on given sides without a fold, from any start: where nothing quicker has found one.

May import: the contract of `regrid`, `regrid.measure`, `regrid.curves` and `regrid.algebraic`.
"""
