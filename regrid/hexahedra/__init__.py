"""The barrier regridder for blocks of hexahedra: functional, line-preconditioned solve, one move.

May import: the interfaces of `regrid`, `regrid.barrier` and `regrid.measure`.
"""
