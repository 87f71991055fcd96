"""The few cells that would hold back the time step of all others: found, and kept stable.

May import: `regrid`, `hydro.formulas`, `hydro.eos`, `hydro.rows`, `hydro.rim`, `hydro.interior`,
`hydro.perimeter`, `hydro.block`, `hydro.ranks`.
"""
