"""Smooth errors of large blocks: seen in sums over stretches of lines, taken away on coarse nodes.

May import: the contract of `regrid`.  Knows the functional by the Hessian of single cells.
"""
