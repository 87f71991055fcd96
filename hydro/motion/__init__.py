"""How key nodes and lines move in a step, then the call of the regridder.

May import: `regrid`, `hydro.rows`, `hydro.rim`, `hydro.block`, `hydro.boundary`,
`hydro.sliding`, `hydro.links`, `hydro.ranks`.
"""
