"""Whatever passes between blocks: links of matching lines, sliding contacts, their exchange.

May import: `regrid`, `hydro.rows`, `hydro.perimeter`, `hydro.block`, `hydro.boundary`,
`hydro.sliding`.
"""
