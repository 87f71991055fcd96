"""What ranks of MPI gain: runs clocked step by step, a model of a step's cost, its picture.

`python benchmarks/bench_mpi.py` says how.  May import everything of the packages.
"""
