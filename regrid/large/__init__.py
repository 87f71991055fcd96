"""Blocks whose arrays are large: what their regrids share, a linear solve that stores no matrix.

May import: the contract of `regrid` and `regrid.coarse`.
"""
