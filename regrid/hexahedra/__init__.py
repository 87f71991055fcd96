"""The barrier regridder for blocks of hexahedra: functional, line-preconditioned solve, one move.

May import errors, jit, report and measure of regrid.
"""
