"""One flow on the ranks of MPI: who computes which block, and what the others are told.

May import: `regrid`, `hydro.rows`, `hydro.interior`, `hydro.block`.
"""
