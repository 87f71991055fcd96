"""Kernels of the cells and faces along a block's four sides, on the rows of its rim.

May import: `regrid`, `hydro.rows`, `hydro.rim`, `hydro.formulas`, `hydro.eos`, `hydro.interior`.
"""
