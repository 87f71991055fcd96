"""The race: time to a given error, beside other codes on one core of one machine.

    python -m benchmarks.race --cloverleaf DIR --pennant DIR --peer-python PYTHON --write

DIR are checkouts of UK-MAC/CloverLeaf_ref and lanl/PENNANT (built in a copy, g++ and gfortran with
an MPI wrapper); PYTHON is an interpreter with clawpack and pyro-hydro.  A code that is not given is
left out.  Each code computes a case on a row of grids; kept are the error against the case's
reference and the CPU seconds of the whole command.

May import: everything of this repository but `tests`.
"""
