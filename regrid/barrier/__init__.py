"""The barrier regridder: laws, functional, linear solve, Newton move, sweeps, untangling, repair.

May import: the contract of `regrid`, `regrid.measure`, `regrid.curves`, `regrid.algebraic`,
`regrid.coarse`, `regrid.large`, `regrid.mending` and `regrid.unfolding`.
"""
