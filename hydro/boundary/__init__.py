"""What lies beyond a stretch of a block's side: one kind of segment a file, one registry.

May import: `regrid`, `hydro.rows`, `hydro.rim`, `hydro.formulas`, `hydro.perimeter`, `hydro.block`.
"""
