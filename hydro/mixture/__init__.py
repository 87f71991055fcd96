"""Cells of two materials: a block whose equation of state sees the fractions that its cells carry.

May import: `regrid`, `hydro.rows`, `hydro.rim`, `hydro.formulas`, `hydro.eos`, `hydro.interior`,
`hydro.perimeter`, `hydro.carried`.
"""
