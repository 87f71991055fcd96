"""The blocks of a flow, and their distribution over MPI ranks.

May import: `regrid`, `hydro.rows`, `hydro.workers`, `hydro.interior`, `hydro.block`.
"""
