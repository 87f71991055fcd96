"""Grids that minimise an integral: Brackbill-Saltzman, Ivanenko-Charakhch'yan, Winslow, relaxed.

May import: all other rooms of `regrid`, but not its registry.
"""
