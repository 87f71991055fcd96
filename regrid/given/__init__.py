"""Grids and curves that people give: read from files, and the first grid on given sides.

May import: the contract of `regrid`, `regrid.measure`, `regrid.algebraic`, `regrid.barrier`,
`regrid.domains`.
"""
