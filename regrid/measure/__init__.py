"""Judging a given grid: signs, areas, quality, crossings, why a boundary has no grid.

May import: the contract of `regrid` (errors, jit, report, sides).
"""
