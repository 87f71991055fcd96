"""Two lines on each other whose nodes do not match: facets, their states, what passes.

A facet belongs to one face of the *leader*, whose line it lies on, and to one face of the
*follower*.  Sliding contacts and contacts between bodies find their facets each in its own way;
layout, Riemann problems, means over faces and fluxes are the same.

May import: `regrid`, `hydro.rows`, `hydro.formulas`.
"""
