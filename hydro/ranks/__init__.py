"""The blocks of a flow, and who computes which where ranks of MPI share them.

May import: `regrid`, `hydro.rows`, `hydro.workers`, `hydro.interior`, `hydro.block`.
"""
