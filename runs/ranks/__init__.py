"""One run on the ranks of MPI: how it is started, led by the first rank, and ended.

May import: `runs.deck`, `runs.store` and, of the other packages, all below.
"""
