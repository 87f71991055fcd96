"""Row kernels for the interior and the sides of a block, one phase per file; `advance` orders them.

May import: `regrid`, `hydro.rows`, `hydro.rim`, `hydro.formulas`, `hydro.eos`.
"""
