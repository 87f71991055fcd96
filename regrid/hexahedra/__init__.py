"""The barrier regridder for blocks of hexahedra: functional, line-preconditioned solve, one move.

May import: the contract of `regrid`, `regrid.barrier` and `regrid.measure`.
"""
