"""The barrier regridder: functional, linear solve, Newton move, sweeps, untangling, repair.

May import: the interfaces of `regrid`, `regrid.measure`, `regrid.curves` and `regrid.algebraic`.
"""
