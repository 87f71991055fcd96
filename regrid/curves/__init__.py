"""One line at a time: spacing laws and the redistribution of nodes along a curve.

May import: the contract of `regrid` and `regrid.measure`.
"""
