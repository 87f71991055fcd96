"""Named moving domains: the shapes on which regridders are tried.

May import: the contract of `regrid`, `regrid.measure`, `regrid.curves` and `regrid.algebraic`.
"""
