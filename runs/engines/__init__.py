"""Many computations at once: processes of this machine, MPI, dask.

May import: `regrid`, `hydro`.
"""
