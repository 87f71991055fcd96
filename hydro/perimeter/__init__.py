"""Kernels of the cells and faces along a block's four sides.

May import: `regrid`, `hydro.rows`, `hydro.formulas`, `hydro.eos`.
"""
