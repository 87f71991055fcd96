"""Sliding contacts: two lines whose nodes do not match, divided into common pieces.

May import: `regrid`, `hydro.rows`, `hydro.rim`, `hydro.formulas`, `hydro.perimeter`,
`hydro.boundary`, `hydro.facets`.
"""
