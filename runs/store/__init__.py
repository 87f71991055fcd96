"""A run's directory and files: HDF5 dumps, restart points, history, VTK and XDMF.

May import: what `runs.deck` may, and `runs.deck`.
"""
