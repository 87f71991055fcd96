"""A grid with a few bad corners: where they are, and steps made shorter at their nodes.

May import: the contract of `regrid` and `regrid.measure`.
"""
