"""Bodies that meet, part and meet again: facets between surfaces, each with a line of its own.

May import: `regrid`, `hydro.rows`, `hydro.formulas`, `hydro.perimeter`, `hydro.rim`,
`hydro.block`, `hydro.boundary`, `hydro.sliding`, `hydro.links`, `hydro.motion`.
"""
