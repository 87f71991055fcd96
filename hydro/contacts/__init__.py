"""Bodies that come into contact, separate and meet again; facets between their surfaces.

May import: `regrid`, `hydro.rows`, `hydro.formulas`, `hydro.perimeter`, `hydro.rim`,
`hydro.block`, `hydro.boundary`, `hydro.facets`, `hydro.sliding`, `hydro.links`, `hydro.motion`.
"""
