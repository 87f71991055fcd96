"""Row kernels for the interior and the sides of a block, a file for each part of the scheme.

`advance` orders them.

May import: `regrid`, `hydro.rows`, `hydro.rim`, `hydro.formulas`, `hydro.eos`.
"""
