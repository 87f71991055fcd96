"""Measures of a given grid: signs, areas, quality, crossings, and why a boundary has no grid.

May import: the interfaces of `regrid` (errors, jit, report, sides).
"""
