"""A moving front in one dimension, on grids that follow it.

May import: `regrid`, `hydro.convection.tensor_grids`, `hydro.convection.slot`.
"""
