"""How far nodes may move in a step.

May import: the contract of `regrid`, `regrid.measure`, `regrid.curves`,
`regrid.algebraic` and `regrid.large`.
"""
