"""Strength of solids: stress that rides with the flow, yields and turns with the material.

May import: `regrid`, `hydro.rows`, `hydro.rim`, `hydro.formulas`, `hydro.eos`, `hydro.interior`,
`hydro.perimeter`, `hydro.carried`, `hydro.strength.laws`, `hydro.strength.spall`.
"""
